"""What a localizer's messages in a bag become: its particles, and its pose with a covariance."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from maurice_mcl.typing import F64

from .bag_messages import CLOUDS, UNSURE_POSE, cloud_of, pose_of
from .bag_parts import OneTopic, Timed, time_s
from .bag_source import Message


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """The particles of a recorded localizer at one time."""

    t_s: float
    poses: F64  # (N, 3) x_m, y_m, heading_rad in the map's frame
    weights: F64 | None  # (N,) as recorded; None: the message has none


@dataclass(frozen=True, slots=True)
class Clouds(OneTopic):
    """Makes clouds of a topic's messages."""

    types: ClassVar[Collection[str]] = CLOUDS

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the cloud of one message."""
        del number
        if self.hears(message):
            found = message.decode()
            yield Cloud(time_s(found, message.log_ns, recorded=recorded), *cloud_of(found))


@dataclass(frozen=True, slots=True, eq=False)
class BelievedPose:
    """Where a recorded localizer thought that the robot was."""

    t_s: float
    pose: F64  # (3,)
    sd: F64  # (3,) standard deviations of x_m, y_m and heading_rad, by its own covariance


@dataclass(frozen=True, slots=True)
class BelievedPoses(OneTopic):
    """Makes a localizer's poses of a topic of PoseWithCovarianceStamped."""

    types: ClassVar[Collection[str]] = (UNSURE_POSE,)

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the pose of one message."""
        del number
        if self.hears(message):
            found = message.decode()
            variances = np.asarray(found.pose.covariance, np.float64)[[0, 7, 35]]
            sd = np.sqrt(np.where(variances > 0, variances, 0))
            yield BelievedPose(time_s(found, message.log_ns, recorded=recorded), pose_of(found), sd)
