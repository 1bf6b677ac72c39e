"""Bag messages as records, in time order: pictures, poses, motions and texts of the chosen topics."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from maurice_mcl.values import F64, U8, SessionInfo

from ..errors import InputError, PictureError, ReadingNotes
from ..files.text import read_json
from ..reading.plane import OutOfPlane, Plane
from ..reading.recording import Motion, Note, Picture, Readings, TruthPose
from ..session_log.header import header_from_json
from ..session_log.records import readings_of
from .messages import (
    IN_XY,
    MESSAGE_ERRORS,
    NUMBERS,
    PICTURES,
    POSES,
    TEXT,
    TRANSFORMS,
    VIDEOS,
    FrameTree,
    known_type,
    links_of,
    matrix_in,
    picture_of,
    pose_of,
    stamp_ns,
)
from .source import BagSource, Message, OpenBag
from .topics import PoseTopic, of_robot, readable
from .video import VideoStream, codec_of

# Our own MCAP files hold what ROS has no message for (a start pose, motion parameters, a survey, numbers by
# name), and motions to the last bit: a path of poses neither separates motions between two pictures nor
# keeps those bits.
HEADER = "/session/header"  # std_msgs/String: the first line of the native log
MOTIONS = "/session/motions"  # of the type VECTOR: forward_m, left_m, turn_rad
VECTOR = "geometry_msgs/Vector3Stamped"
MOST_FRAMES = 1000  # in a tree of transforms; robots have some tens
READINGS = "/session/readings"  # std_msgs/String: the numbers of a row by name, as the log has them


class Timed(Protocol):
    """Anything with a time."""

    @property
    def t_s(self) -> float:
        """Seconds."""


def read_bag(
    path: Path,
    open_bag: OpenBag,
    readers: Collection[Reader],
    notes: ReadingNotes,
    clock_ns: int | None,
) -> Iterator[Timed]:
    """Yield the records of some readers as they come; invalid messages go to `notes`. InputError.

    What has no stamp is put on the clock of the stamps, which at first is `clock_ns` ahead of the recording;
    None: recording times are used for all.
    """
    if not readers:
        return
    with open_bag(path) as bag:
        names = topics_of(bag, readers)
        number = dict.fromkeys(names, 0)
        for message in bag.messages(names):
            number[message.topic] += 1
            on_clock = replace(message, log_ns=message.log_ns + clock_ns) if clock_ns else message
            for reader in readers:
                records = reader.records(on_clock, number[message.topic], recorded=clock_ns is None)
                for record in _valid(path, records, message, number[message.topic], notes):
                    clock_ns = clock_ns and round(record.t_s * 1e9) - message.log_ns
                    yield record


def topics_of(bag: BagSource, readers: Iterable[Reader]) -> set[str]:
    """Return the topics that readers need: with transforms, all of their robot."""
    names = {name for reader in readers for name in reader.topics}
    for reader in readers:
        if isinstance(reader, PoseReader) and reader.transforms:
            names |= {t.name for t in readable(of_robot(bag.topics, reader.route.topic), TRANSFORMS)}
    return names


def _valid(
    path: Path, records: Iterator[Timed], message: Message, number: int, notes: ReadingNotes
) -> Iterator[Timed]:
    try:
        content = list(records)
    except MESSAGE_ERRORS as problem:
        text = str(problem)
        if isinstance(problem, AttributeError):
            text = f"found no field {problem.name!r}, expected one"
        what = f"message {number} of {message.topic} ({message.type})"
        notes.problem(InputError(path, f"{what}: {text}; --keep-going leaves such messages out"))
    except InputError as problem:
        notes.problem(problem)
    else:
        yield from content


@dataclass(frozen=True, slots=True)
class OneTopic:
    """Reads the messages of one topic that are of certain types, and no transforms."""

    topic: str
    types: ClassVar[Collection[str]] = ()
    transforms: ClassVar[bool] = False

    @property
    def topics(self) -> Collection[str]:
        """The topic."""
        return (self.topic,)

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Yield the records of one message, the `number`-th of its topic; `recorded`: by recording time."""
        if self.accepts(message):
            decoded = message.decode()
            yield from self.read(decoded, time_s(decoded, message.log_ns, recorded=recorded), message, number)

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the records of a decoded message."""
        raise NotImplementedError

    def accepts(self, message: Message) -> bool:
        """Return whether a message is to be read; a topic may carry other types as well."""
        return message.topic == self.topic and known_type(message.type) in self.types


@dataclass(frozen=True, slots=True)
class PictureReader(OneTopic):
    """Converts a topic's messages to pictures."""

    types: ClassVar[Collection[str]] = PICTURES | VIDEOS
    _video: VideoStream = field(default_factory=VideoStream, compare=False)

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the picture of one message; video before its first key frame has none."""
        name = f"{self.topic} {number}"
        if known_type(message.type) in PICTURES and codec_of(content) is None:
            yield Picture(t_s, partial(_picture, content), name)
        elif (part := self._video.add(content, t_s)) is not None:
            if part.note:
                yield Note(t_s, part.note)
            yield Picture(t_s, part.read, name)


@dataclass(slots=True)
class PoseSource:
    """The poses of a topic, or of two frames of the transforms."""

    route: PoseTopic
    _tree: FrameTree = field(default_factory=FrameTree)

    def accepts(self, topic: str, kind: str) -> bool:
        """Return whether it reads a topic; it reads all transforms where it needs frames."""
        if self.route.frames is not None:
            return known_type(kind) in TRANSFORMS
        return topic == self.route.topic and known_type(kind) in POSES

    def poses(self, content: Any, topic: str) -> Iterator[tuple[int | None, Any]]:
        """Yield the stamp of a message, and the matrix (4, 4) or the message that holds its pose.

        Static transforms are no motion.
        """
        if self.route.frames is None:
            yield stamp_ns(content), content
            return
        if len(self._tree) > MOST_FRAMES:
            self._tree = FrameTree()
        news = self._tree.news(links_of(content), *self.route.frames)
        if news is not None and "static" not in topic:
            yield news


@dataclass(slots=True)
class PoseReader:
    """Converts a topic's messages, or the transforms between two frames, to poses."""

    route: PoseTopic
    make: Callable[[float, F64], Timed]
    offset_s: float
    plane: Plane = IN_XY
    out_of_plane: OutOfPlane = field(init=False)
    _source: PoseSource = field(init=False)
    _note: str = ""  # on the last pose

    def __post_init__(self) -> None:
        self.out_of_plane, self._source = OutOfPlane(self.plane), PoseSource(self.route)

    @property
    def topics(self) -> Collection[str]:
        """The topic of poses or transforms."""
        return (self.route.topic,)

    @property
    def transforms(self) -> bool:
        """All of them, where the pose is that of two frames."""
        return self.route.frames is not None

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Yield the pose of one message."""
        for t_s, pose in self._found(message, recorded=recorded):
            flat = not isinstance(pose, np.ndarray) and hasattr(pose, "theta")
            yield self.make(t_s + self.offset_s, pose_of(pose, self.plane) if flat else self._placed(pose))
            if self._note and self.make is TruthPose:
                yield Note(t_s + self.offset_s, self._note)

    def _placed(self, pose: Any) -> F64:
        """Return the pose (3,) of a matrix or a message in space, and look how far it leaves the plane."""
        matrix = pose if isinstance(pose, np.ndarray) else matrix_in(pose)
        self._note = self.out_of_plane.add(*self.plane.place(matrix[:3, 3], matrix[:3, :3]))
        return self.plane.pose(matrix)

    def matrices(self, message: Message) -> Iterator[F64]:
        """Yield the pose of one message in space (4, 4), if it is one."""
        for _, pose in self._found(message, recorded=True):
            if isinstance(pose, np.ndarray) or not hasattr(pose, "theta"):
                yield pose if isinstance(pose, np.ndarray) else matrix_in(pose)

    def _found(self, message: Message, *, recorded: bool) -> Iterator[tuple[float, Any]]:
        """Yield the time of a message, and the matrix (4, 4) or the message that holds its pose."""
        if self._source.accepts(message.topic, message.type):
            for stamp, pose in self._source.poses(message.decode(), message.topic):
                yield (message.log_ns if recorded or stamp is None else stamp) / 1e9, pose


@dataclass(frozen=True, slots=True)
class NoteReader(OneTopic):
    """Converts a topic's texts to events."""

    types: ClassVar[Collection[str]] = (TEXT,)

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the text of one message."""
        yield Note(t_s, str(content.data))


@dataclass(frozen=True, slots=True)
class MotionReader(OneTopic):
    """Converts the messages of `MOTIONS` to motions."""

    types: ClassVar[Collection[str]] = (VECTOR,)
    offset_s: float  # added to the times

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the motion of one message."""
        vector = content.vector
        yield Motion(t_s + self.offset_s, np.array([vector.x, vector.y, vector.z], np.float64))


