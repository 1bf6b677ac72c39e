"""Poses of a running robot: from each topic's messages, with a short history of each topic."""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from maurice_mcl.values import F64

from ..bags.messages import IN_XY, MESSAGE_ERRORS, pose_of, stamp_ns
from ..bags.readers import PoseSource
from ..errors import FieldError
from ..files.text import MOST_T_S, show, up_to
from ..reading.recording import TruthPose, interpolated

MOST_KEPT = 2000  # poses in the history of one topic


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose and the stamp of its message."""

    stamp_ns: int | None
    pose: F64  # (3,)


def stamped_poses(source: PoseSource, message: Any, topic: str) -> Iterator[StampedPose]:
    """Yield the pose of a message, if any. FieldError."""
    try:
        for stamp, pose in source.poses(message, topic):
            flat = IN_XY.pose(pose) if isinstance(pose, np.ndarray) else pose_of(pose)
            yield StampedPose(in_range(stamp), flat)
    except MESSAGE_ERRORS as problem:
        raise FieldError(f"found no pose in a message ({short(problem)})") from None


class PoseHistory:
    """The latest poses of one topic, by their times."""

    def __init__(self) -> None:
        self.first: F64 | None = None
        self._poses: deque[tuple[float, int, F64]] = deque()
        self._number = 0

    @property
    def last_s(self) -> float:
        """The latest time of a pose."""
        return self._poses[-1][0] if self._poses else float("-inf")

    def add(self, t_s: float, pose: F64) -> None:
        """Add a pose, also one that comes slightly late."""
        self._number += 1
        self.first = pose if self.first is None else self.first
        if t_s >= self.last_s:
            self._poses.append((t_s, self._number, pose))
        else:
            insort(self._poses, (t_s, self._number, pose))
        if len(self._poses) > MOST_KEPT:
            self._poses.popleft()

    def at(self, t_s: float, max_dt_s: float) -> F64 | None:
        """Return the pose (3,) at a time, interpolated; only one within `max_dt_s` is taken as it is."""
        before = next((stamped for stamped in reversed(self._poses) if stamped[0] <= t_s), None)
        after = (
            next((stamped for stamped in self._poses if stamped[0] >= t_s), None)
            if self.last_s >= t_s
            else None
        )
        if before is not None and before is after:
            return before[2]
        near = [
            stamped
            for stamped in (before, after)
            if stamped is not None and abs(stamped[0] - t_s) <= max_dt_s
        ]
        if len(near) == 2:
            return interpolated(TruthPose(near[0][0], near[0][2]), TruthPose(near[1][0], near[1][2]), t_s)
        return near[0][2] if near else None


def time_of(message: Any) -> int | None:
    """Return the stamp of a message in ns. Raises `MESSAGE_ERRORS` for an invalid one."""
    return in_range(stamp_ns(message))


def in_range(stamp: int | None) -> int | None:
    """Return a time in ns unchanged. FieldError for one out of range."""
    if stamp is not None and abs(stamp) > MOST_T_S * 10**9:
        raise FieldError(f"found the time {show(stamp)} ns, expected {up_to(MOST_T_S)} in seconds")
    return stamp


def short(problem: Exception) -> str:
    """Return what is wrong in one short line."""
    return " ".join(str(problem).split())[:200] or type(problem).__name__
