"""Messages of a running robot as lines of a session log: pictures, scans, and the motion between them."""

from __future__ import annotations

import base64
import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from maurice_mcl.values import F64, U8, motion_between

from ..bags.messages import (
    MESSAGE_ERRORS,
    SCANS,
    FrameTree,
    known_type,
    links_of,
    picture_of,
    use_recorded,
)
from ..bags.readers import MOST_FRAMES, PoseSource
from ..bags.scans import base_above, frame_of, placed, scan_of, sweep_s
from ..bags.source import Message
from ..bags.topics import PoseTopic
from ..bags.video import VideoStream, codec_of
from ..errors import FieldError
from ..files.pictures import encode_jpeg
from ..session_log.header import header_of
from ..session_log.records import scan_to_json
from .clocks import MessageClock
from .poses import PoseHistory, short, stamped_poses, time_of

MOST_PICTURES = 8  # that wait for the odometry after them ...
LONGEST_S = 1.0  # ... and for how long, by our own clock
MOST_UNDATED = 50  # messages held back until it is known whether stamps are usable
COMPRESSED = re.compile(r"jpe?g|png|webp", re.I)
IMAGE, SCAN, ODOMETRY, TRUTH = "image", "scan", "odometry", "truth"
MOST_SCANS = 50  # that wait for the odometry after them


@dataclass(frozen=True, slots=True)
class ChosenTopics:
    """The topics to read: one of pictures, one of scans, and the sources of poses."""

    image: str | None
    odometry: PoseTopic | None = None
    truth: PoseTopic | None = None
    transforms: tuple[str, ...] = ()  # topics of transforms, all of them, where frames are wanted
    scan: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """All topics to subscribe to, without duplicates."""
        poses = [route.topic for route in self.routes.values()]
        return tuple(
            dict.fromkeys(name for name in (self.image, self.scan, *poses, *self.transforms) if name)
        )

    @property
    def observed(self) -> set[str]:
        """What makes lines: "image" and "scan"."""
        return {role for role, topic in ((IMAGE, self.image), (SCAN, self.scan)) if topic is not None}

    @property
    def robot(self) -> str:
        """The robot's frame, if odometry is the transform between two frames; else ""."""
        return "" if self.odometry is None or self.odometry.frames is None else self.odometry.frames[1]

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
    content: Any  # a picture not encoded yet, the message of a scan, or a pose (3,)


@dataclass(frozen=True, slots=True)
class _Unencoded:
    encoded: Callable[[], str]  # returns its file as base64. FieldError if it cannot be read
    note: str = ""  # a remark for the user


