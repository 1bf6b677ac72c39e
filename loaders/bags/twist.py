"""Odometry whose poses never move while its speeds do: the speeds are added up."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from maurice_mcl.values import F64, compose, rotated

from ..errors import InputError
from ..reading.recording import OdometryPose
from .messages import MESSAGE_ERRORS, ODOMETRIES, known_type, matrix_in, speeds_of
from .readers import OneTopic, Timed
from .source import Message, OpenBag

LEAST_SPEED = 0.02  # m/s or rad/s, of a robot that moves


@dataclass(slots=True)
class SpeedSum:
    """The pose (3,) that speeds add up to; between two messages, the mean of both speeds counts."""

    pose: F64 = field(default_factory=lambda: np.zeros(3))
    _last: tuple[float, F64] | None = None  # time and speeds (3,) of the last message

    def add(self, t_s: float, speeds: F64) -> F64:
        """Return the pose (3,) at the next message."""
        if self._last is not None and t_s > self._last[0]:
            moved = (speeds + self._last[1]) / 2 * (t_s - self._last[0])
            moved[:2] = rotated(float(moved[0]), float(moved[1]), float(moved[2]) / 2)  # the chord of an arc
            self.pose = compose(self.pose, moved)
        self._last = t_s, speeds
        return self.pose


@dataclass(frozen=True, slots=True)
class TwistReader(OneTopic):
    """Converts the speeds of a topic of odometry to poses."""

    types: ClassVar[Collection[str]] = ODOMETRIES
    offset_s: float  # added to the times
    _sum: SpeedSum = field(default_factory=SpeedSum, compare=False)

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the pose at one message."""
        yield OdometryPose(t_s + self.offset_s, self._sum.add(t_s, speeds_of(content)))


def speed_of_still_poses(open_bag: OpenBag, path: Path, topic: str) -> float:
    """Return the highest speed in m/s or rad/s of odometry whose poses never move; 0 if they move.

    Reading stops at the first pose that differs.
    """
    first, fastest = None, 0.0
    with open_bag(path) as bag:
        kinds = [known_type(entry.type) for entry in bag.topics if entry.name == topic]
        if not kinds or not ODOMETRIES.issuperset(kinds):
            return 0.0
        for message in bag.messages({topic}):
            with suppress(InputError, *MESSAGE_ERRORS):  # reported when it is read
                content = message.decode()
                pose, speeds = matrix_in(content), speeds_of(content)
                first = pose if first is None else first
                if not np.array_equal(pose, first):
                    return 0.0
                fastest = max(fastest, float(np.hypot(*speeds[:2])), abs(float(speeds[2])))
    return fastest if fastest >= LEAST_SPEED else 0.0
