"""What makes the moments of a drive: its pictures, or where there are none the scans of its laser."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from maurice_mcl.values import F64, SKIPPED, compose, motion_between

from ..errors import ReadingNotes
from .options import Reading
from .recording import Picture, Recording, Scan, checked
from .time_alignment import ROUNDING_S, Aligned


@dataclass(frozen=True, slots=True)
class Gate:
    """How far a robot goes before a picture or scan is used. Nothing asked for: every one is."""

    min_distance_m: float = 0.0  # as the crow flies since the last observation that was used
    min_angle_rad: float = 0.0  # turned since the last observation that was used

    def open_after(self, motion: F64) -> bool:
        """Return whether a motion (3,) since the last update, composed of all in between, makes one."""
        limits = (self.min_distance_m > 0, self.min_angle_rad > 0)
        far = limits[0] and math.hypot(motion[0], motion[1]) >= self.min_distance_m
        return not any(limits) or bool(far or (limits[1] and abs(motion[2]) >= self.min_angle_rad))


SCAN_GATE = Gate(0.25, 0.2)  # AMCL's update_min_d and update_min_a


def gate_of(options: Reading, *, scans: bool) -> Gate:
    """Return the gate that the options ask for; else the usual one of pictures, or of scans."""
    limits = options.min_distance_m, options.min_angle_rad
    if limits == (None, None):
        return SCAN_GATE if scans else Gate()
    return Gate(limits[0] or 0.0, limits[1] or 0.0)


SKIPPED_AT = re.compile(rf"{SKIPPED}: what came at (\S+) s")


def skipped_at(t_s: float) -> str:
    """Return the event by which a capture tells that the live run left out what came at a time."""
    return f"{SKIPPED}: what came at {t_s!r} s"


def with_skipped(events: Sequence[str], count: int, name: str) -> tuple[str, ...]:
    """Return the events of a moment with that of the observations left out right before it, if any."""
    some = name if count > 1 else name.removesuffix("s")
    return (*events, *([f"{SKIPPED}: {count} {some}: the filter was too slow"] if count else []))


SCANS = "scans"
LOOK_ON_S = 1.0  # after the first picture a laser has spoken as well


@dataclass(frozen=True, slots=True)
class Observed:
    """What a robot saw with; a laser that begins late beside a camera is not seen here."""

    pictures: bool
    scans: bool

    @property
    def name(self) -> str:
        """What makes the moments, in one word."""
        return SCANS if self.scans and not self.pictures else "pictures"


def observed_in(recording: Recording) -> Observed:
    """Tell what a recording observed, from as little of it as tells it; broken parts are passed over."""
    scans, until_s = False, np.inf
    for record in checked(recording, ReadingNotes(keep_going=True)):
        scans = scans or isinstance(record, Scan)
        if record.t_s > until_s or (scans and getattr(recording, "pictureless", False)):
            break
        if isinstance(record, Picture):
            until_s = min(until_s, -np.inf if scans else record.t_s + LOOK_ON_S)
    return Observed(until_s < np.inf, scans)


@dataclass(slots=True, eq=False)
class _Seen:
    """An observation, and where it was made."""

    aligned: Aligned
    place: F64 | None  # (3,) by the odometry

    @property
    def t_s(self) -> float:
        return self.aligned.picture.t_s


class Observations:
    """Turns aligned pictures and scans into those that make moments.

    Pictures do, each with the scan nearest in time; while none has come, every scan does. Motions, events and
    readings before a scan that makes none go to the next picture.
    """

    def __init__(self, max_dt_s: float, *, pictures: bool, wait: bool, poses: bool) -> None:
        """`pictures`: only they make moments; `wait`: each for the scan after it, which may be nearer.

        `poses`: odometry comes as poses, and a scan without any near cannot be moved to a picture.
        """
        self.pictures = pictures
        self._near_s, self._max_dt_s = max_dt_s + ROUNDING_S, max_dt_s
        self._wait, self._poses = wait, poses
        self._way: F64 = np.zeros(3)  # the motions composed
        self._before: _Seen | None = None  # the last scan
        self._waiting = deque[_Seen]()  # pictures

    def __call__(self, stream: Iterable[Aligned], most: int | None = None) -> Iterator[Aligned]:
        """Yield the observations that make moments, in order, with at most so many motions and events."""
        leftover: Aligned | None = None  # the last scan that makes none, with all before it
        for aligned in stream:
            self._way = reduce(compose, aligned.motions, self._way)
            seen = _Seen(aligned, aligned.odometry_at(self._max_dt_s) if self._poses else self._way)
            self.pictures |= aligned.scan is None
            if not self.pictures:
                yield aligned
                continue
            if leftover is not None:
                aligned.follow(leftover, most)
            yield from self._settled(seen)
            if aligned.scan is not None:
                leftover, self._before = aligned, seen
                continue
            leftover = None
            if self._wait:
                self._waiting.append(seen)
            else:
                yield self._with_scan(seen)
        yield from map(self._with_scan, self._waiting)

    def _settled(self, now: _Seen) -> Iterator[Aligned]:
        """Yield the pictures that wait for nothing nearer than what comes now."""
        after = None if now.aligned.scan is None else now
        while self._waiting and (after or now.t_s > self._waiting[0].t_s + self._near_s):
            yield self._with_scan(self._waiting.popleft(), after)

    def _with_scan(self, picture: _Seen, after: _Seen | None = None) -> Aligned:
        """Give a picture the nearest scan, as if it was taken at the picture's pose."""
        aligned, scans = picture.aligned, [scan for scan in (self._before, after) if scan is not None]
        nearest = min(scans, key=lambda scan: abs(scan.t_s - picture.t_s), default=picture)
        scan, apart_s = nearest.aligned.scan, abs(nearest.t_s - picture.t_s)
        if (
            scan is not None
            and apart_s <= self._near_s
            and not (nearest.place is None or picture.place is None)
        ):
            between = motion_between(picture.place, nearest.place)
            aligned.scan = replace(scan, mount=compose(between, scan.mount)) if between.any() else scan
        return aligned
