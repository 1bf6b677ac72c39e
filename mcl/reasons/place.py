"""What one update says of the place where the robot is: does its sensor know it, are particles there.

Where the truth is not known, the place is that of the reference that matches best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scoring.modes import around
from ..scoring.table import LOST_RAD
from ..sensor.references import NearestReference
from ..values import F32, F64, Comparison, Library, StepRecord
from ..values.geometry import wrap_angle
from ..values.map import crosses


@dataclass(frozen=True, slots=True)
class PlaceKnown:
    """One run at one place, by its weighted cloud. Near is within the radius "cluster", at a like heading."""

    is_true: bool  # where the robot is; else where the picture fits best
    nearest_m: float  # from the place to the nearest particle of any heading
    share: float  # of the weight that is near
    near: int  # particles that are near
    reach_m: float  # the radius "cluster"
    rank: int | None = None  # of the true place's reference, 1: none is likelier; None: not compared
    entries: int = 0  # that are ranked
    agree: tuple[int, int] | None = None  # beams of a laser that fit the true place, and all

    @property
    def has_dot(self) -> bool:
        """Whether any particle is within reach, whatever its heading."""
        return self.nearest_m <= self.reach_m


def place_known(
    record: StepRecord,
    truth: F64 | None,
    entry: int,
    library: Library,
    agree: tuple[int, int] | None = None,
    fits: F64 | None = None,
) -> PlaceKnown | None:
    """Return what is known of the true pose (3,), whose reference is the library's `entry`, -1: none.

    `agree` are the beams of a laser that fit there. Without truth the place is where the picture `fits` best,
    by default by this record; None where no picture was compared.
    """
    comparison, rank = record.sighting.comparison, None
    place = truth
    if place is None:
        place = fits_best(record, library) if fits is None else fits
    if place is None:
        return None
    if truth is not None and entry >= 0 and _is_ranked(comparison, library):
        rank = rank_of(comparison.log_likelihood, entry)
    reach_m = record.estimate.radii.cluster_m
    nearest_m, near = around(record.weighted, place, reach_m)
    share = float(record.weighted.weights[near].sum())
    known = None if truth is None else agree
    count, is_true = int(np.count_nonzero(near)), truth is not None
    return PlaceKnown(is_true, nearest_m, share, count, reach_m, rank, library.size, known)


def fits_best(record: StepRecord, library: Library) -> F64 | None:
    """Return the pose (3,) of the best match of an update; None: nothing was compared, or all is alike."""
    comparison = record.sighting.comparison
    if not _is_ranked(comparison, library) or float(np.ptp(comparison.quality)) == 0:
        return None
    return np.asarray(library.poses[int(comparison.quality.argmax())])


def _is_ranked(comparison: Comparison, library: Library) -> bool:
    return bool(comparison.channels) and len(comparison.log_likelihood) == library.size > 0


def rank_of(log_likelihood: F32, entry: int) -> int:
    """Return the rank of a reference among all (L,): 1 where none is likelier; equals share it."""
    return 1 + int(np.count_nonzero(log_likelihood > log_likelihood[entry]))


def reference_near(library: Library, nearest: NearestReference, pose: F64, reach_m: float) -> int:
    """Return the entry whose picture shows best what is seen at a pose (3,); -1 where none does.

    It is the one that a particle there is compared with, if that lies within reach and faces a like way; else
    the nearest in place and heading that does, and that no wall hides.
    """
    away = np.hypot(*(library.poses[:, :2] - pose[:2]).T)
    turned = np.abs(wrap_angle(library.poses[:, 2] - pose[2]))
    shows = (away <= reach_m) & (turned <= LOST_RAD)
    relative = (pose - np.append(library.origin, 0)).astype(np.float32)
    entry = int(nearest.entries(relative[None], library.origin)[0])
    if entry >= 0 and shows[entry]:
        return entry
    near = np.flatnonzero(shows)
    near = near[np.argsort(away[near] / reach_m + turned[near] / LOST_RAD, kind="stable")]
    start = np.broadcast_to(pose[:2], (len(near), 2))
    seen = near[~crosses(start, library.poses[near, :2], library.arena.walls)]
    return int(seen[0]) if len(seen) else -1
