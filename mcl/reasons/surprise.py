"""How far a true movement is from what a motion model makes of odometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..filter.motion import MotionModel
from ..values import F32, F64, INCH_M, wrap

DRAWS, KEPT = 200, 32  # particles that stand for the model; movements with noise of their own
TOGETHER = (0.1, 0.1, float(np.radians(2)))  # m, m, rad: standard deviations of a cloud that found itself
TRUTH_M, TRUTH_RAD = INCH_M, float(np.radians(2))  # accuracy of a true pose


@dataclass(frozen=True, slots=True)
class Surprise:
    """A true movement beside the model's, in the frame of the movement's end, in standard deviations."""

    forward: float
    left: float
    turn: float
    growth: float = 0.0  # nats by which the movement widens a cloud that had found itself

    @property
    def largest(self) -> float:
        """The largest of the three, without its sign."""
        return max(abs(self.forward), abs(self.left), abs(self.turn))

    @property
    def axis(self) -> str:
        """Which of the three that is."""
        return max(("forward", "left", "turn"), key=lambda name: abs(getattr(self, name)))


@lru_cache(1)
def _noise() -> F32:
    """Standard normals (KEPT, DRAWS, 3): the same for every movement, so that nothing depends on chance."""
    return np.random.default_rng(1).standard_normal((KEPT, DRAWS, 3)).astype(np.float32)


def surprise(model: MotionModel, origin: F64, before: F64, after: F64, motions: F64) -> Surprise:
    """Compare the true movement between two poses (3,) with what a model makes of motions (M, 3)."""
    start = before - np.append(origin, 0.0)
    poses: F32 = np.tile(start.astype(np.float32), (DRAWS, 1))
    for number, motion in enumerate(motions):
        poses = model.move(poses, origin, motion, _noise()[number % KEPT])
    ends = poses.astype(np.float64)
    mean = ends.mean(axis=0)
    heading = float(np.arctan2(np.sin(ends[:, 2]).mean(), np.cos(ends[:, 2]).mean()))
    spread = ends - mean
    spread[:, 2] = wrap(ends[:, 2] - heading)
    off = after - np.append(origin, 0.0) - mean
    off[2:] = wrap(after[2:] - heading)
    c, s = np.cos(heading), np.sin(heading)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    sd = np.sqrt((spread @ turned.T).var(axis=0) + np.square([TRUTH_M, TRUTH_M, TRUTH_RAD]))
    forward, left, turn = (turned @ off / sd).tolist()
    growth = float(np.log1p(spread.var(axis=0) / np.square(TOGETHER)).sum() / 2)
    return Surprise(forward, left, turn, growth)
