"""Scans against a map: at their true poses where these are known, else where each fits best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from maurice_mcl.sensor.laser.fit import MISFIT_NATS
from maurice_mcl.sensor.laser.matching import INDEPENDENT_BEAMS, THROUGH_M, Matcher
from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_mcl.sensor.laser.reading import read_scan
from maurice_mcl.sensor.laser.sensor import laser_of
from maurice_mcl.values import F64, LaserScan, OccupancyMap

from .findings import Evidence, Finding, RecordedDrive, RecordedScans, Value
from .map_at_truth import AGREE_WELL, CHANGED_SHARE, FITS_OFF, ScansAtTruth
from .scans import Path, poses_at, truth_path

MATCHED = 8  # scans that are searched on a map
CHANCE = 0.8  # share of the beams that disagree, of that of mirrored scans
SCALES = (0.1, 0.5, 0.8, 1.25, 2.0, 10.0)  # of a map, that are tried where no truth is known
NEAR_M, FITS_AT_TRUTH = 0.5, 0.6


def examine_map(
    scans: RecordedScans, drive: RecordedDrive, occupancy: OccupancyMap, known: list[Finding]
) -> tuple[list[Finding], list[str]]:
    """Return what is wrong with a map or with the laser on it, and what was checked.

    `known` are findings about the scans: if the laser is mounted differently, true poses say nothing.
    """
    codes, truth = {finding.code for finding in known}, truth_path(drive)
    there, elsewhere = None, list[Finding]()
    if not any(code.startswith("scan-") for code in codes):
        there = ScansAtTruth.of(scans, occupancy, truth)
    if there is not None:
        elsewhere = there.laser_elsewhere()
        otherwise = [] if elsewhere else there.map_otherwise()
        agree, changed = there.changed()
        check = f"{len(there.poses)} scans against the map at true poses ({agree:.0%} of the beams agree)"
        if otherwise or (agree >= AGREE_WELL and not elsewhere):
            return otherwise or changed, [check]
    findings, check = _searched(scans, occupancy, truth, mirrored="scan-mirrored" in codes)
    return [*elsewhere, *findings], [check]


def _searched(
    scans: RecordedScans, occupancy: OccupancyMap, truth: Path | None, *, mirrored: bool
) -> tuple[list[Finding], str]:
    """Return what is wrong with the map, and what was checked; mirrored scans show what fits by chance."""
    chosen = np.linspace(0, scans.size - 1, min(scans.size, MATCHED)).round().astype(int)
    numbers = list(dict.fromkeys(chosen.tolist()))
    some = [scans.scans[k] for k in numbers]
    places = None if truth is None else poses_at(scans.t_s[numbers], *truth)
    check, signs = f"{len(some)} scans against the map", (-1, 1) if mirrored else (1, -1)
    fits, by_chance = (_best_fits(some, occupancy, sign, places) for sign in signs)
    own, chance = fits.off, by_chance.off
    if np.isnan(own):
        return [], check
    check += f" ({fits.short:.0%} of the beams end before its walls, {fits.beyond:.0%} behind)"
    if own <= FITS_OFF or own < CHANCE * chance or fits.at_truth >= FITS_AT_TRUTH:
        seen = Evidence("fit-where", {"scans": len(some)})
        if fits.at_truth == 0 and fits.agree_at_truth < AGREE_WELL:
            return [Finding("map-frame", (seen,), {"agree": fits.agree_at_truth})], check
        shares = {"short": fits.short, "beyond": fits.beyond}
        changed = fits.short + fits.beyond >= CHANGED_SHARE
        return [Finding("map-changed", (seen,), shares)] if changed else [], check
    seen = Evidence("fit-anywhere", {"scans": len(some), "off": own, "chance": chance})
    if chance <= FITS_OFF:
        details: dict[str, Value] = {"how": "mirrored"}
        return [Finding("map-mirrored", (seen,), details=details)], check
    scaled = {scale: _best_fits(some, _scaled(occupancy, scale), signs[0]).off for scale in SCALES}
    scale = min(scaled, key=lambda name: scaled[name])
    by_luck = _best_fits(some, _scaled(occupancy, scale), signs[1]).off
    if scaled[scale] < CHANCE * min(own, by_luck):
        cells = {"scale": scale, "cell_m": occupancy.cell_m * scale}
        return [Finding("map-scale", (seen,), cells)], check
    height_m, width_m = (side * occupancy.cell_m for side in occupancy.cells.shape)
    return [Finding("map-place", (seen,), {"width_m": width_m, "height_m": height_m})], check


def _scaled(occupancy: OccupancyMap, scale: float) -> OccupancyMap:
    return replace(occupancy, cell_m=occupancy.cell_m * scale)


@dataclass(frozen=True, slots=True)
class _Fits:
    """Shares of the beams where each of some scans fits best; NaN: none was matched."""

    off: float  # that disagree, by their nats: the median of the scans
    short: float  # that end before a wall of the map
    beyond: float  # that end behind one
    at_truth: float  # share of the scans that fit best within `NEAR_M` of their true places; 0: unknown
    agree_at_truth: float  # share of the beams that agree with the map there; 1: unknown


def _best_fits(
    scans: list[LaserScan], occupancy: OccupancyMap, sign: int, places: F64 | None = None
) -> _Fits:
    matcher, laser, shares = Matcher(occupancy), laser_of(occupancy, LaserParameters()), list[list[float]]()
    for number, scan in enumerate(scans):
        turned = replace(scan, start_rad=sign * scan.start_rad, step_rad=sign * scan.step_rad)
        points, reading = turned.points(), read_scan(turned, laser.parameters)
        matches = matcher.search(points, scan.mount)
        if matches is None or reading is None:
            continue
        judged = laser.judged(reading, matches.poses[0])
        off = -float(matches.nats[0]) / (MISFIT_NATS * min(INDEPENDENT_BEAMS, len(points)))
        behind = reading.hits & (judged.measured_m > judged.expected_m + THROUGH_M)  # on whatever is there
        near = places is not None and np.hypot(*(matches.poses[0] - places[number])[:2]) < NEAR_M
        there = judged if places is None else laser.judged(reading, places[number])
        agree = 1.0 if places is None else float(there.are("agrees").mean())
        shares.append([off, judged.are("short").mean(), behind.mean(), float(near), agree])
    if not shares:
        return _Fits(*[float("nan")] * 5)
    return _Fits(float(np.median(np.array(shares)[:, 0])), *np.mean(shares, axis=0)[1:].tolist())
