"""Where a running robot says that it is: what each topic's messages tell, and the poses told lately."""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from maurice_mcl.typing import F64

from .bag_frames import FrameTree
from .bag_messages import TRANSFORMS, known_type, links_of, planar, pose_of, stamp_ns
from .bag_topics import Route
from .fields import MOST_T_S, FieldError, show, up_to
from .recording import TruthPose, interpolated

MOST_KEPT = 2000  # poses of one topic that pictures are looked up in
MOST_FRAMES = 1000  # in a tree of transforms; robots have some tens

NO_POSE = (ArithmeticError, AttributeError, TypeError, ValueError)  # raised by messages that are none


@dataclass(frozen=True, slots=True)
class Told:
    """A pose, and when the message says that it was measured."""

    stamp_ns: int | None
    pose: F64  # (3,)


class Teller:
    """Reads the poses that a topic tells, or two frames of the transforms."""

    def __init__(self, route: Route) -> None:
        self._route = route
        self._tree = FrameTree()

    def hears(self, topic: str, kind: str) -> bool:
        """Tell whether it is concerned with a topic; of transforms it needs all."""
        if self._route.frames is not None:
            return known_type(kind) in TRANSFORMS
        return topic == self._route.topic

    def tell(self, message: Any, *, static: bool) -> Iterator[Told]:
        """Give the pose that a message tells, if it tells one. FieldError for a message without sense.

        What a topic of `static` transforms says is no movement, and its time is none of a movement.
        """
        try:
            if self._route.frames is None:
                yield Told(time_of(message), pose_of(message))
                return
            news = self._tree.news(links_of(message), *self._route.frames)
            stamp = None if news is None else in_range(news[0])
        except NO_POSE as problem:
            raise FieldError(f"found no pose in a message ({short(problem)})") from None
        if len(self._tree) > MOST_FRAMES:
            self._tree = FrameTree()
        if news is not None and not static:
            yield Told(stamp, planar(news[1]))


class Track:
    """The poses that one topic has told lately, by their times."""

    def __init__(self) -> None:
        self.first: F64 | None = None
        self._poses: deque[tuple[float, int, F64]] = deque()
        self._number = 0

    @property
    def last_s(self) -> float:
        """The latest time of a pose."""
        return self._poses[-1][0] if self._poses else float("-inf")

    def add(self, t_s: float, pose: F64) -> None:
        """Take in a pose, also one that comes a little late."""
        self._number += 1
        self.first = pose if self.first is None else self.first
        if t_s >= self.last_s:
            self._poses.append((t_s, self._number, pose))
        else:
            insort(self._poses, (t_s, self._number, pose))
        if len(self._poses) > MOST_KEPT:
            self._poses.popleft()

    def at(self, t_s: float, max_dt_s: float) -> F64 | None:
        """Give the pose (3,) at a time: between two that near, or the only one that is."""
        before = next((one for one in reversed(self._poses) if one[0] <= t_s), None)
        after = next((one for one in self._poses if one[0] >= t_s), None) if self.last_s >= t_s else None
        if before is not None and before is after:
            return before[2]
        near = [one for one in (before, after) if one is not None and abs(one[0] - t_s) <= max_dt_s]
        if len(near) == 2:
            return interpolated(TruthPose(near[0][0], near[0][2]), TruthPose(near[1][0], near[1][2]), t_s)
        return near[0][2] if near else None


def time_of(message: Any) -> int | None:
    """Give the time in ns that a message says it was measured at. ValueError, or one of `NO_POSE`."""
    return in_range(stamp_ns(message))


def in_range(stamp: int | None) -> int | None:
    """Give a time in ns back. FieldError for one that is no time of a session."""
    if stamp is not None and abs(stamp) > MOST_T_S * 10**9:
        raise FieldError(f"found the time {show(stamp)} ns, expected {up_to(MOST_T_S)} in seconds")
    return stamp


def short(problem: Exception) -> str:
    """Say what is wrong in a short line."""
    return " ".join(str(problem).split())[:200] or type(problem).__name__
