"""Odometry for drives that come without: made from the steps between known poses, plus stated noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.geometry import wrap
from maurice_mcl.randomness import Domain, stream
from maurice_mcl.typing import F64


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """How the odometry is spoiled, so that it is not the truth itself; a plain wheeled robot's numbers."""

    way_share: float = 0.05  # sd of a straight's length, as a share of it
    turn_share: float = 0.05  # sd of a turn, as a share of it
    drift_rad_per_m: float = 0.05  # sd of the heading gained on a straight, radians a metre

    def describe(self, seed: int) -> str:
        """Say it in a sentence, for the header's notes."""
        return (
            f"odometry is synthetic: made from the steps between labelled poses, with noise of "
            f"{self.way_share:g} of a way, {self.turn_share:g} of a turn and "
            f"{self.drift_rad_per_m:g} rad a metre of way (standard deviations), seed {seed}"
        )


def synthetic_motions(before: F64, after: F64, noise: OdometryNoise, seed: int, step: int) -> list[F64]:
    """Give the movements (3,) that a robot would have measured from one pose (3,) to the next.

    First the straight, in the frame of `before`, then the turn on the spot; what is zero is left out.
    The noise is drawn at the address of this step.
    """
    way_noise, drift_noise, turn_noise = stream(Domain.IMPORT, seed, step).standard_normal(3)
    dx, dy = after[:2] - before[:2]
    cos, sin = np.cos(before[2]), np.sin(before[2])
    way, turn = float(np.hypot(dx, dy)), float(wrap(after[2:] - before[2:])[0])
    motions = []
    if way > 0:
        measured = np.array([dx * cos + dy * sin, dy * cos - dx * sin]) * (1 + noise.way_share * way_noise)
        motions.append(np.array([*measured, noise.drift_rad_per_m * way * drift_noise]))
    if turn != 0:
        motions.append(np.array([0.0, 0.0, turn * (1 + noise.turn_share * turn_noise)]))
    return motions