@dataclass(frozen=True, slots=True)
class NumberReader(OneTopic):
    """Converts a topic's numbers to readings; those that are not finite, as of a range, are left out."""

    types: ClassVar[Collection[str]] = NUMBERS
    name: str  # of the reading

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the reading of one message."""
        value = float(content.data if hasattr(content, "data") else content.range)
        if math.isfinite(value):
            yield Readings(t_s, {self.name: value})


class RowReader(NoteReader):
    """Converts the texts of `READINGS` to readings, a row at a time."""

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the readings of one message."""
        yield Readings(t_s, readings_of(read_json(str(content.data))))


Reader = OneTopic | PoseReader


def first_messages(bag: BagSource, topic: str, most: int) -> Iterator[tuple[Message, Any]]:
    """Yield the first messages of a topic with their contents, but for those that cannot be decoded.

    No more than there are: reading on after the last one would read the whole bag.
    """
    count = sum(entry.count for entry in bag.topics if entry.name == topic)
    for message in islice(bag.messages({topic}), min(most, count)):
        try:
            content = message.decode()
        except (InputError, *MESSAGE_ERRORS):  # reported when it is read
            continue
        yield message, content


def has_topic(bag: BagSource, name: str, kind: str) -> bool:
    """Return whether a bag holds a topic of that type."""
    return any(topic.name == name for topic in readable(bag.topics, {kind}))


