"""Messages of a running robot as lines of a session log: pictures, and the motion between them."""

from __future__ import annotations

import base64
import re
import time
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import motion_between

from ..bags.messages import (
    IN_XY,
    MESSAGE_ERRORS,
    TRANSFORMS,
    FrameTree,
    known_type,
    links_of,
    picture_of,
    pose_of,
    stamp_ns,
    use_recorded,
)
from ..bags.source import Message
from ..bags.topics import PoseTopic
from ..bags.video import VideoStream, codec_of
from ..errors import FieldError
from ..files.pictures import encode_jpeg
from ..files.text import MOST_T_S, show, up_to
from ..reading.recording import TruthPose, interpolated

# Poses of a running robot: from each topic's messages, with a short history of each topic.

MOST_KEPT = 2000  # poses in the history of one topic
MOST_FRAMES = 1000  # in a tree of transforms; robots have some tens


@dataclass(frozen=True, slots=True)
class StampedPose:
    """A pose and the stamp of its message."""

    stamp_ns: int | None
    pose: F64  # (3,)


class PoseExtractor:
    """Extracts poses from a topic of poses, or from two frames of the transforms."""

    def __init__(self, route: PoseTopic) -> None:
        self._route = route
        self._tree = FrameTree()

    def accepts(self, topic: str, kind: str) -> bool:
        """Return whether it reads a topic; it reads all transforms where it needs frames."""
        if self._route.frames is not None:
            return known_type(kind) in TRANSFORMS
        return topic == self._route.topic

    def poses(self, message: Any, *, static: bool) -> Iterator[StampedPose]:
        """Yield the pose of a message, if any; `static` transforms are no motion. FieldError."""
        try:
            if self._route.frames is None:
                yield StampedPose(time_of(message), pose_of(message))
                return
            news = self._tree.news(links_of(message), *self._route.frames)
            stamp = None if news is None else in_range(news[0])
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found no pose in a message ({short(problem)})") from None
        if len(self._tree) > MOST_FRAMES:
            self._tree = FrameTree()
        if news is not None and not static:
            yield StampedPose(stamp, IN_XY.pose(news[1]))


class PoseHistory:
    """The latest poses of one topic, by their times."""

    def __init__(self) -> None:
        self.first: F64 | None = None
        self._poses: deque[tuple[float, int, F64]] = deque()
        self._number = 0

    @property
    def last_s(self) -> float:
        """The latest time of a pose."""
        return self._poses[-1][0] if self._poses else float("-inf")

    def add(self, t_s: float, pose: F64) -> None:
        """Add a pose, also one that comes slightly late."""
        self._number += 1
        self.first = pose if self.first is None else self.first
        if t_s >= self.last_s:
            self._poses.append((t_s, self._number, pose))
        else:
            insort(self._poses, (t_s, self._number, pose))
        if len(self._poses) > MOST_KEPT:
            self._poses.popleft()

    def at(self, t_s: float, max_dt_s: float) -> F64 | None:
        """Return the pose (3,) at a time, interpolated; only one within `max_dt_s` is taken as it is."""
        before = next((stamped for stamped in reversed(self._poses) if stamped[0] <= t_s), None)
        after = (
            next((stamped for stamped in self._poses if stamped[0] >= t_s), None)
            if self.last_s >= t_s
            else None
        )
        if before is not None and before is after:
            return before[2]
        near = [
            stamped
            for stamped in (before, after)
            if stamped is not None and abs(stamped[0] - t_s) <= max_dt_s
        ]
        if len(near) == 2:
            return interpolated(TruthPose(near[0][0], near[0][2]), TruthPose(near[1][0], near[1][2]), t_s)
        return near[0][2] if near else None


def time_of(message: Any) -> int | None:
    """Return the stamp of a message in ns. Raises `MESSAGE_ERRORS` for an invalid one."""
    return in_range(stamp_ns(message))


def in_range(stamp: int | None) -> int | None:
    """Return a time in ns unchanged. FieldError for one out of range."""
    if stamp is not None and abs(stamp) > MOST_T_S * 10**9:
        raise FieldError(f"found the time {show(stamp)} ns, expected {up_to(MOST_T_S)} in seconds")
    return stamp


