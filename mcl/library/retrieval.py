"""Pictures of a drive looked up in a library: which reference is found first, by channel and by all together.

This is how place recognition is measured in the field (Lowry et al. 2016; Zaffar et al. 2021): recall of the
right reference among the first 1, 5 and 10, and precision over recall as ever less similar matches are
accepted. References are right within the radius *right* and 30 degrees of the true pose; the nearest is, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..sensor.ahead import KnownDescriptors, measured
from ..sensor.model import SensorModel
from ..values import F64, I32, I64, Bool, Frame, Progress, wrap_angle
from .drive_score import DrivePicture

RIGHT_RAD = float(np.radians(30))  # as of an estimate that is correct
MOST_RADII = 2.0  # away, up to which the nearest reference is right: beyond, an estimate is lost
STRETCH = 5.0  # radii of way, which 45 degrees of turn are one of: what is farther apart is independent
TOGETHER = "together"  # by all channels in use


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """How one way to compare ranks references for Q pictures that have a right one."""

    rank: I32  # (Q,) of the first right reference, from 1
    distance: F64  # (Q,) to the first reference of all: the smaller, the surer

    def among(self, first: int) -> Bool:
        """Return for each picture (Q,) whether a right reference is among its `first` matches."""
        return np.asarray(self.rank <= first)

    def curve(self) -> tuple[F64, F64]:
        """Return recall and precision (Q,) as matches are accepted, the most similar first.

        Recall is the share of all pictures whose match is accepted and right: it ends at the recall at 1.
        """
        right = self.among(1)[np.argsort(self.distance, kind="stable")].cumsum()
        return right / max(len(right), 1), right / np.arange(1, len(right) + 1)

    def __getitem__(self, some: Bool) -> Ranking:
        return Ranking(self.rank[some], self.distance[some])


def area_of(ranking: Ranking) -> float:
    """Return the area under a ranking's precision over recall: the mean precision at right matches."""
    _, precision = ranking.curve()
    right = ranking.among(1)[np.argsort(ranking.distance, kind="stable")]
    return float((precision * right).sum() / len(right)) if len(right) else float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class Retrieval:
    """What a library's references are to the pictures of a drive."""

    alone: Mapping[str, Ranking]  # each channel that the library holds
    together: Ranking  # all that are in use
    without: Mapping[str, Ranking]  # all but one that is in use, where there are several
    stretch: I64  # (Q,) number of the stretch of the drive that each picture is of
    pictures: int  # that were looked up
    right_m: float  # the radius within which a reference is right


def look_up(
    sensor: SensorModel,
    pictures: Sequence[DrivePicture],
    right_m: float,
    known: KnownDescriptors | None = None,
    progress: Progress | None = None,
) -> Retrieval:
    """Look up a drive's pictures, in order, in a sensor's library, by its channels and all others it holds.

    Pictures that cannot be read, and those without any right reference, have no rank.
    """
    parameters, library = sensor.parameters, sensor.library
    weights = dict.fromkeys(library.index, 0.0) | sensor.weights
    every = replace(sensor, index={}, parameters=replace(parameters, weights=weights))
    rows, distances = list[I32](), list[F64]()
    verifying = [name for name, each in sensor.sensors.items() if hasattr(each, "verify")]
    used = {**sensor.weights, **dict.fromkeys(verifying, 1.0)}
    mixes = _mixes(used, tuple(weights), verifying)
    ranked = list[int]()
    for number, picture in enumerate(pictures):
        right = right_references(library.poses, picture.truth, right_m)
        image = picture.read() if right.any() else None
        if image is not None:
            frame = Frame(number, 0.0, np.zeros((0, 3)), image, "")
            readings = {name: sensor.sensors[name].read(frame) for name in verifying}
            comparison = every.compare(measured(image, weights, known)[0], readings)
            verified = [part.weight * part.cost for part in comparison.verified]
            costs = mixes @ np.array([*comparison.channel_cost, *verified], np.float64)  # (ways, L)
            order = np.argsort(costs, axis=1, kind="stable")
            rows.append((right[order].argmax(axis=1) + 1).astype(np.int32))
            distances.append(costs.min(axis=1))
            ranked.append(number)
        if progress is not None:
            progress(number + 1, len(pictures))
    names = [*weights, TOGETHER, *(used if len(used) > 1 else ())]
    rank = np.array(rows, np.int32).reshape(-1, len(names))
    distance = np.array(distances, np.float64).reshape(-1, len(names))
    rankings = [Ranking(rank[:, k], distance[:, k]) for k in range(len(names))]
    first = len(weights)
    stretch = stretches_of(np.array([picture.truth for picture in pictures]).reshape(-1, 3), right_m)
    return Retrieval(
        dict(zip(weights, rankings[:first], strict=True)),
        rankings[first],
        dict(zip(names[first + 1 :], rankings[first + 1 :], strict=True)),
        stretch[ranked],
        len(pictures),
        right_m,
    )


def _mixes(used: Mapping[str, float], channels: Sequence[str], verifying: Sequence[str]) -> F64:
    """Return weights (ways, C): each channel alone, all that is in use together, and without each of it."""
    names = [*channels, *verifying]
    whole = np.array([used.get(name, 0.0) for name in names])
    without = [np.where(np.array(names) == name, 0.0, whole) for name in used if len(used) > 1]
    return np.array([*np.eye(len(channels), len(names)), whole, *without])


def right_references(poses: F64, truth: F64, right_m: float) -> Bool:
    """Return which references (L,) are right for a picture taken at a pose (3,): near ones, and the nearest.

    The nearest may be up to twice as far away as the others; where it is farther, none is right.
    """
    away_m = np.hypot(*(poses[:, :2] - truth[:2]).T)
    away_m[np.abs(wrap_angle(poses[:, 2] - truth[2])) > RIGHT_RAD] = np.inf
    nearest_m = away_m.min(initial=np.inf)
    within_m = max(right_m, nearest_m) if nearest_m <= MOST_RADII * right_m else -1.0
    return np.asarray(away_m <= within_m)


def stretches_of(poses: F64, right_m: float) -> I64:
    """Number the stretches (Q,) of a drive of true poses (Q, 3), each `STRETCH` radii long.

    A turn by 45 degrees counts as a radius.
    """
    steps = np.diff(poses, axis=0)
    way = np.hypot(steps[:, 0], steps[:, 1]) / right_m + np.abs(wrap_angle(steps[:, 2])) / np.radians(45)
    driven = np.concatenate([np.zeros(min(len(poses), 1)), way.cumsum()])
    return np.asarray(np.unique((driven / STRETCH).astype(np.int64), return_inverse=True)[1], np.int64)
