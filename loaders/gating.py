"""Which pictures make an update: those after enough movement (AMCL's update_min_d and update_min_a)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from maurice_mcl.typing import F64

from .recording import moved


@dataclass(frozen=True, slots=True)
class Gate:
    """How far a robot goes before a picture is used. Nothing asked for: every picture is."""

    min_distance_m: float = 0.0  # as the crow flies since the last picture that was used
    min_angle_rad: float = 0.0  # turned since the last picture that was used

    def open_after(self, motions: Iterable[F64]) -> bool:
        """Tell whether so much movement makes an update: far enough, or turned enough, of what is asked."""
        asked = (self.min_distance_m > 0, self.min_angle_rad > 0)
        if not any(asked):
            return True
        pose, turned = np.zeros(3), 0.0
        for motion in motions:
            pose = moved(pose, motion)
            turned += float(motion[2])
        far = asked[0] and math.hypot(pose[0], pose[1]) >= self.min_distance_m
        return bool(far or (asked[1] and abs(turned) >= self.min_angle_rad))
