"""Where a drive really began, for starting the filter there."""

from __future__ import annotations

import numpy as np

from maurice_mcl.geometry import compose
from maurice_mcl.typing import F64

from .findings import Findings
from .recording import Motion, OdometryPose, Recording, TruthPose, checked, motion_between, short_way


def first_truth(recording: Recording) -> F64 | None:
    """Give the true pose (3,) at which the motions begin; None without truth.

    That is the first true pose. What odometry saw before it is undone, so that a filter which is moved by
    all of it comes to that pose in time.
    """
    moved, first = np.zeros(3), None
    for record in checked(recording, Findings(keep_going=True)):
        if isinstance(record, TruthPose):
            return before(record.pose, moved)
        if isinstance(record, Motion):
            moved = compose(moved, record.motion)
        elif isinstance(record, OdometryPose):
            first = record.pose if first is None else first
            moved = motion_between(first, record.pose)
    return None


def before(pose: F64, motion: F64) -> F64:
    """Give the pose (3,) from which a motion (3,) leads to a pose (3,)."""
    heading = float(pose[2] - motion[2])
    cos, sin = np.cos(heading), np.sin(heading)
    x = pose[0] - (motion[0] * cos - motion[1] * sin)
    y = pose[1] - (motion[0] * sin + motion[1] * cos)
    return np.array([x, y, short_way(heading)])
