"""Clocks: units of time stamps, offsets between clocks, pictures paired with odometry and truth."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import reduce

import numpy as np

from maurice_mcl.values import F64, LaserScan, compose_motions, is_kidnapping, motion_between

from ..files.text import MOST_T_S
from .recording import (
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Scan,
    TruthPose,
    gray_picture,
    interpolated,
)

# Units of time stamps, and clocks that disagree.

PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
UNIX_S = (6.3e8, MOST_T_S)  # 1990 to 2096: what a time since 1970 looks like
SLOWEST_S = 5.0  # a longer time from sample to sample means that the unit is a smaller one


class TimeSpan:
    """First and last time of something, and how often it came."""

    def __init__(self) -> None:
        self.count = 0
        self.first_s = 0.0
        self.last_s = 0.0

    def add(self, t_s: float) -> None:
        """Take in one time."""
        self.first_s = t_s if self.count == 0 else min(self.first_s, t_s)
        self.last_s = t_s if self.count == 0 else max(self.last_s, t_s)
        self.count += 1

    def overlaps(self, other: TimeSpan, slack_s: float = 0.0) -> bool:
        """Return whether two spans have a time in common, or nearly so."""
        return self.first_s <= other.last_s + slack_s and other.first_s <= self.last_s + slack_s


def detect_unit(stamps: Sequence[str]) -> str:
    """Return the unit of a column of time stamps: "s", "ms", "us" or "ns".

    By size where they count from 1970, else by the median step (at most 5 s); a decimal point means seconds.
    """
    values = np.array([float(stamp) for stamp in stamps])
    middle = float(np.median(np.abs(values)))
    for unit, per_s in PER_SECOND.items():
        if UNIX_S[0] <= middle / per_s <= UNIX_S[1]:
            return unit
    if middle <= MOST_T_S and any("." in stamp for stamp in stamps):
        return "s"
    steps = np.abs(np.diff(values))
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    small = [unit for unit, per_s in PER_SECOND.items() if step / per_s <= SLOWEST_S]
    fitting = [unit for unit in small if middle / PER_SECOND[unit] <= MOST_T_S]
    return fitting[0] if fitting else "ns"


def unit_in(name: str) -> str | None:
    """Return the unit that the name of a column holds, as in "timestamp [ns]"."""
    unit = name.partition("[")[2].rstrip("] ")
    return unit if unit in PER_SECOND else None


def seconds(stamp: str, unit: str) -> float:
    """Return a stamp in seconds; integers of nanoseconds keep all the digits that a float can hold."""
    per_s = PER_SECOND[unit]
    try:
        return int(stamp) / per_s
    except ValueError:
        return float(stamp) / per_s


def clock_s(text: str) -> float:
    """Return Unix seconds of a date and time of day, UTC unless it says otherwise. ValueError for others."""
    if ":" not in text:
        raise ValueError(f"found {text!r:.60}, expected a date and a time of day")
    whole, dot, rest = text.strip().partition(".")
    digits = len(rest) - len(rest.lstrip("0123456789"))
    moment = datetime.fromisoformat(whole + rest[digits:])
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return moment.timestamp() + (float(f"0.{rest[:digits]}") if dot and digits else 0.0)


def apart(name: str, span: TimeSpan, other_name: str, other: TimeSpan) -> str:
    """Return where two clocks stand, and what would bring the second's beginning to the first's."""
    spans = f"{name} go from {span.first_s:.3f} to {span.last_s:.3f} s"
    others = f"{other_name} from {other.first_s:.3f} to {other.last_s:.3f} s"
    return f"{spans}, {others}; their beginnings are {span.first_s - other.first_s:.3f} s apart"


# How far two clocks are apart, by the movement that was recorded with both.

PERIOD_S = 0.1  # both are looked at so often
WINDOW_S = 0.5  # over which speed and turn rate are taken, so that a tracker's jitter does not count
LONGEST_S = 20_000.0  # of a drive
FEWEST = 50  # moments, five seconds
LEAST_OVERLAP = 0.6  # of the shorter one
LEAST_WAY_M, LEAST_TURN_RAD = 0.5, 0.5  # what moves less tells nothing
ONE_MOVEMENT = 0.7  # correlation from which on they are taken for one movement
OTHER_OFFSET_SHARE = 0.9  # of it, that any other offset may reach
SAME_OFFSET_S = 3.0  # offsets so near are the same


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """What has to be added to one clock's times."""

    offset_s: float
    correlation: float  # of the movements then, up to 1