def short(problem: Exception) -> str:
    """Return what is wrong in one short line."""
    return " ".join(str(problem).split())[:200] or type(problem).__name__


MOST_PICTURES = 8  # that wait for the odometry after them ...
LONGEST_S = 1.0  # ... and for how long, by our own clock
MOST_UNDATED = 50  # messages held back until it is known whether stamps are usable
COMPRESSED = re.compile(r"jpe?g|png|webp", re.I)
IMAGE, ODOMETRY, TRUTH = "image", "odometry", "truth"


@dataclass(frozen=True, slots=True)
class ChosenTopics:
    """The topics to read: one of pictures, and the sources of poses."""

    image: str | None
    odometry: PoseTopic | None = None
    truth: PoseTopic | None = None
    transforms: tuple[str, ...] = ()  # topics of transforms, all of them, where frames are wanted

    @property
    def names(self) -> tuple[str, ...]:
        """All topics to subscribe to, without duplicates."""
        poses = [route.topic for route in self.routes.values()]
        return tuple(dict.fromkeys(name for name in (self.image, *poses, *self.transforms) if name))

    @property
    def routes(self) -> Mapping[str, PoseTopic]:
        """The sources of poses, by "odometry" and "truth"."""
        routes = {ODOMETRY: self.odometry, TRUTH: self.truth}
        return {role: route for role, route in routes.items() if route is not None}


@dataclass(frozen=True, slots=True)
class _Item:
    role: str
    stamp_ns: int | None
    log_ns: int
    content: Any  # a picture not encoded yet, or a pose (3,)


@dataclass(frozen=True, slots=True)
class _Unencoded:
    encoded: Callable[[], str]  # returns its file as base64. FieldError if it cannot be read
    note: str = ""  # a remark for the user


