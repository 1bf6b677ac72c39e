"""The radii by which a cloud is summarized and an estimate judged, by default derived from the library."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from .arrays import F64
from .geometry import INCH_M, wrap
from .library import Library
from .setting_rules import radius

NAMES = ("confidence_m", "right_m", "cluster_m", "lost_m")  # from the smallest to the largest
SHARES_OF_RIGHT = {"confidence_m": 2 / 3, "right_m": 1.0, "cluster_m": 4 / 3, "lost_m": 2.0}

LEAST_RIGHT_M = INCH_M  # the accuracy of a true pose: nothing is judged more strictly
LEAST_SHARE_OF_SIDE, MOST_SHARE_OF_SIDE = 1 / 200, 1 / 8  # of the map's side, the square root of its area
SAME_WAY_RAD = math.radians(46)  # a neighbor's heading may differ by one of eight steps
ONE_PLACE = 0.75  # of the least radius: nearer entries are at one place
MOST_ENTRIES = 1000  # that the spacing is taken from


@dataclass(frozen=True, slots=True)
class Radii:
    """Four lengths, in the proportion 2 : 3 : 4 : 6; by default those for references 18 in apart."""

    confidence_m: float = 12 * INCH_M  # about the estimate: the weight within it is the confidence
    right_m: float = 18 * INCH_M  # an estimate that is no farther off is correct
    cluster_m: float = 24 * INCH_M  # of a mode of the cloud, and about the estimate for "converged"
    lost_m: float = 36 * INCH_M  # an estimate that is farther off is lost


USUAL = Radii()


@dataclass(frozen=True, slots=True)
class RadiiParameters:
    """Radii that a user has set; 0: derived from the library, in proportion to `right_m`."""

    confidence_m: Annotated[float, radius] = 0.0
    right_m: Annotated[float, radius] = 0.0
    cluster_m: Annotated[float, radius] = 0.0
    lost_m: Annotated[float, radius] = 0.0


def radii_of(library: Library, given: RadiiParameters | None = None) -> Radii:
    """Return the radii for a library: an estimate is right where it is within the references' spacing.

    That radius is at most an eighth of the map's side: otherwise a uniform cloud would count as converged.
    It is at least a 200th of that side and one inch, and never above a given `lost_m`.
    """
    given = given or RadiiParameters()
    least_m, most_m = bounds_of(library.arena.size_m)
    usual_m = _spacing(library, least_m) or USUAL.right_m
    # inches to two places, so that radii do not depend on the last bits of surveyed poses
    right_in = round(min(max(usual_m, least_m), most_m) / INCH_M, 2)
    radii = Radii(
        2 * right_in / 3 * INCH_M, right_in * INCH_M, 4 * right_in / 3 * INCH_M, 2 * right_in * INCH_M
    )
    if given.right_m:
        radii = Radii(**{name: share * given.right_m for name, share in SHARES_OF_RIGHT.items()})
    named = {name: getattr(given, name) for name in NAMES}
    radii = replace(radii, **{name: value for name, value in named.items() if value})
    return replace(radii, right_m=min(radii.right_m, radii.lost_m))


def bounds_of(size_m: tuple[float, float]) -> tuple[float, float]:
    """Return the least and the largest radius within which an estimate is right, on a map of this size."""
    side_m = math.sqrt(size_m[0] * size_m[1])
    least_m = max(LEAST_RIGHT_M, LEAST_SHARE_OF_SIDE * side_m)
    return least_m, max(least_m, MOST_SHARE_OF_SIDE * side_m)


def fitted_m(usual_m: float, xy: F64) -> float:
    """Return a length that suits rooms, scaled if positions (n, 2) cover a far smaller or larger area.

    It stays between a twelfth and a 400th of the positions' diagonal.
    """
    diagonal_m = float(np.hypot(*np.ptp(xy, axis=0))) if len(xy) else 0.0
    return min(max(usual_m, diagonal_m / 400), diagonal_m / 12) if diagonal_m else usual_m


def _spacing(library: Library, least_m: float) -> float:
    """Return the median distance from an entry to the next place with a similar heading; 0 for none."""
    nearest, poses = list[float](), library.poses[:0] if library.is_map else library.poses
    for pose in poses[:: math.ceil(len(poses) / MOST_ENTRIES) or 1]:
        apart_m = np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1])
        turned = np.abs(wrap(poses[:, 2] - pose[2]))
        others = apart_m[(apart_m > ONE_PLACE * least_m) & (turned <= SAME_WAY_RAD)]
        if len(others):
            nearest.append(float(others.min()))
    return float(np.median(nearest)) if nearest else 0.0
