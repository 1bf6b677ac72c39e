"""Pairing pictures with odometry and truth by time, looking ahead no further than that needs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose_motions, motion_between

from ..recording import Motion, Note, OdometryPose, Picture, Record, TruthPose, interpolated
from ..session_log.records import MAX_GAP_S

MOST_WAITING = 64  # pictures held back while poses after them are awaited; a second of a fast camera
ROUNDING_S = 1e-6  # decimal seconds are not exact, and Unix time has a quarter of a microsecond


@dataclass(slots=True)
class _Known:
    """What is known about the pose at a picture's time."""

    before: OdometryPose | TruthPose | None
    after: OdometryPose | TruthPose | None = None
    settled: bool = False  # nothing that comes can tell more


@dataclass(slots=True, eq=False)
class Aligned:
    """A picture and what belongs to its time."""

    picture: Picture
    motions: list[F64]  # measured as such since the picture before, in order
    events: list[str]  # since the picture before
    odometry: _Known
    truth: _Known

    def odometry_at(self, max_dt_s: float) -> F64 | None:
        """Return the odometry's pose (3,): between the poses before and after, or the only one so near."""
        t_s, near = self.picture.t_s, max_dt_s + ROUNDING_S
        before, after = self.odometry.before, self.odometry.after
        before = before if before is not None and t_s - before.t_s <= near else None
        after = after if after is not None and after.t_s - t_s <= near else None
        if before is not None and after is not None:
            return interpolated(before, after, t_s)
        one = before or after
        return None if one is None else one.pose

    def truth_at(self) -> F64 | None:
        """Return the true pose (3,): exact, or between two at most a second apart."""
        t_s, before, after = self.picture.t_s, self.truth.before, self.truth.after
        for known in (before, after):
            if known is not None and known.t_s == t_s:
                return known.pose
        if before is None or after is None or after.t_s - before.t_s > MAX_GAP_S + ROUNDING_S:
            return None
        return interpolated(before, after, t_s)


class Aligner:
    """Goes through records and gives the pictures, each with the poses around it."""

    def __init__(self, max_dt_s: float) -> None:
        self.first_odometry: F64 | None = None  # the first pose (3,) of the odometry, once it was seen
        self._max_dt_s = max_dt_s
        self._waiting: deque[Aligned] = deque()
        self._odometry: OdometryPose | None = None
        self._truth: TruthPose | None = None
        self._motions: list[F64] = []
        self._events: list[str] = []

    def __call__(self, records: Iterable[Record]) -> Iterator[Aligned]:
        """Yield every picture in order, as soon as all is known about it."""
        for record in records:
            yield from self._outdated(record.t_s)
            if isinstance(record, Picture):
                yield from self._take_picture(record)
            else:
                self._take(record)
        yield from self._waiting

    def _outdated(self, now_s: float) -> Iterator[Aligned]:
        """Yield the pictures that nothing from this time on can tell more about."""
        while self._waiting and self._ready(self._waiting[0], now_s):
            yield self._waiting.popleft()

    def _ready(self, one: Aligned, now_s: float) -> bool:
        t_s, truth = one.picture.t_s, one.truth.before
        known = one.odometry.settled or now_s > t_s + self._max_dt_s + ROUNDING_S
        truth_until_s = t_s if truth is None else max(t_s, truth.t_s + MAX_GAP_S + ROUNDING_S)
        return known and (one.truth.settled or now_s > truth_until_s)

    def _take_picture(self, picture: Picture) -> Iterator[Aligned]:
        odometry, truth = _known(self._odometry, picture.t_s), _known(self._truth, picture.t_s)
        self._waiting.append(Aligned(picture, self._motions, self._events, odometry, truth))
        self._motions, self._events = [], []
        if len(self._waiting) > MOST_WAITING:
            yield self._waiting.popleft()

    def _take(self, record: OdometryPose | Motion | TruthPose | Note) -> None:
        if isinstance(record, Motion):
            self._motions.append(record.motion)
        elif isinstance(record, OdometryPose):
            self._odometry = record
            self.first_odometry = record.pose if self.first_odometry is None else self.first_odometry
            for one in self._waiting:
                _settle(one.odometry, record)
        elif isinstance(record, TruthPose):
            self._truth = record
            for one in self._waiting:
                _settle(one.truth, record)
        else:
            self._take_note(record)

    def _take_note(self, note: Note) -> None:
        """Keep an event; truth is not joined across a kidnapping."""
        self._events.append(note.text)
        if note.text.startswith("kidnapped"):
            self._truth = None
            for one in self._waiting:
                one.truth.settled = True


def _known(before: OdometryPose | TruthPose | None, t_s: float) -> _Known:
    return _Known(before, settled=before is not None and before.t_s == t_s)


def _settle(known: _Known, after: OdometryPose | TruthPose) -> None:
    if not known.settled:
        known.after, known.settled = after, True


class Steps:
    """The motions from one used picture to the next, from poses and from motions; nothing is lost between."""

    def __init__(self) -> None:
        self.way: F64 = np.zeros(3)  # (3,) the motions composed, since the last picture used
        self._last: F64 | None = None
        self._pending: list[F64] = []
        self._pending_way: F64 = np.zeros(3)

    def add(self, motions: list[F64], pose: F64 | None, first: F64 | None) -> list[F64]:
        """Take in what came up to a picture; return all motions (3,) since the last picture used.

        The motion from the `first` odometry pose to the first picture counts as well.
        """
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