def header_of(path: Path, bag: BagSource) -> SessionInfo | None:
    """Return the header that our own files carry; None in others'. InputError for a damaged one."""
    if not has_topic(bag, HEADER, TEXT):
        return None
    for message in islice(bag.messages({HEADER}), 1):
        try:
            return header_from_json(read_json(str(message.decode().data)), path)[0]
        except MESSAGE_ERRORS as problem:
            raise InputError(path, f"{HEADER}: {problem}; is it damaged?") from None
    return None


def time_s(message: Any, log_ns: int, *, recorded: bool) -> float:
    """Return the time of a message in seconds: its own, or that of its recording."""
    stamp = None if recorded else stamp_ns(message)
    return (log_ns if stamp is None else stamp) / 1e9


def _picture(message: Any) -> U8:
    try:
        return picture_of(message)
    except PictureError:
        raise
    except MESSAGE_ERRORS as problem:
        raise PictureError(f"found a message without a picture ({problem}), expected one") from None


# Sorting records that were written nearly in order: each is released as soon as nothing earlier can come.

WINDOW_S = 1.0  # a message recorded later than another was measured at most this much earlier
RESTART_S = 3.0  # times that fall by more ...
MOST_FALLEN = 20  # ... so often in a row are of a clock that began again
LATE = f"their times fall by more than {WINDOW_S:g} s"
SET_BACK = "their times begin again, as of another drive; record each drive to a bag of its own"
MOST_WAITING = 5000  # records held back ...
MOST_PICTURES = 32  # ... and pictures among them, which are large


def in_order(records: Iterable[Timed], notes: ReadingNotes) -> Iterator[Timed]:
    """Yield records in the order of their times; those that come too late are counted in `notes`.

    So are all that come once a clock has begun again.
    """
    left_out = Counter[str]()
    waiting: list[tuple[float, int, Timed]] = []
    newest_s = released_s = before_s = float("-inf")
    number = pictures = fallen = 0
    for record in records:
        if fallen < MOST_FALLEN:
            fallen = fallen + 1 if record.t_s < released_s - RESTART_S else 0
        if record.t_s < released_s or fallen == MOST_FALLEN:
            left_out[f"({type(record).__name__}) were left out: {SET_BACK if fallen else LATE}"] += 1
            continue
        number += 1
        pictures += isinstance(record, Picture)
        heapq.heappush(waiting, (record.t_s, number, record))
        newest_s, before_s = max(newest_s, min(before_s, record.t_s)), record.t_s  # a lone wrong time is none
        while waiting and (
            waiting[0][0] < newest_s - WINDOW_S or len(waiting) > MOST_WAITING or pictures > MOST_PICTURES
        ):
            released_s, _, first = heapq.heappop(waiting)
            pictures -= isinstance(first, Picture)
            yield first
    while waiting:
        yield heapq.heappop(waiting)[2]
    for words, count in left_out.items():
        notes.warning(f"{count} records {words}")
