"""The library: reference poses with what each channel measured there, the filter's map; how near is near."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np

from .arrays import F32, F64
from .geometry import INCH_M, wrap
from .laser import OccupancyMap
from .map import Arena
from .nearest import Keep, made_anew
from .pose_sensor import PoseSensor
from .session import Camera
from .setting_rules import radius


def units_of(values: F32) -> F32:
    """Return rows (..., D) at length 1; zeros stay zeros."""
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    units: F32 = np.divide(values, length, out=np.zeros_like(values), where=length > 0)
    return units


@dataclass(frozen=True, eq=False)
class ChannelIndex:
    """One channel over all of a library, in the unit of that channel."""

    references: F32  # (L, D)
    noise_floor: F32  # (D,) what the channel measures with the lens covered; zeros when not measured
    relevance: F32  # (D,) per-bin maximum over the library (thesis fig. 15)

    @cached_property
    def centered(self) -> Centered:
        """The references about their mean, for distances by products."""
        return Centered.of(self.references)

    @cached_property
    def centered_roots(self) -> Centered:
        """Square roots of the references, about their mean."""
        return Centered.of(np.sqrt(self.references))

    @cached_property
    def centered_units(self) -> Centered:
        """The references at length 1, about their mean."""
        return Centered.of(units_of(self.references))


@dataclass(frozen=True, slots=True, eq=False)
class Centered:
    """Rows about their mean, with their squared lengths: what a distance by products needs of a library."""

    middle: F32  # (D,)
    rows: F32  # (L, D) rows minus the middle
    squared: F32  # (L,) squared lengths of the rows

    @classmethod
    def of(cls, values: F32) -> Centered:
        """Center values (L, D)."""
        middle = values.mean(axis=0, dtype=np.float64).astype(np.float32)
        rows = values - middle
        return cls(middle, rows, np.einsum("ij,ij->i", rows, rows))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Library:
    """L reference pictures with their surveyed poses, and the map they were taken in.

    `maurice_loaders.open_library` returns one for a library folder or a survey log.

        >>> import maurice_mcl as mcl
        >>> library = mcl.tiny_library()
        >>> library.size, library.index["color"].references.shape
        (96, (96, 84))
    """

    name: str
    poses: F64  # (L, 3) as surveyed, in the map's frame
    pictures: tuple[Path | None, ...]  # L files, None where the picture is not kept
    index: Mapping[str, ChannelIndex]  # by channel name
    arena: Arena
    display_units: str = "m"
    sensors: Mapping[str, PoseSensor] = field(default_factory=dict)  # besides the channels, by name
    camera: Camera | None = None  # what is known of the one that took the pictures
    keep: Keep = made_anew  # where tables are kept from one start to the next

    def __repr__(self) -> str:
        """Return what it holds, in a line."""
        contents = ", ".join([*self.index, *self.sensors]) or "a map"
        return f"Library({self.name!r}, {self.size} references: {contents})"

    @property
    def size(self) -> int:
        """The number of entries L."""
        return len(self.poses)

    @property
    def occupancy(self) -> OccupancyMap | None:
        """What scans of a laser are compared with; None: no such map."""
        return self.arena.occupancy

    @property
    def is_map(self) -> bool:
        """Whether the entries are places on an occupancy map alone: no references that people can look at."""
        return self.occupancy is not None and not self.index

    @property
    def origin(self) -> F64:
        """The point (2,) that float32 poses are stored relative to: the middle of the map."""
        x_min, y_min, x_max, y_max = self.arena.bounds
        return np.array([(x_min + x_max) / 2, (y_min + y_max) / 2])


# The radii by which a cloud is summarized and an estimate judged, by default derived from the library.

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
