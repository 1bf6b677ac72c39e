"""Without truth: a short localization under each reading of the odometry, with the same random numbers.

The reading whose cloud predicts the pictures best, by log evidence, is accepted if the margin is large.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import F64
from ..filter.proposal import uniform_belief
from ..filter.resampling import systematic
from ..geometry import compose
from ..randomness import Domain, Purpose, normals, stream
from ..records import Belief, normalize, uniform_log_weights
from .findings import (
    Evidence,
    Finding,
    RecordedDrive,
    RecordedOdometry,
    direction_finding,
    frame_finding,
    gain_finding,
    picture_delay_finding,
    rotated,
    scale_finding,
    turn_finding,
)
from .odometry import Reading, direction_of, motions_read
from .pictures import ComparedPictures

PARTICLES = 1500
MOST_MOTIONS = 4  # between two pictures; more are combined, since noise is added to each
FRESH = 150  # particles drawn anywhere, to recover from a kidnapping or slip
LEAST_NATS = 0.15  # per picture: required gain of another hypothesis; healthy drives: below 0
FEWEST_PICTURES = 12
OUTSIDE = 2.0  # nats below the worst place on the map, for particles outside


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One thing that may be wrong with the odometry, or nothing."""

    code: str
    reading: Reading = field(default_factory=Reading)
    offset_rad: float = 0.0  # true direction minus what odometry calls forward
    scale: float = 1.0  # true over measured distance
    gain: float = 1.0  # true over measured turn, beyond the motion model's correction
    late: int = 0  # delay of the pictures, in pictures


def hypotheses(odometry: RecordedOdometry) -> list[Hypothesis]:
    """Return the hypotheses to try; the first one is that nothing is wrong."""
    turns = [Hypothesis(f"turn-{t.replace(' ', '-')}", Reading(t)) for t in ("clockwise", "degrees")]
    turns.append(Hypothesis("turn-clockwise-degrees", Reading("clockwise degrees")))
    frames: list[Hypothesis] = []
    if not odometry.poses:
        steps = Reading("", "world")
        begin_rad = direction_of(odometry, steps)  # the heading that steps are counted from
        frames = [Hypothesis("frame-world", steps, -begin_rad)]
        frames.append(Hypothesis("frame-absolute", Reading("", "absolute")))
    offsets = [Hypothesis("direction", offset_rad=k * np.pi / 4) for k in (1, 2, 3, 4, -3, -2, -1)]
    scales = [Hypothesis("scale", scale=s) for s in (0.001, 0.01, 0.0254, 0.3048)]
    late = [Hypothesis("pictures-late", late=k) for k in (-2, -1, 1, 2)]
    gains = [Hypothesis("turn-gain", gain=gain) for gain in (0.5, 0.73, 1.37, 2.0)]
    return [Hypothesis(""), *turns, *frames, *offsets, *scales, *gains, *late]


def doubted_by_pictures(looks: ComparedPictures, drive: RecordedDrive, start: F64 | None) -> list[Finding]:
    """Return the finding of the hypothesis that predicts the pictures far better; none without one."""
    if len(looks.t_s) < FEWEST_PICTURES:
        return []
    usual, *others = hypotheses(drive.odometry)
    foreseen = evidence(looks, drive, usual, start)
    found = [(evidence(looks, drive, one, start), one) for one in others]
    best, better = max(found, key=lambda one: one[0])
    if best < foreseen + LEAST_NATS:
        return []
    seen = Evidence(
        "foreseen", {"pictures": len(looks.t_s), "gained": best - foreseen, "as_it_stands": foreseen}
    )
    return [finding_of(better, drive, float(np.median(np.diff(looks.t_s))), seen)]


def finding_of(hypothesis: Hypothesis, drive: RecordedDrive, spacing_s: float, seen: Evidence) -> Finding:
    """Return the finding that a hypothesis stands for; `spacing_s` is the time between two pictures."""
    if hypothesis.gain != 1:
        return gain_finding(hypothesis.gain * drive.turn_gain, drive.turn_gain, seen)
    if hypothesis.reading.turn:
        return turn_finding(hypothesis.reading.turn, seen)
    if hypothesis.reading.frame:
        return frame_finding(hypothesis.reading.frame, seen, offset_rad=hypothesis.offset_rad)
    if hypothesis.offset_rad:
        return direction_finding(hypothesis.offset_rad, seen, or_camera=True)
    if hypothesis.late:
        return picture_delay_finding(hypothesis.late * spacing_s, seen, or_odometry=True)
    return scale_finding(hypothesis.scale, seen)


def evidence(
    looks: ComparedPictures, drive: RecordedDrive, hypothesis: Hypothesis, start: F64 | None, seed: int = 0
) -> float:
    """Return the mean of log p(picture | those before), in nats, of a short localization."""
    localizer, total = replace(looks.localizer, particles=PARTICLES, seed=seed), 0.0
    belief, model = localizer.initialize(start).belief, localizer.motion
    if model is None:
        raise ValueError("found no motion model, expected a localizer of the session")
    rng = stream(Domain.FILTER, seed, 0, Purpose.INJECT)
    fresh = uniform_belief(localizer.reference.grid, FRESH, belief.origin, rng).poses
    for number, motions in enumerate(motions_to(looks.t_s, drive, hypothesis)):
        poses, comparison = belief.poses, looks.comparisons[number]
        rng = stream(Domain.FILTER, seed, number, Purpose.MOTION)
        for motion in motions:
            poses = model.move(poses, belief.origin, motion, normals(rng, belief.size))
        found = localizer.sensor.at(comparison, poses).log_likelihood
        likelihood = np.maximum(found, float(comparison.log_likelihood.min()) - OUTSIDE)
        log_weights, foreseen = normalize(belief.log_weights + likelihood)
        total += foreseen
        rng = stream(Domain.FILTER, seed, number, Purpose.RESAMPLE)
        parents = systematic(np.exp(log_weights), belief.size - len(fresh), rng)
        kept = np.concatenate([poses[parents], fresh])
        belief = Belief(kept, uniform_log_weights(belief.size), belief.origin)
    return total / max(len(looks.t_s), 1)


def motions_to(picture_t_s: F64, drive: RecordedDrive, hypothesis: Hypothesis) -> Iterator[F64]:
    """Yield the motions (M, 3) from each picture to the next, under the hypothesis."""
    motions = motions_read(drive.odometry, hypothesis.reading)
    ahead, aside = rotated(motions[:, 0], motions[:, 1], hypothesis.offset_rad)
    motions = np.column_stack([ahead, aside, motions[:, 2]]) * [
        hypothesis.scale,
        hypothesis.scale,
        hypothesis.gain,
    ]
    ends = np.searchsorted(drive.odometry.t_s, picture_t_s, side="right")
    for number in range(len(ends)):
        now = number - hypothesis.late
        first = 0 if number == 0 else _end(ends, now - 1)
        yield _few(motions[first : _end(ends, now)])


def _end(ends: object, number: int) -> int:
    """Return the record after the last one before a picture; none before the first picture."""
    known = np.asarray(ends)
    return 0 if number < 0 else int(known[min(number, len(known) - 1)])


def _few(motions: F64) -> F64:
    """Combine many motions into one."""
    if len(motions) <= MOST_MOTIONS:
        return motions
    pose = np.zeros(3)
    for motion in motions:
        pose = compose(pose, motion)
    return np.array([[pose[0], pose[1], motions[:, 2].sum()]])