class Translator:
    """Turns messages into records of a session log, as objects to be written as lines."""

    def __init__(self, max_dt_s: float) -> None:
        self.problems: deque[FieldError] = deque(maxlen=100)  # pictures that were left out
        self._max_dt_s = max_dt_s
        self._tracks = {ODOMETRY: PoseHistory(), TRUTH: PoseHistory()}
        self._extractors: dict[PoseTopic, PoseExtractor] = {}
        self._undated: list[_Item] | None = []  # None once it is known whether stamps are usable
        self._recorded = False  # stamps are of no use: recording times count
        self._pictures: deque[tuple[float, float, _Unencoded]] = deque()  # time, our own clock's
        self._last_pose: F64 | None = None
        self._last_s = float("-inf")
        self._has_odometry = False
        self._video = VideoStream()

    def take(self, message: Message, topics: ChosenTopics) -> Iterator[dict[str, Any]]:
        """Yield the lines that a message completes. FieldError for an invalid message."""
        self._has_odometry = topics.odometry is not None
        for item in self._items(message, topics):
            if self._undated is None:
                yield from self._sort(item)
                continue
            self._undated.append(item)
            roles = {undated.role for undated in self._undated}
            if roles >= {IMAGE, *topics.routes} or self._many_undated():
                yield from self._settle_clock()

    def _items(self, message: Message, topics: ChosenTopics) -> Iterator[_Item]:
        extractors = {
            role: self._extractors.setdefault(route, PoseExtractor(route))
            for role, route in topics.routes.items()
        }
        hearing = {
            role: pose for role, pose in extractors.items() if pose.accepts(message.topic, message.type)
        }
        if message.topic != topics.image and not hearing:
            return
        content = decoded(message)
        if message.topic == topics.image:
            stamp = _stamp(content)
            picture = self._picture(content, (message.log_ns if stamp is None else stamp) / 1e9)
            if picture is not None:
                yield _Item(IMAGE, stamp, message.log_ns, picture)
        for role, extractor in hearing.items():
            for stamped in extractor.poses(content, static="static" in message.topic):
                yield _Item(role, stamped.stamp_ns, message.log_ns, stamped.pose)

    def _picture(self, message: Any, t_s: float) -> _Unencoded | None:
        if codec_of(message) is None:
            return _Unencoded(_encoded(message))
        try:
            part = self._video.add(message, t_s)
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found a picture that cannot be read ({short(problem)})") from None
        return None if part is None else _Unencoded(partial(_as_jpeg, part.read), part.note)

    def idle(self) -> Iterator[dict[str, Any]]:
        """Yield lines that have waited long enough; to be called when nothing arrives."""
        if self._undated:
            yield from self._settle_clock()
        yield from self._ready()

    def _many_undated(self) -> bool:
        undated = self._undated or []
        return len(undated) > MOST_UNDATED or sum(item.role == IMAGE for item in undated) > MOST_PICTURES

    def _settle_clock(self) -> Iterator[dict[str, Any]]:
        undated, self._undated = self._undated or [], None
        stamps: dict[str, list[tuple[int | None, int]]] = {}
        for item in undated:
            stamps.setdefault(item.role, []).append((item.stamp_ns, item.log_ns))
        if why := use_recorded(stamps):
            self._recorded = True
            t_s = undated[0].log_ns / 1e9
            yield {"t": t_s, "event": f"clock: the bridge's times are used, because {why}"}
        for item in undated:
            yield from self._sort(item)

    def _sort(self, item: _Item) -> Iterator[dict[str, Any]]:
        stamp = None if self._recorded else item.stamp_ns
        t_s = (item.log_ns if stamp is None else stamp) / 1e9
        if item.role == IMAGE:
            self._pictures.append((t_s, time.monotonic(), item.content))
        else:
            self._tracks[item.role].add(t_s, item.content)
        yield from self._ready()

    def _ready(self) -> Iterator[dict[str, Any]]:
        while self._pictures:
            t_s, since_s, picture = self._pictures[0]
            known = not self._has_odometry or self._tracks[ODOMETRY].last_s >= t_s
            waited = time.monotonic() - since_s > LONGEST_S or len(self._pictures) > MOST_PICTURES
            if not known and not waited:
                return
            self._pictures.popleft()
            try:
                yield from self._lines(t_s, picture)
            except FieldError as problem:  # before any of its lines
                self.problems.append(problem)

    def _lines(self, t_s: float, picture: _Unencoded) -> Iterator[dict[str, Any]]:
        if t_s < self._last_s:
            raise FieldError(f"found a picture at {t_s:.6f} s after one at {self._last_s:.6f} s")
        pose = self._tracks[ODOMETRY].at(t_s, self._max_dt_s)
        if pose is None and self._has_odometry:
            raise FieldError(
                f"found no odometry within {self._max_dt_s:g} s of a picture; see --reading max_dt_s"
            )
        image = {"base64": picture.encoded()}
        self._last_s = t_s
        if pose is not None:
            before = self._tracks[ODOMETRY].first if self._last_pose is None else self._last_pose
            self._last_pose = pose
            if before is not None and not np.array_equal(before, pose):
                yield {"t": t_s, "odometry": motion_between(before, pose).tolist()}
        truth = self._tracks[TRUTH].at(t_s, self._max_dt_s)
        if truth is not None:
            yield {"t": t_s, "truth": truth.tolist()}
        if picture.note:
            yield {"t": t_s, "event": picture.note}
        yield {"t": t_s, "image": image}


def decoded(message: Message) -> Any:
    """Decode a message. FieldError if that does not work."""
    try:
        return message.decode()
    except Exception as problem:  # decoders raise anything on what a broken peer sends
        text = f"found a message of {message.topic} that cannot be decoded ({short(problem)})"
        raise FieldError(text) from None


def _stamp(message: Any) -> int | None:
    try:
        return time_of(message)
    except MESSAGE_ERRORS as problem:
        raise FieldError(f"found a message with an invalid time ({short(problem)})") from None


def _encoded(message: Any) -> Callable[[], str]:
    form = str(getattr(message, "format", ""))
    if hasattr(message, "encoding") or not COMPRESSED.search(form) or "Depth" in form:
        return partial(_as_jpeg, partial(picture_of, message))
    return partial(_as_it_came, message)


def _as_it_came(message: Any) -> str:
    with _usable():
        data = message.data
        return data if isinstance(data, str) else base64.b64encode(bytes(data)).decode("ascii")


def _as_jpeg(read: Callable[[], U8]) -> str:
    with _usable():
        return base64.b64encode(encode_jpeg(read())).decode("ascii")


@contextmanager
def _usable() -> Iterator[None]:
    try:
        yield
    except MESSAGE_ERRORS as problem:
        raise FieldError(f"found a picture that cannot be read ({short(problem)})") from None
