"""Whether the print of a floor and the probes lie right: readings against the print at the true poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.floor import FloorImage
from maurice_mcl.sensor.reflectance import Probe

AGREES, BETTER = 0.4, 0.3  # least correlation of another orientation, and least gain, to speak of it
DISAGREES, FEWEST_EDGES = 0.3, 16  # a print that lies right agrees better; few edges agree by chance
CLEARER = 0.1  # least gain of exchanged sides, which lie near each other
SCALES = (1.0, 0.1, 0.5, 2.0)  # times as wide a pixel
LEAST_ON_PRINT = 0.5  # share of true places, for the drive to have been on it
LEAST_ON = 0.9  # share of the true poses that lie on a print


def agreement(floor: FloorImage, probes: Sequence[Probe], readings: Mapping[str, F64], truth: F64) -> float:
    """Return the mean correlation of the probes' readings with the print at true poses (N, 3); -1 to 1.

    0 where too little of the drive lies on the print, or all of it is of one shade.
    """
    found = []
    cos, sin = np.cos(truth[:, 2]), np.sin(truth[:, 2])
    for probe in probes:
        x = truth[:, 0] + cos * probe.x_m - sin * probe.y_m
        y = truth[:, 1] + sin * probe.x_m + cos * probe.y_m
        light, values = floor.at(np.column_stack([x, y])).astype(np.float64), readings[probe.name]
        on = np.isfinite(light) & np.isfinite(values)
        if on.mean() < LEAST_ON or not np.ptp(light[on]) or not np.ptp(values[on]):
            return 0.0
        found.append(float(np.corrcoef(light[on], values[on])[0, 1]))
    return float(np.mean(found)) if found else 0.0


def off_print(floor: FloorImage, truth: F64) -> str:
    """Return that a drive (N, 3) was not on the print, in one line; empty where most of it was."""
    x_min, y_min, x_max, y_max = floor.bounds
    on = (truth[:, :2] >= [x_min, y_min]).all(axis=1) & (truth[:, :2] <= [x_max, y_max]).all(axis=1)
    if not len(truth) or on.mean() >= LEAST_ON_PRINT:
        return ""
    (low_x, low_y), (high_x, high_y) = truth[:, :2].min(axis=0), truth[:, :2].max(axis=0)
    drive = f"the true places go from x {low_x:.4g} to {high_x:.4g}, y {low_y:.4g} to {high_y:.4g}"
    size = f"x 0 to {x_max:.4g}, y 0 to {y_max:.4g}"
    found = f"map.png ({size} m) holds {on.mean():.0%} of the drive: {drive}, expected meters on the print"
    return f"{found}; see --reading truth_scale=0.001,odometry_scale=0.001 for millimeters"


@dataclass(frozen=True, slots=True, order=True)
class _Way:
    """How else a print may lie; the plainest comes first."""

    exchanged: bool = False  # left and right of the probes
    times: float = 1.0  # as wide a pixel as it was taken for
    turns: int = 0  # quarters, counter-clockwise
    mirrored: bool = False  # then left to right

    def of(self, floor: FloorImage, probes: Sequence[Probe]) -> tuple[FloorImage, list[Probe]]:
        turned = np.rot90(floor.values.T, self.turns)
        laid = np.fliplr(turned) if self.mirrored else turned
        side_m = floor.resolution_m * self.times
        sides = [replace(one, y_m=-one.y_m) if self.exchanged else one for one in probes]
        return FloorImage(np.ascontiguousarray(laid.T), side_m, floor.origin), sides


WAYS = tuple(_Way(*way) for way in product((False, True), SCALES, range(4), (False, True)))


def misplaced(floor: FloorImage, probes: Sequence[Probe], readings: Mapping[str, F64], truth: F64) -> str:
    """Return how else the print fits the readings much better, in one line; empty where it lies right.

    Other ways are: turned or mirrored, of another scale, and with the left and right probes exchanged.
    """
    if sum(_crossings(readings[probe.name]) for probe in probes) < FEWEST_EDGES:
        return ""
    found = {way: agreement(*way.of(floor, probes), readings, truth) for way in WAYS}
    as_it_is = found[_Way()]
    way = max((one for one in WAYS if not one.exchanged), key=lambda one: found[one])
    exchanged = max((one for one in WAYS if one.exchanged), key=lambda one: found[one])
    if found[exchanged] - found[way] >= CLEARER:
        way = exchanged
    best, sides_only = found[way], way == _Way(exchanged=True)
    if best < AGREES or (not sides_only and (as_it_is > DISAGREES or best - as_it_is < BETTER)):
        return ""
    how = f"(correlation {best:.2f}, as it is {as_it_is:.2f})"
    if sides_only:
        names = " and ".join(f"sensor_{probe.name}.txt" for probe in probes if probe.y_m)
        fits = f"at the true poses they fit map.png better with left and right exchanged {how}"
        return (
            f"{names} lie on the other side: {fits}; exchange the files, or the signs of y_m in probes.toml"
        )
    fits = f"the readings fit it much better {_described(way, floor)} {how}"
    return f"map.png lies wrong: at the true poses {fits}; save the picture so"


def _described(way: _Way, floor: FloorImage) -> str:
    how = [f"turned by {90 * way.turns} deg counter-clockwise"] * (way.turns > 0)
    how += ["then mirrored left to right" if way.turns else "mirrored left to right"] * way.mirrored
    if way.times != 1:
        rows, columns = (max(1, round(count * way.times)) for count in floor.values.T.shape)
        was, taken = (f"{100 * floor.resolution_m * times:g} cm" for times in (way.times, 1))
        how.insert(0, f"as {was} a pixel: resized to {columns} x {rows} pixels of {taken}")
    if way.exchanged:
        how.append("with the left and right sensors exchanged")
    return ", ".join(how)


def _crossings(values: F64) -> int:
    """Return how often readings (N,) crossed the middle between their ends: edges of the print."""
    known = values[np.isfinite(values)]
    if not len(known):
        return 0
    low, high = np.quantile(known, (0.02, 0.98))
    return int((np.diff(known > (low + high) / 2) != 0).sum())
