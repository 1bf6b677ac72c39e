"""Pictures against a library: where the camera looks, and when.

With truth, the log-likelihood of each picture at its true pose is compared with that at other headings, and
at earlier or later poses. Without it, a short localization is run under each reading, with the same random
numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import F64, I32, Bool
from ..filter.localizer import Localizer
from ..filter.proposal import uniform_belief
from ..filter.resampling import systematic
from ..geometry import compose, wrap_angle
from ..randomness import Domain, Purpose, normals, stream
from ..records import Belief, Comparison, normalize, uniform_log_weights
from ..sensor.left_out import places_of
from .findings import (
    Evidence,
    Finding,
    RecordedDrive,
    RecordedOdometry,
    RecordedTruth,
    direction_finding,
    frame_finding,
    gain_finding,
    picture_delay_finding,
    rotated,
    scale_finding,
    turn_finding,
)
from .odometry import Reading, direction_of, motions_read
from .plausibility import same_moments

YAWS: F64 = np.arange(-36.0, 36.0) * (np.pi / 36)  # directions to try
DELAYS = 41
COARSE: F64 = np.arange(2.5, 15.1, 0.5)  # further delays, in seconds, of truth that comes often
DENSE_S = 0.5  # spacing of truth below which delays shorter than an update are detectable
MAX_GAP_S = 1.0  # longest gap across which truth is interpolated
FEWEST_PICTURES = 8
FEWEST_PLACES = 8  # pictures of one place err together: fewer places tell nothing about the camera
PLACE_M, OF_MAP = 0.25, 0.05  # pictures nearer than the smaller of this, and of its share, are at one place
LEAST_NATS, LEAST_SIGMAS = 0.3, 2.5  # mean gain per picture for a finding, and its significance
LEAST_YAW_RAD = float(np.radians(20))
MOST_NATS = 3.0  # limit on one picture's gain when computing the significance
STANDS_S = 3.5  # duration of a stop, during which pictures are the same
FLAT = 0.15  # share of the gain that counts as equally high


@dataclass(frozen=True, slots=True, eq=False)
class ComparedPictures:
    """Some pictures of a drive, in order, compared with the library."""

    t_s: F64  # (n,)
    comparisons: Sequence[Comparison]
    localizer: Localizer

    def at(self, poses: F64) -> F64:
        """Return the log-likelihood (n, k) of each picture at k poses of its own, (n, k, 3); nan outside."""
        origin = self.localizer.library.origin
        local = (poses - np.append(origin, 0)).astype(np.float32)
        local[..., 2] = wrap_angle(poses[..., 2])
        pairs = zip(self.comparisons, local, strict=True)
        found = np.array([self.localizer.sensor.at(c, p).log_likelihood for c, p in pairs], np.float64)
        return np.where(np.isfinite(found), found, np.nan)


@dataclass(frozen=True, slots=True)
class Gained:
    """The gain of a hypothesis that differs from the log."""

    value: float  # radians or seconds
    nats: float  # mean gain in log-likelihood per picture
    sigmas: float  # of that mean, by the scatter over places
    pictures: int


def best_yaw(looks: ComparedPictures, track: RecordedTruth) -> Gained | None:
    """Return the camera's direction, counter-clockwise from forward; None if there is too little truth."""
    poses = truth_at(track, looks.t_s)[:, None].repeat(len(YAWS), axis=1)
    poses[..., 2] += YAWS
    return _best(looks.at(poses), YAWS, places_seen(looks, track), circular=True)


def best_delay(looks: ComparedPictures, track: RecordedTruth) -> Gained | None:
    """Return by how many seconds the pictures' time stamps are late (below zero: early)."""
    delays = delays_tried(track)
    poses = np.stack([truth_at(track, looks.t_s - delay) for delay in delays], axis=1)
    return _best(looks.at(poses), delays, places_seen(looks, track), circular=False)


def places_seen(looks: ComparedPictures, track: RecordedTruth) -> I32:
    """Return the number (n,) of the distinct place at which each picture was taken."""
    size_m = min(PLACE_M, OF_MAP * max(looks.localizer.library.arena.size_m))
    return places_of(truth_at(track, looks.t_s)[:, :2], size_m)[1]


def delays_tried(track: RecordedTruth) -> F64:
    """Return the delays to try: to 2 s, and coarsely to 15 s; or 2.5 updates of sparse truth."""
    steps = np.diff(track.t_s)
    spacing = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    if spacing >= DENSE_S:
        return np.linspace(-2.5 * spacing, 2.5 * spacing, DELAYS)
    return np.concatenate([-COARSE[::-1], np.linspace(-2.0, 2.0, DELAYS), COARSE])


def truth_at(track: RecordedTruth, t_s: F64) -> F64:
    """Return the true pose (n, 3) at times (n,): interpolated across a second at most, else the nearest."""
    after = np.clip(np.searchsorted(track.t_s, t_s), 1, track.size - 1)
    before = after - 1
    gap = track.t_s[after] - track.t_s[before]
    share = np.clip((t_s - track.t_s[before]) / np.where(gap > 0, gap, 1), 0, 1)
    share = np.where((gap <= MAX_GAP_S) & (track.part[after] == track.part[before]), share, share.round())
    step = track.poses[after] - track.poses[before]
    step[:, 2] = wrap_angle(step[:, 2])
    return np.asarray(track.poses[before] + step * share[:, None])


