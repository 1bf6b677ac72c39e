"""Scans at their true poses on a map: where the laser is, and how the map is mirrored, scaled or outdated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from maurice_mcl.sensor.laser.beams import judge
from maurice_mcl.sensor.laser.fit import MISFIT_NATS, MOUNTS_M, ScanFits
from maurice_mcl.sensor.laser.matching import THROUGH_M
from maurice_mcl.sensor.laser.models import SIGMA_M, laser_map
from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_mcl.sensor.laser.reading import LaserReading
from maurice_mcl.values import F64, OccupancyMap, rotated

from .findings import Evidence, Finding, RecordedScans, Value
from .scans import FEWEST_PAIRS, Path, is_clear, poses_at

PLACED, LEAST_PLACED_M = 40, 0.15  # scans at true poses; how far a laser is elsewhere, at least
HALVED = 0.5  # of the nats, or of the beams, that are left where something else explains the scans
FITS_OFF = 0.1  # share of the beams that disagree where a scan fits
AGREE_WELL = 0.5  # of the beams: with as many, the map is of the place, and has changed or not
# of the beams that end before or behind the map's walls: where scans fit best, and at true poses, where seven
# CARMEN logs on maps of their own scans have 0.08 to 0.16
CHANGED_SHARE, CHANGED_AT_TRUTH = 0.15, 0.2
SCALES = (
    0.1,
    0.5,
    *np.round(np.arange(0.75, 1.335, 0.01), 2).tolist(),
    2.0,
    10.0,
)  # of a map, that are tried


@dataclass(frozen=True, slots=True, eq=False)
class ScansAtTruth:
    """Some scans of a drive with their true poses, spread over it, on a map."""

    occupancy: OccupancyMap
    fits: ScanFits
    readings: tuple[LaserReading, ...]
    poses: F64  # (S, 3) in the map's frame

    @classmethod
    def of(cls, scans: RecordedScans, occupancy: OccupancyMap, truth: Path | None) -> ScansAtTruth | None:
        """Choose scans; None where fewer than eight have a true pose."""
        if truth is None:
            return None
        known = np.flatnonzero((scans.t_s >= truth[0][0]) & (scans.t_s <= truth[0][-1]))
        most = min(len(known), PLACED)
        chosen = known[np.unique(np.linspace(0, len(known) - 1, most).round().astype(int))]
        fits = ScanFits(occupancy, np.zeros((1, 3)))
        read = [(fits.read(scans.scans[k]), k) for k in chosen]
        pairs = [(reading, k) for reading, k in read if reading is not None]
        if len(pairs) < FEWEST_PAIRS:
            return None
        poses = poses_at(scans.t_s[[k for _, k in pairs]], *truth)
        return cls(occupancy, fits, tuple(reading for reading, _ in pairs), poses)

    def laser_elsewhere(self) -> list[Finding]:
        """Return where the laser is on the robot, by how scans lie on the map at poses of many headings.

        Moved along the map's axes instead, as a map or a truth that is moved would be, they must fit less.
        """
        both = list(zip(self.readings, self.poses, strict=True))
        by_place = np.array([self.fits.placed(reading, pose) for reading, pose in both])
        along = np.pad(MOUNTS_M, ((0, 0), (0, 1)))
        shifted = np.array([self.fits.nats(reading, pose + along) for reading, pose in both], np.float64)
        usual, best = int(np.hypot(*MOUNTS_M.T).argmin()), int(by_place.mean(axis=0).argmax())
        ahead_m, left_m = (float(value) for value in MOUNTS_M[best])
        clear = is_clear(-by_place[:, usual], -by_place[:, best], HALVED)
        better = by_place[:, best].mean() > shifted.mean(axis=0).max()
        if np.hypot(ahead_m, left_m) < LEAST_PLACED_M or not (clear and better):
            return []
        lacks = {"lack_before": -by_place[:, usual].mean(), "lack_after": -by_place[:, best].mean()}
        seen = Evidence("at-truth", {"scans": len(both), **lacks})
        return [Finding("scan-place", (seen,), {"ahead_m": ahead_m, "left_m": left_m})]

    def map_otherwise(self) -> list[Finding]:
        """Return how the map would have to be mirrored, turned or scaled for the scans to fit."""
        usual = self._off(np.ones(2), np.zeros(2))
        offs = {way: self._off(*scaled) for way, scaled in self._ways().items()}
        best = min(offs, key=lambda way: float(offs[way].mean()))
        if offs[best].mean() > FITS_OFF or not is_clear(usual, offs[best], HALVED):
            return []
        numbers = {"scans": len(usual), "before": usual.mean(), "after": offs[best].mean()}
        seen = (Evidence("map-at-truth", numbers),)
        if isinstance(best, float):
            cells = {"scale": best, "cell_m": self.occupancy.cell_m * best}
            return [Finding("map-scale", seen, cells)]
        details: dict[str, Value] = {"how": best}
        return [Finding("map-mirrored", seen, details=details)]

    def changed(self) -> tuple[float, list[Finding]]:
        """Return the share of the beams that agree, and whether the place has changed since it was mapped."""
        laser = laser_map(self.occupancy, LaserParameters())
        both = zip(self.readings, self.poses, strict=True)
        judged = [(reading.hits, judge(laser, laser.open_rays, reading, pose)) for reading, pose in both]
        count = sum(int(hits.sum()) for hits, _ in judged)
        # on whatever is there: a beam may end at a wall that it could not see
        behind = [hits & (each.measured_m > each.expected_m + THROUGH_M) for hits, each in judged]
        ends = [each.are("agrees") & ~through for (_, each), through in zip(judged, behind, strict=True)]
        beyond, agree = (sum(int(flags.sum()) for flags in each) / count for each in (behind, ends))
        short = sum(each.count("short") for _, each in judged) / count
        seen = Evidence("scans-at-truth", {"scans": len(judged)})
        findings = [Finding("map-changed", (seen,), {"short": short, "beyond": beyond})]
        return agree, findings if short + beyond >= CHANGED_AT_TRUTH else []

    def _off(self, factor: F64, about: F64) -> F64:
        """Return the share of each scan's beams (S,) that disagree, their ends scaled about a place (2,)."""
        field = laser_map(self.occupancy, LaserParameters()).field("calibrated", SIGMA_M)
        nats = list[float]()
        for reading, pose in zip(self.readings, self.poses, strict=True):
            x, y = rotated(reading.ends[:, 0], reading.ends[:, 1], float(pose[2]))
            ends = np.column_stack([x, y]) + pose[:2]
            nats.append(float(field.at(about + (ends - about) * factor).mean()))
        return np.array(nats) / -MISFIT_NATS

    def _ways(self) -> Mapping[str | float, tuple[F64, F64]]:
        """Return by what factor, and about what place, ends of beams are scaled; -1 mirrors them."""
        corner, sides = self.occupancy.corner, np.array(self.occupancy.cells.shape[::-1])
        middle = corner + sides * self.occupancy.cell_m / 2
        flips = {way: (np.array(factor), middle) for way, factor in FLIPS.items()}
        return flips | {scale: (np.full(2, 1 / scale), corner) for scale in SCALES if scale != 1}


FLIPS = {
    "mirrored left to right": (-1.0, 1.0),
    "mirrored upside down": (1.0, -1.0),
    "turned by 180 deg": (-1.0, -1.0),
}
