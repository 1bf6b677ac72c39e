"""Whether the print of a floor lies right: the readings of a drive against the print at the true poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from maurice_mcl.arrays import F32, F64
from maurice_mcl.floor import FloorImage
from maurice_mcl.sensor.reflectance import Probe

AGREES, BETTER = 0.4, 0.3  # least correlation of another orientation, and least gain, to speak of it
DISAGREES, FEWEST_EDGES = 0.3, 16  # a print that lies right agrees better; few edges agree by chance
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


def misplaced(floor: FloorImage, probes: Sequence[Probe], readings: Mapping[str, F64], truth: F64) -> str:
    """Return how else the print fits the readings much better, in one line; empty where it lies right."""
    as_it_is, image = agreement(floor, probes, readings, truth), floor.values.T
    found = {
        (turns, mirrored): agreement(_laid(floor, image, turns, mirrored), probes, readings, truth)
        for turns in range(4)
        for mirrored in (False, True)
    }
    (turns, mirrored), best = max(found.items(), key=lambda one: one[1])
    seen = sum(_crossings(readings[probe.name]) for probe in probes)
    if as_it_is > DISAGREES or best < AGREES or best - as_it_is < BETTER or seen < FEWEST_EDGES:
        return ""
    how = [f"turned by {90 * turns} deg counter-clockwise"] * (turns > 0)
    how += ["then mirrored left to right" if turns else "mirrored left to right"] * mirrored
    fits = (
        f"the readings fit it much better {', '.join(how)} (correlation {best:.2f}, as it is {as_it_is:.2f})"
    )
    return f"map.png lies wrong: at the true poses {fits}; save the picture so"


def _crossings(values: F64) -> int:
    """Return how often readings (N,) crossed the middle between their ends: edges of the print."""
    known = values[np.isfinite(values)]
    if not len(known):
        return 0
    low, high = np.quantile(known, (0.02, 0.98))
    return int((np.diff(known > (low + high) / 2) != 0).sum())


def _laid(floor: FloorImage, image: F32, turns: int, mirrored: bool) -> FloorImage:
    """Return the floor of the picture as stored, turned counter-clockwise, then mirrored left to right."""
    turned = np.rot90(image, turns)
    laid = np.fliplr(turned) if mirrored else turned
    return FloorImage(np.ascontiguousarray(laid.T), floor.resolution_m, floor.origin)