def offset_between(t_s: F64, poses: F64, other_t_s: F64, other: F64) -> ClockOffset | None:
    """Find what the other clock's times need, so that its poses (m, 3) move when the poses (n, 3) do.

    Only speed and turn rate count. None where either hardly moves, or no offset is clearly the best.
    """
    if not (_moves(poses) and _moves(other)):
        return None
    ours, theirs = _rates(t_s, poses), _rates(other_t_s, other)
    if min(len(ours), len(theirs)) < FEWEST:
        return None
    scale = np.maximum(np.sqrt(np.mean(ours**2, axis=0)), 1e-9)
    alike = _correlations(ours / scale, theirs / scale)
    best = int(np.argmax(alike))
    lags = np.arange(len(alike)) - (len(theirs) - 1)
    others = alike[np.abs(lags - lags[best]) * PERIOD_S > SAME_OFFSET_S]
    if alike[best] < ONE_MOVEMENT or (len(others) and others.max() > OTHER_OFFSET_SHARE * alike[best]):
        return None
    return ClockOffset(float(t_s[0] - other_t_s[0] + lags[best] * PERIOD_S), float(alike[best]))


def _moves(poses: F64) -> bool:
    if len(poses) < 2:
        return False
    span = np.ptp(poses[:, :2], axis=0).max()
    return bool(span > LEAST_WAY_M or np.ptp(np.unwrap(poses[:, 2])) > LEAST_TURN_RAD)


def _rates(t_s: F64, poses: F64) -> F64:
    if not PERIOD_S < t_s[-1] - t_s[0] < LONGEST_S:
        return np.zeros((0, 2))
    at = np.arange(t_s[0], t_s[-1], PERIOD_S)
    columns = (poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2]))
    before, after = (
        np.stack([np.interp(at + w, t_s, c) for c in columns]) for w in (-WINDOW_S / 2, WINDOW_S / 2)
    )
    step = (after - before) / WINDOW_S
    speed = np.hypot(step[0], step[1])
    return np.column_stack([speed - speed.mean(), step[2]])


def _correlations(ours: F64, theirs: F64) -> F64:
    """Return how alike two courses (k, 2), (m, 2) are for every shift of the second; 0 where few meet."""
    from scipy.signal import correlate  # slow to import, and every command would wait for it

    both = sum(correlate(ours[:, c], theirs[:, c]) for c in (0, 1))
    ones = np.ones(len(ours)), np.ones(len(theirs))
    ours_power = correlate((ours**2).sum(axis=1), ones[1])
    theirs_power = correlate(ones[0], (theirs**2).sum(axis=1))
    meeting = correlate(*ones)
    power = np.sqrt(np.maximum(ours_power * theirs_power, 1e-12))
    enough = meeting >= LEAST_OVERLAP * min(len(ours), len(theirs))
    # a stretch in which hardly anything moves is like any other
    lively = np.minimum(ours_power, theirs_power) > 0.05 * meeting
    return np.where(enough & lively, both / power, 0.0)


# Observations, which are pictures and scans, each with the odometry and the truth at its time.

MAX_GAP_S = 1.0  # poses further apart say nothing about the time between them
MOST_WAITING = 64  # observations held back while poses after them are awaited; a second of a fast camera
TRUTH_AGAIN_S = 10.0  # after the last true pose, in which another one is awaited
ROUNDING_S = 1e-6  # decimal seconds are not exact, and Unix time has a quarter of a microsecond


@dataclass(slots=True)
class Neighbors:
    """The poses before and after an observation."""

    before: OdometryPose | TruthPose | None = None
    after: OdometryPose | TruthPose | None = None
    settled: bool = False  # nothing that comes can tell more


