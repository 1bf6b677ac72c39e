"""The beams of a scan that are compared with the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...values import F32, F64, I32, Bool, LaserScan
from .parameters import BELUGAS, LaserParameters

LEAST_HITS = 8  # fewer beams that hit something do not tell where the robot is


@dataclass(frozen=True, slots=True, eq=False)
class LaserReading:
    """B chosen beams of one scan, in the robot's frame; beams without an answer are left out."""

    scan: LaserScan
    beams: I32  # (B,) their numbers in the scan
    angles_rad: F64  # (B,) counter-clockwise from the robot's forward
    ranges_m: F32  # (B,) `max_m` where nothing was hit
    hits: Bool  # (B,) which hit something
    max_m: float  # the reach in use
    ends: F64  # (K, 2) x_m, y_m in the robot's frame where the beams that hit something end
    range_m: float  # the median of those

    @property
    def size(self) -> int:
        """The number of beams B."""
        return len(self.beams)


def read_scan(scan: LaserScan, parameters: LaserParameters) -> LaserReading | None:
    """Choose beams as the model does; None where fewer than `LEAST_HITS` hit something.

    As in AMCL, a range below the least one counts as nothing hit. For Beluga one at a limit is a hit, too.
    """
    least = max(scan.min_m, parameters.laser_min_range)
    most = min(scan.max_m, parameters.laser_max_range) if parameters.laser_max_range > 0 else scan.max_m
    ranges = scan.ranges_m
    with np.errstate(invalid="ignore"):
        hits = (ranges > least) & (ranges < most)
        if parameters.model in BELUGAS:
            hits |= (ranges == np.float32(least)) | (ranges == np.float32(most))
    beams = _chosen(hits, parameters)
    beams = beams[~np.isnan(ranges[beams])].astype(np.int32)
    hit = hits[beams]
    if np.count_nonzero(hit) < LEAST_HITS:
        return None
    angles, kept = scan.angles_rad[beams], np.where(hit, ranges[beams], np.float32(most))
    hit_m, along_rad = kept[hit], angles[hit]
    ends = np.empty((len(hit_m), 2))
    np.multiply(hit_m, np.cos(along_rad), out=ends[:, 0])
    np.multiply(hit_m, np.sin(along_rad), out=ends[:, 1])
    ends += scan.mount[:2]
    return LaserReading(scan, beams, angles, kept, hit, most, ends, _median(hit_m))


def _median(values: F32) -> float:
    """Return the median (B,); of an even number the mean of the middle two."""
    ordered, half = np.sort(values), len(values) // 2
    return float(ordered[half] if len(values) % 2 else (ordered[half - 1] + ordered[half]) / 2)


def _chosen(hits: Bool, parameters: LaserParameters) -> I32:
    """Return numbers of beams: AMCL's every n-th, Beluga's evenly, ours so among those that hit something."""
    size, wanted = len(hits), parameters.max_beams
    if parameters.model == "calibrated":
        answered = np.flatnonzero(hits)
        count = min(wanted, len(answered))
        return answered[(2 * np.arange(count) + 1) * len(answered) // max(2 * count, 1)].astype(np.int32)
    if parameters.model in BELUGAS:
        count = min(wanted, size)
        return (-(-np.arange(count) * (size - 1) // max(count - 1, 1))).astype(np.int32)
    rounded_up = parameters.model == "likelihood_field_prob"
    step = -(-size // wanted) if rounded_up else (size - 1) // (wanted - 1)
    return np.arange(0, size, max(step, 1), dtype=np.int32)
