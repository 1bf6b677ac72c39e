"""The whole ways of a drive, by odometry and as they really were, known before anything is drawn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from maurice_loaders.recording import motion_between, moved
from maurice_loaders.thinned_path import ThinnedPath
from maurice_mcl.arena import Arena
from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import F64

MOST = 4000  # points of a way that are kept; of a longer one every second, fourth, ... point
MARGIN = 0.08  # around the ways, as a share of the longer side
LEAST_M = 1.0  # free on each side of them


class Known(Protocol):
    """What is known of a moment without its picture."""

    @property
    def motions(self) -> F64:
        """Movements (M, 3) as measured."""
        ...

    @property
    def truth(self) -> F64 | None:
        """The true pose (3,)."""
        ...

    @property
    def events(self) -> tuple[str, ...]:
        """What the log says."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """What is known of a drive beforehand."""

    moments: int
    events: int
    moves: bool  # whether there is any odometry
    begins: F64 | None  # (3,) where the way by odometry begins on the map; None: neither truth nor odometry
    measured: F64  # (K, 2) in metres on the map, by odometry alone
    true: F64  # (T, 2)

    @property
    def points(self) -> F64:
        """All points of both ways (K + T, 2)."""
        return np.concatenate([self.measured, self.true])

    @property
    def arena(self) -> Arena | None:
        """A bare map around the ways; None where there are none."""
        points = self.points
        if not len(points):
            return None
        low, high = points.min(axis=0), points.max(axis=0)
        free = max(LEAST_M, MARGIN * float((high - low).max()))
        (x_min, y_min), (x_max, y_max) = (low - free).tolist(), (high + free).tolist()
        return Arena((x_min, y_min, x_max, y_max), np.zeros((0, 4)))


def ways_of(known: Iterable[Known], info: SessionInfo) -> Ways:
    """Go through a drive once. The way by odometry is laid so that it meets the truth where that begins."""
    own, measured, true = np.zeros(3), ThinnedPath(MOST), ThinnedPath(MOST)
    begins, count, events, moves = info.start, 0, 0, False
    for one in known:
        count, events, moves = count + 1, events + len(one.events), moves or len(one.motions) > 0
        for motion in one.motions:
            own = moved(own, motion)
        measured.add(own)
        if one.truth is not None:
            true.add(one.truth)
            begins = moved(one.truth, motion_between(own, np.zeros(3))) if begins is None else begins
    if not moves:
        return Ways(count, events, False, begins, np.zeros((0, 2)), _points(true))
    begins = np.zeros(3) if begins is None else begins
    return Ways(count, events, True, begins, _laid(_points(measured), begins), _points(true))


def _points(path: ThinnedPath) -> F64:
    return path.poses()[:, :2]


def _laid(points: F64, begins: F64) -> F64:
    """Turn and shift points (K, 2) from the odometry's own frame onto the map."""
    cos, sin = np.cos(begins[2]), np.sin(begins[2])
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + begins[:2])