def _best(found: F64, values: F64, place_of: I32, *, circular: bool) -> Gained | None:
    """Return the value of highest mean: the middle of its neighbors that are nearly as high."""
    usual = found[:, np.abs(values).argmin()]
    counted = np.isfinite(usual)
    groups = np.unique(place_of[counted], return_inverse=True)[1]
    if counted.sum() < FEWEST_PICTURES or groups.max() + 1 < FEWEST_PLACES:
        return None
    floor = float(np.nanmin(found))  # outside free space counts as the worst place inside
    gains = np.where(np.isfinite(found), found, floor)[counted] - usual[counted, None]
    mean = gains.mean(axis=0)
    top = int(mean.argmax())
    if circular:
        middle, values = len(values) // 2, np.roll(values, len(values) // 2 - top)
        turned = np.roll(mean, middle - top)
        around = values[middle] + wrap_angle(values - values[middle])
        value = float(wrap_angle(np.array(around[_run(turned, middle)].mean())))
    else:
        high = values[_run(mean, top)]
        value = float(high[0] + high[-1]) / 2
    bounded = np.clip(gains[:, top], -MOST_NATS, MOST_NATS)
    by_place = np.bincount(groups, bounded - bounded.mean())  # pictures of one place err together
    scatter = max(
        float(np.sqrt((by_place**2).sum() * len(by_place) / (len(by_place) - 1))) / len(gains), 1e-9
    )
    return Gained(value, float(mean[top]), float(bounded.mean()) / scatter, len(gains))


def _run(mean: F64, top: int) -> Bool:
    """Mark the contiguous values around the top that are nearly as high."""
    high = mean >= mean[top] - FLAT * max(float(mean[top]), 0.0)
    gaps = np.flatnonzero(~high)
    low, end = gaps[gaps < top].max(initial=-1), gaps[gaps > top].min(initial=len(mean))
    marks = np.zeros(len(mean), bool)
    marks[low + 1 : end] = True
    return marks


def seen_with_truth(looks: ComparedPictures, track: RecordedTruth) -> list[Finding]:
    """Return a finding if the camera's direction or the time stamps are wrong: the one that explains more."""
    yaw, delay = best_yaw(looks, track), best_delay(looks, track)
    elsewhere = yaw is not None and _sure(yaw) and abs(yaw.value) >= LEAST_YAW_RAD
    late = delay is not None and _sure(delay)
    exact = same_moments(looks.t_s, track.t_s)
    if elsewhere and yaw is not None and not (late and delay is not None and delay.nats > yaw.nats):
        return [_yaw(yaw)]
    if late and delay is not None:
        near = exact is not None and abs(exact - delay.value) <= STANDS_S
        late_s = exact if near and exact else round(delay.value, 2)
        return [picture_delay_finding(late_s, _explained(delay))]
    return []


def _sure(gained: Gained) -> bool:
    return gained.nats >= LEAST_NATS and gained.sigmas >= LEAST_SIGMAS


def _yaw(yaw: Gained) -> Finding:
    degrees = round(float(np.degrees(yaw.value)) / 5) * 5
    options = {"camera_yaw_rad": float(np.radians(degrees))}
    return Finding("camera-yaw", (_explained(yaw),), {"yaw_deg": degrees}, options)


def _explained(found: Gained) -> Evidence:
    return Evidence("explained", {"pictures": found.pictures, "nats": found.nats, "sigmas": found.sigmas})


PARTICLES = 1500
MOST_MOTIONS = 4  # between two pictures; more are combined, since noise is added to each
FRESH = 150  # particles drawn anywhere, to recover from a kidnapping or slip
LEAST_GAIN = 0.15  # per picture: required gain of another hypothesis; healthy drives: below 0
FEWEST_TRIED = 12
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
    if len(looks.t_s) < FEWEST_TRIED:
        return []
    usual, *others = hypotheses(drive.odometry)
    foreseen = evidence(looks, drive, usual, start)
    found = [(evidence(looks, drive, one, start), one) for one in others]
    best, better = max(found, key=lambda one: one[0])
    if best < foreseen + LEAST_GAIN:
        return []
    values = {"pictures": len(looks.t_s), "gained": best - foreseen, "as_it_stands": foreseen}
    spacing_s = float(np.median(np.diff(looks.t_s)))
    return [finding_of(better, drive, spacing_s, Evidence("foreseen", values))]


def finding_of(hypothesis: Hypothesis, drive: RecordedDrive, spacing_s: float, seen: Evidence) -> Finding:
    """Return the finding of a hypothesis; `spacing_s` is the time between two pictures."""
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
    times = [hypothesis.scale, hypothesis.scale, hypothesis.gain]
    motions = np.column_stack([ahead, aside, motions[:, 2]]) * times
    ends = np.searchsorted(drive.odometry.t_s, picture_t_s, side="right")
    for number in range(len(ends)):
        now = number - hypothesis.late
        first = 0 if number == 0 else _end(ends, now - 1)
        yield _few(motions[first : _end(ends, now)])


def _end(ends: object, number: int) -> int:
    """Return the record after the last one before a picture; 0 before the first picture."""
    known = np.asarray(ends)
    return 0 if number < 0 else int(known[min(number, len(known) - 1)])


def _few(motions: F64) -> F64:
    if len(motions) <= MOST_MOTIONS:
        return motions
    pose = np.zeros(3)
    for motion in motions:
        pose = compose(pose, motion)
    return np.array([[pose[0], pose[1], motions[:, 2].sum()]])