@dataclass(slots=True, eq=False)
class Aligned:
    """An observation and what belongs to its time."""

    picture: Picture  # a gray one where a scan was taken and no picture
    motions: list[F64]  # measured as such since the observation before, in order
    events: list[str]  # since the observation before
    readings: dict[str, float]  # the newest of each name since the observation before
    odometry: Neighbors
    truth: Neighbors
    scan: LaserScan | None = None
    skipped: int = 0  # observations right before, which a live run left out

    def follow(self, earlier: Aligned, most: int | None) -> None:
        """Take over what came before an earlier one that is not used; of too much as the aligner does."""
        self.motions = joined([*earlier.motions, *self.motions], most)
        self.events = [*earlier.events, *self.events][:most]
        self.readings = earlier.readings | self.readings
        self.skipped += earlier.skipped

    def odometry_at(self, max_dt_s: float) -> F64 | None:
        """Return the odometry's pose (3,): between two at most a second apart, or one within `max_dt_s`."""
        t_s, before, after = self.picture.t_s, self.odometry.before, self.odometry.after
        if before is not None and after is not None and after.t_s - before.t_s <= MAX_GAP_S + ROUNDING_S:
            return interpolated(before, after, t_s)
        nearest = min(
            (pose for pose in (before, after) if pose), key=lambda pose: abs(pose.t_s - t_s), default=None
        )
        is_near = nearest is not None and abs(nearest.t_s - t_s) <= max_dt_s + ROUNDING_S
        return nearest.pose if nearest is not None and is_near else None

    def truth_at(self) -> F64 | None:
        """Return the true pose (3,): exact, or between two at most a second apart."""
        t_s, before, after = self.picture.t_s, self.truth.before, self.truth.after
        for known in (before, after):
            if known is not None and known.t_s == t_s:
                return known.pose
        if before is None or after is None or after.t_s - before.t_s > MAX_GAP_S + ROUNDING_S:
            return None
        return interpolated(before, after, t_s)


def joined(motions: list[F64], most: int | None) -> list[F64]:
    """Compose neighbors of too many motions (3,); their composition stays. None: none are too many."""
    while most is not None and len(motions) > most:
        pairs = zip(motions[::2], motions[1::2], strict=False)
        odd = motions[-1:] if len(motions) % 2 else []
        motions = [compose_motions(first, second) for first, second in pairs] + odd
    return motions


