"""Pictures against a library: where the camera looks, and when.

The log-likelihood of each picture at its true pose is compared with that at other headings, and at earlier or
later poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library.left_out import places_of
from maurice_mcl.values import F64, I32, Bool, Comparison, Domain, stream, wrap_angle

from .findings import Evidence, Finding, RecordedTruth, picture_delay_finding
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
WIDEST_YAW_RAD = float(np.radians(40))  # from a value to an end of its interval: a wider one tells too little
REDRAWN = 400  # times that places are drawn anew for an interval
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
        values = np.array([self.localizer.sensor.at(c, p).log_likelihood for c, p in pairs], np.float64)
        return np.where(np.isfinite(values), values, np.nan)


@dataclass(frozen=True, slots=True)
class Gained:
    """The gain of a hypothesis that differs from the log."""

    value: float  # radians or seconds
    nats: float  # mean gain in log-likelihood per picture
    sigmas: float  # of that mean, by the scatter over places
    pictures: int
    low: float  # of the interval that holds the value 95 times in 100, by drawing places anew
    high: float


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


def _best(log_scores: F64, values: F64, place_of: I32, *, circular: bool) -> Gained | None:
    """Return the value of highest mean: the middle of its neighbors that are nearly as high."""
    if not len(log_scores):
        return None
    usual = log_scores[:, np.abs(values).argmin()]
    counted = np.isfinite(usual)
    groups = np.unique(place_of[counted], return_inverse=True)[1]
    if counted.sum() < FEWEST_PICTURES or groups.max() + 1 < FEWEST_PLACES:
        return None
    floor = float(np.nanmin(log_scores))  # outside free space counts as the worst place inside
    gains = np.where(np.isfinite(log_scores), log_scores, floor)[counted] - usual[counted, None]
    mean = gains.mean(axis=0)
    top = int(mean.argmax())
    value = _highest(mean, values, circular=circular)
    low, high = _interval(gains, groups.astype(np.int32), values, value, circular=circular)
    bounded = np.clip(gains[:, top], -MOST_NATS, MOST_NATS)
    by_place = np.bincount(groups, bounded - bounded.mean())  # pictures of one place err together
    scatter = max(
        float(np.sqrt((by_place**2).sum() * len(by_place) / (len(by_place) - 1))) / len(gains), 1e-9
    )
    return Gained(value, float(mean[top]), float(bounded.mean()) / scatter, len(gains), low, high)


def _highest(mean: F64, values: F64, *, circular: bool) -> float:
    """Return the value (k,) of highest mean (k,): the middle of its neighbors that are nearly as high."""
    top = int(mean.argmax())
    if not circular:
        high = values[_run(mean, top)]
        return float(high[0] + high[-1]) / 2
    middle, values = len(values) // 2, np.roll(values, len(values) // 2 - top)
    headings = values[middle] + wrap_angle(values - values[middle])
    return float(wrap_angle(np.array(headings[_run(np.roll(mean, middle - top), middle)].mean())))


def _interval(gains: F64, groups: I32, values: F64, value: float, *, circular: bool) -> tuple[float, float]:
    """Return the interval of the value of highest gain (n, k), by drawing the places (n,) anew."""
    count = int(groups.max()) + 1
    sums = np.zeros((count, gains.shape[1]))
    np.add.at(sums, groups, gains)
    drawn = stream(Domain.CALIBRATE, 0, count).integers(0, count, (REDRAWN, count))
    off = np.array([_highest(sums[some].sum(axis=0), values, circular=circular) - value for some in drawn])
    off = wrap_angle(off) if circular else off
    low, high = np.percentile(off, [2.5, 97.5])
    return value + min(float(low), 0.0), value + max(float(high), 0.0)


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
    elsewhere = yaw is not None and _sure(yaw) and _aside(yaw)
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


def _aside(yaw: Gained) -> bool:
    """Return whether a direction is clearly not forward, and known well enough to be of use."""
    known = max(yaw.high - yaw.value, yaw.value - yaw.low) <= WIDEST_YAW_RAD
    return known and abs(yaw.value) >= LEAST_YAW_RAD and not yaw.low <= 0 <= yaw.high


def _yaw(yaw: Gained) -> Finding:
    degrees = round(float(np.degrees(yaw.value)) / 5) * 5
    options = {"camera_yaw_rad": float(np.radians(degrees))}
    low, high = (float(np.degrees(end)) for end in (yaw.low, yaw.high))
    numbers = {"yaw_deg": degrees, "low_deg": min(low, degrees), "high_deg": max(high, degrees)}
    return Finding("camera-yaw", (_explained(yaw),), numbers, options)


def _explained(gained: Gained) -> Evidence:
    return Evidence("explained", {"pictures": gained.pictures, "nats": gained.nats, "sigmas": gained.sigmas})
