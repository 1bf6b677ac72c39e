"""The updates before: how the robot moved, and what speaks for the estimates. Pose sensors ask for them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from ..values import (
    F64,
    Belief,
    Comparison,
    Earlier,
    Frame,
    MeasuredMovement,
    Past,
    Sensed,
    compose_motions,
    motion_between,
    wrap_angle,
)

KEPT = 40  # updates
SAME_M, SAME_RAD = 0.3, 0.2  # between estimates and odometry: the estimates tell the movement better
JUMP_M = 2.0  # an estimate that moved so much more than the robot did is another one
# Nats that speak for an estimate: of a start that somebody gave; of each update, as a share of what its
# readings say, as most of that was said before; and at most. Chosen with those in `sensor.laser.history`.
START_NATS, START_M, SHARE, MOST_NATS = 60.0, 1.0, 0.15, 100.0


def earlier(name: str, motions: F64, link: float, past: Sequence[Past]) -> list[Earlier]:
    """Return what a sensor read before a frame with some movements (M, 3), the latest first."""
    after = ((motions, link), *((before.motions, before.link) for before in past))
    readings = ({part.name: part.reading for part in before.sensed}.get(name) for before in past)
    return [
        Earlier(*movement, reading, before.estimate, before.trust)
        for movement, reading, before in zip(after, readings, past, strict=False)
    ]


def unexplained(comparison: Comparison, predicted: Belief) -> list[Sensed]:
    """Return what sensors read that a predicted cloud does not explain for certain."""
    cloud = predicted.poses, predicted.weights, predicted.origin
    return [part for part in comparison.sensed if part.is_explained(*cloud) is not True]


def movement_of(sensed: Sequence[Sensed], frame: Frame, past: Sequence[Past]) -> MeasuredMovement | None:
    """Return how the robot moved by the first sensor that measures it."""
    if not past or not len(frame.motions):
        return None
    motion = reduce(compose_motions, frame.motions)
    movements = (part.movement(motion, earlier(part.name, frame.motions, 0.0, past)) for part in sensed)
    return next((movement for movement in movements if movement is not None), None)


def kept(
    frame: Frame,
    comparison: Comparison,
    predicted: Belief,
    movement: MeasuredMovement | None,
    estimate: F64,
    past: Sequence[Past],
) -> Past:
    """Return what is kept of an update: its movement as best known, and what speaks for the estimate."""
    motions, link = frame.motions, 0.0 if movement is None else movement.link
    trust = past[0].trust if past else START_NATS * _is_together(predicted)
    if past and len(motions):
        between = motion_between(past[0].estimate, estimate)
        motion = reduce(compose_motions, motions) if movement is None else movement.motion
        off_m, off_rad = float(np.hypot(*(between - motion)[:2])), abs(wrap_angle(between[2] - motion[2]))
        is_same = movement is None and off_m < SAME_M and off_rad < SAME_RAD
        motions = (between if is_same else motion)[None]
        if off_m > JUMP_M or not (movement is None or movement.is_linked):
            trust = 0.0
    support = sum(max(0.0, part.support(estimate)) for part in comparison.sensed)
    return Past(motions, comparison.sensed, estimate, link, min(MOST_NATS, trust + SHARE * support))


def _is_together(cloud: Belief) -> bool:
    """Return whether a cloud began where somebody put it."""
    off = cloud.poses[:, :2] - cloud.weights @ cloud.poses[:, :2]
    return bool(cloud.weights @ (off**2).sum(axis=1) < START_M**2)