class Aligner:
    """Goes through records and gives the pictures and scans, each with the poses around it."""

    def __init__(
        self, max_dt_s: float | None = None, most: int | None = None, *, prompt: bool = False
    ) -> None:
        """Poses of the odometry are awaited for `max_dt_s`; None: there are none.

        Between two observations only `most` events are kept, and twice as many motions; None: all. With
        `prompt` truth is awaited only by the first observation, and where some came in the last 10 s or with
        the observation before.
        """
        self.first_odometry: F64 | None = None  # the first pose (3,) of the odometry, once it was seen
        self._max_dt_s, self._most, self._prompt = max_dt_s, most, prompt
        self._waiting: deque[Aligned] = deque()
        self._odometry: OdometryPose | None = None
        self._truth: TruthPose | None = None
        self._truth_s = -np.inf  # time of the last one
        self._known_s = -np.inf  # time of the last observation that is known whole
        self._motions: list[F64] = []
        self._events: list[str] = []
        self._readings: dict[str, float] = {}

    def __call__(self, records: Iterable[Record | None]) -> Iterator[Aligned]:
        """Yield every observation in order, as soon as all is known of it; at None those that still wait."""
        for record in records:
            if record is None:
                yield from self._waiting
                self._waiting.clear()
                continue
            yield from self._outdated(record.t_s)
            if isinstance(record, Picture | Scan):
                yield from self._observe(record)
            else:
                self._take(record)
            yield from self._outdated(record.t_s)
        yield from self._waiting

    def _outdated(self, now_s: float) -> Iterator[Aligned]:
        while self._waiting and self._ready(self._waiting[0], now_s):
            self._known_s = self._waiting[0].picture.t_s
            yield self._waiting.popleft()

    def _ready(self, aligned: Aligned, now_s: float) -> bool:
        t_s, truth = aligned.picture.t_s, aligned.truth.before
        odometry = aligned.odometry.before
        until_s = t_s + (self._max_dt_s or 0.0) + ROUNDING_S
        until_s = until_s if odometry is None else max(until_s, odometry.t_s + MAX_GAP_S + ROUNDING_S)
        truth_until_s = t_s if truth is None else max(t_s, truth.t_s + MAX_GAP_S + ROUNDING_S)
        known = aligned.odometry.settled or now_s > until_s
        since_s = min(self._known_s - MAX_GAP_S, t_s - TRUTH_AGAIN_S)
        no_truth = self._prompt and self._truth_s < since_s
        return known and (aligned.truth.settled or no_truth or now_s > truth_until_s)

    def _observe(self, record: Picture | Scan) -> Iterator[Aligned]:
        odometry, truth = _known(self._odometry, record.t_s), _known(self._truth, record.t_s)
        odometry.settled |= self._max_dt_s is None
        picture, scan = (record, None) if isinstance(record, Picture) else (None, record.scan)
        since = self._motions, self._events, self._readings
        self._waiting.append(Aligned(picture or gray_picture(record.t_s), *since, odometry, truth, scan))
        self._motions, self._events, self._readings = [], [], {}
        if len(self._waiting) > MOST_WAITING:
            yield self._waiting.popleft()

    def _take(self, record: Record) -> None:
        if isinstance(record, Motion):
            self._motions.append(record.motion)
            if self._most is not None and len(self._motions) > 2 * self._most:
                self._motions = joined(self._motions, self._most)
        elif isinstance(record, OdometryPose):
            self._odometry = record
            self.first_odometry = record.pose if self.first_odometry is None else self.first_odometry
            for aligned in self._waiting:
                _settle(aligned.odometry, record)
        elif isinstance(record, TruthPose):
            self._truth, self._truth_s = record, record.t_s
            for aligned in self._waiting:
                _settle(aligned.truth, record)
        elif isinstance(record, Readings):
            self._readings |= record.values
        elif isinstance(record, Note):
            self._take_note(record)

    def _take_note(self, note: Note) -> None:
        """Keep an event; truth is not joined across a kidnapping."""
        self._events.append(note.text)
        if self._most is not None:
            del self._events[: -self._most]
        if is_kidnapping(note.text):
            self._truth = None
            for aligned in self._waiting:
                aligned.truth.settled = True


def _known(before: OdometryPose | TruthPose | None, t_s: float) -> Neighbors:
    return Neighbors(before, settled=before is not None and before.t_s == t_s)


def _settle(known: Neighbors, after: OdometryPose | TruthPose) -> None:
    if not known.settled:
        known.after, known.settled = after, True


class Steps:
    """The motions from one used observation to the next, by poses and by motions; nothing is lost between."""

    def __init__(self) -> None:
        self.way: F64 = np.zeros(3)  # (3,) the motions composed, since the last picture used
        self._last: F64 | None = None
        self._pending: list[F64] = []
        self._pending_way: F64 = np.zeros(3)

    def add(self, motions: list[F64], pose: F64 | None, first: F64 | None) -> list[F64]:
        """Add what came up to a picture; return all motions (3,) since the last used, or since `first`."""
        self._pending += motions
        self.way = self._pending_way = reduce(compose_motions, motions, self._pending_way)
        self._last = first if self._last is None else self._last
        if pose is None or self._last is None or np.array_equal(pose, self._last):
            return list(self._pending)
        motion = motion_between(self._last, pose)
        self.way = compose_motions(self._pending_way, motion)
        return [*self._pending, motion]

    def used(self, pose: F64 | None) -> None:
        """Begin anew after a picture that was used."""
        self._pending, self._pending_way = [], np.zeros(3)
        self._last = self._last if pose is None else pose


def as_rows(motions: list[F64]) -> F64:
    """Put motions into rows, (M, 3)."""
    return np.array(motions, np.float64).reshape(-1, 3)