class Translator:
    """Turns messages into records of a session log, as objects to be written as lines."""

    def __init__(self, max_dt_s: float, name: str = "robot") -> None:
        """`name` is that of the header which begins the session anew after a clock was set back."""
        self.problems: deque[FieldError] = deque(maxlen=100)  # pictures that were left out
        self._max_dt_s, self._name = max_dt_s, name
        self._clock = MessageClock()
        self._tracks = {ODOMETRY: PoseHistory(), TRUTH: PoseHistory()}
        self._sources: dict[PoseTopic, PoseSource] = {}
        self._undated: list[_Item] | None = []  # None once it is known whether stamps are usable
        self._recorded = False  # stamps are of no use: recording times count
        self._waiting: deque[tuple[float, float, Any]] = deque()  # time, our own clock's, picture or scan
        self._frames = FrameTree()  # to know where the laser sits
        self._robot = ""
        self._mount = ""  # the last remark on that
        self._last_pose: F64 | None = None
        self._last_s = float("-inf")
        self._has_odometry = False
        self._video = VideoStream()

    def take(self, message: Message, topics: ChosenTopics) -> Iterator[dict[str, Any]]:
        """Yield the lines that a message completes. FieldError for an invalid message."""
        self._has_odometry, self._robot = topics.odometry is not None, topics.robot
        for item in self._items(message, topics):
            if self._undated is None:
                yield from self._sort(item)
                continue
            self._undated.append(item)
            roles = {undated.role for undated in self._undated}
            if roles >= {*topics.observed, *topics.routes} or self._many_undated():
                yield from self._settle_clock()

    def _items(self, message: Message, topics: ChosenTopics) -> Iterator[_Item]:
        routes = topics.routes.items()
        sources = {role: self._sources.setdefault(route, PoseSource(route)) for role, route in routes}
        hearing = {
            role: role_source
            for role, role_source in sources.items()
            if role_source.accepts(message.topic, message.type)
        }
        if message.topic not in (topics.image, topics.scan) and not hearing:
            return
        content = decoded(message)
        if message.topic == topics.image:
            stamp = _stamp(content)
            picture = self._picture(content, (message.log_ns if stamp is None else stamp) / 1e9)
            if picture is not None:
                yield _Item(IMAGE, stamp, message.log_ns, picture)
        if message.topic == topics.scan and known_type(message.type) in SCANS:
            stamp = _stamp(content)
            middle = None if stamp is None else stamp + int(sweep_s(content) / 2 * 1e9)
            yield _Item(SCAN, middle, message.log_ns, content)
        for role, source in hearing.items():
            for stamped in stamped_poses(source, content, message.topic):
                yield _Item(role, stamped.stamp_ns, message.log_ns, stamped.pose)

    def learn(self, message: Message) -> None:
        """Take in transforms, which say where the laser sits. FieldError for invalid ones."""
        try:
            links = links_of(decoded(message))
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found invalid transforms ({short(problem)})") from None
        for link in links if len(self._frames) < MOST_FRAMES else ():
            self._frames.add(link)

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
        if item.stamp_ns is None and not self._recorded:  # any other clock's time would be a leap
            self.problems.append(FieldError(f"found no time in a message of the {item.role}, expected one"))
            return
        stamp = None if self._recorded else item.stamp_ns
        messages = self._clock.take(item.role, (item.log_ns if stamp is None else stamp) / 1e9, item.content)
        if self._clock.was_set_back:
            yield from self._begin_anew()
        for role, t_s, content in messages:
            if role in (IMAGE, SCAN):
                self._waiting.append((t_s, time.monotonic(), content))
            else:
                self._tracks[role].add(t_s, content)
            yield from self._ready()

    def _begin_anew(self) -> Iterator[dict[str, Any]]:
        """Yield what waits, then a header: poses from before the clock was set back no longer count."""
        yield from self._ready(whatever=True)
        self._tracks = {ODOMETRY: PoseHistory(), TRUTH: PoseHistory()}
        self._last_pose, self._last_s = None, float("-inf")
        yield header_of(self._name)

    def _ready(self, *, whatever: bool = False) -> Iterator[dict[str, Any]]:
        """Yield the lines of what no longer waits; with `whatever`, of all that waits."""
        while self._waiting:
            t_s, since_s, seen = self._waiting[0]
            known = not self._has_odometry or self._tracks[ODOMETRY].last_s >= t_s
            known &= isinstance(seen, _Unencoded) or self._is_placed(seen)
            pictures = sum(isinstance(waiting[2], _Unencoded) for waiting in self._waiting)
            many = pictures > MOST_PICTURES or len(self._waiting) > MOST_SCANS
            if not (known or many or whatever) and time.monotonic() - since_s <= LONGEST_S:
                return
            self._waiting.popleft()
            try:
                if isinstance(seen, _Unencoded):
                    yield from self._lines(t_s, seen)
                elif t_s >= self._last_s:  # of a camera beside it, a later picture may have come already
                    yield from self._scan_lines(t_s, seen)
            except FieldError as problem:  # before any of its lines
                self.problems.append(problem)

    def _lines(self, t_s: float, picture: _Unencoded) -> Iterator[dict[str, Any]]:
        if t_s < self._last_s:
            raise FieldError(f"found a picture at {t_s:.6f} s after one at {self._last_s:.6f} s")
        pose = self._pose(t_s, "picture")
        image = {"base64": picture.encoded()}
        yield from self._moved(t_s, pose)
        if picture.note:
            yield {"t": t_s, "event": picture.note}
        yield {"t": t_s, "image": image}

    def _scan_lines(self, t_s: float, message: Any) -> Iterator[dict[str, Any]]:
        pose = self._pose(t_s, "scan")
        try:
            place, mount = placed(self._frames, frame_of(message), self._robot)
            scan = scan_to_json(scan_of(message, place))
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found a scan that cannot be read ({short(problem)})") from None
        yield from self._moved(t_s, pose)
        if mount != self._mount:
            self._mount = mount
            yield {"t": t_s, "event": mount}
        yield {"t": t_s, "scan": scan}

    def _is_placed(self, message: Any) -> bool:
        """Return whether it is known where the laser sits; the first scan waits for that."""
        return bool(self._mount) or base_above(self._frames, frame_of(message), self._robot) is not None

    def _pose(self, t_s: float, of: str) -> F64 | None:
        """Return the odometry's pose (3,) at a time; FieldError where there is odometry, but none so near."""
        pose = self._tracks[ODOMETRY].at(t_s, self._max_dt_s)
        if pose is None and self._has_odometry:
            raise FieldError(
                f"found no odometry within {self._max_dt_s:g} s of a {of}; see --reading max_dt_s"
            )
        return pose

    def _moved(self, t_s: float, pose: F64 | None) -> Iterator[dict[str, Any]]:
        """Yield the motion since the last line, and the truth."""
        self._last_s = t_s
        if pose is not None:
            before = self._tracks[ODOMETRY].first if self._last_pose is None else self._last_pose
            self._last_pose = pose
            if before is not None and not np.array_equal(before, pose):
                yield {"t": t_s, "odometry": motion_between(before, pose).tolist()}
        truth = self._tracks[TRUTH].at(t_s, self._max_dt_s)
        if truth is not None:
            yield {"t": t_s, "truth": truth.tolist()}


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
