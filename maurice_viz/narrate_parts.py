"""Parts of sentences about an update: how the robot moved, how the cloud looks, how wrong the estimate is."""

from __future__ import annotations

import numpy as np

from maurice_mcl.belief import Belief
from maurice_mcl.geometry import angle_between
from maurice_mcl.records import Estimate, StepRecord
from maurice_mcl.typing import F64

from .look import Scale

STILL_RAD = np.radians(0.5)  # a turn that would be written "0 deg" is not mentioned


def motion(motions: F64, scale: Scale) -> str:
    """Say what the robot measured: "drove 18.0 in forward and turned 45 deg left (2 movements)"."""
    forward, left, turn = motions.sum(axis=0) if len(motions) else np.zeros(3)
    parts = []
    if _shows(forward, scale):
        parts.append(f"drove {scale.say(abs(forward))} {'forward' if forward > 0 else 'backward'}")
    if _shows(left, scale):
        parts.append(f"slid {scale.say(abs(left))} to the {'left' if left > 0 else 'right'}")
    if abs(turn) > STILL_RAD:
        parts.append(f"turned {np.degrees(abs(turn)):.0f} deg {'left' if turn > 0 else 'right'}")
    count = f" ({len(motions)} movements)" if len(motions) > 1 else ""
    return (" and ".join(parts) or "stood still") + count


def _shows(length_m: float, scale: Scale) -> bool:
    """Tell whether a length would be written as more than 0."""
    return round(abs(scale.length(length_m)), scale.units.digits) > 0


def spread_m(belief: Belief) -> float:
    """Give the radial standard deviation of a whole cloud, by weight, in metres."""
    weights = belief.weights
    xy = belief.poses[:, :2].astype(np.float64)
    return float(np.sqrt(weights @ ((xy - weights @ xy) ** 2).sum(axis=1)))


def errors(estimate: Estimate, truth: F64) -> tuple[float, float]:
    """Give the distance in metres and the unsigned angle in radians between estimate and truth."""
    apart = float(np.hypot(*(estimate.pose[:2] - truth[:2])))
    return apart, angle_between(float(estimate.pose[2]), float(truth[2]))


def effective(record: StepRecord) -> str:
    """Say how many particles really count."""
    size = record.weighted.size
    share = record.effective_sample_size / size
    return f"Effective sample size {record.effective_sample_size:.0f} of {size} ({share:.0%})."


def estimated(record: StepRecord, truth: F64 | None, scale: Scale) -> str:
    """Say where the robot is thought to be, how surely, and how wrong that is."""
    estimate = record.estimate
    text = f"Estimate {scale.say_pose(estimate.pose)}; confidence {estimate.confidence:.0%}"
    if truth is None:
        return f"{text} (truth not known)."
    apart, angle = errors(estimate, truth)
    return f"{text}; **error {scale.say(apart)}, {np.degrees(angle):.0f} deg**."
