"""Bag messages as records: pictures, poses and texts from the topics that were chosen, in time order."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Protocol

from maurice_mcl.arrays import F64, U8

from ..errors import InputError, PictureError
from ..io.notes import ReadingNotes
from ..recording import Note, Picture
from .images import picture_of
from .messages import (
    PICTURES,
    POSES,
    TEXT,
    TRANSFORMS,
    VIDEOS,
    FrameTree,
    Link,
    known_type,
    links_of,
    planar,
    pose_of,
    stamp_ns,
)
from .source import Message, OpenBag
from .topics import PoseTopic, readable
from .video import VideoStream, codec_of

# What the messages of a bag become: pictures, poses and texts, each from the topics it listens to.

MESSAGE_ERRORS = (
    ValueError,
    TypeError,
    AttributeError,
    KeyError,
    IndexError,
    OverflowError,
)  # of odd messages


class Timed(Protocol):
    """Anything with a time."""

    @property
    def t_s(self) -> float:
        """Seconds."""
        ...


class Reader(Protocol):
    """Makes records of messages."""

    @property
    def topics(self) -> Collection[str]:
        """The topics that it wants."""
        ...

    @property
    def transforms(self) -> bool:
        """Whether it wants all transforms as well."""
        ...

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the records of one message, the so many-th of its topic.

        `recorded`: at the time of recording instead of the one that the message carries.
        """
        ...


def read_parts(
    path: Path,
    open_bag: OpenBag,
    parts: Collection[Reader],
    notes: ReadingNotes,
    *,
    keep_going: bool,
    recorded: bool,
) -> Iterator[Timed]:
    """Read a bag from its beginning and give the records of some parts as they come.

    Messages that make no sense go to `notes`. InputError where the bag itself is damaged.
    """
    names = {name for part in parts for name in part.topics}
    if not names:
        return
    with open_bag(path, keep_going=keep_going) as bag:
        if any(part.transforms for part in parts):
            names |= {t.name for t in readable(bag.topics, TRANSFORMS)}
        number = dict.fromkeys(names, 0)
        for message in bag.messages(names):
            number[message.topic] += 1
            for part in parts:
                going = part.records(message, number[message.topic], recorded=recorded)
                yield from _sound(path, going, message, number[message.topic], notes)
        for text in bag.damaged:
            notes.damage(InputError(path, text))
        if bag.cut:
            notes.warning(f"{bag.cut}: read as far as it goes")


def _sound(
    path: Path, going: Iterator[Timed], message: Message, number: int, notes: ReadingNotes
) -> Iterator[Timed]:
    """Give the records of one message; what is wrong with it goes to `notes`."""
    try:
        found = list(going)
    except MESSAGE_ERRORS as problem:
        found = []
        said = str(problem)
        if isinstance(problem, AttributeError):
            said = f"found no field {problem.name!r}, expected one"
        what = f"message {number} of {message.topic} ({message.type})"
        notes.problem(InputError(path, f"{what}: {said}"))
    except InputError as problem:
        found = []
        notes.problem(problem)
    yield from found


@dataclass(frozen=True, slots=True)
class OneTopic:
    """Looks at the messages of one topic and of some types, and at no transforms."""

    topic: str
    types: ClassVar[Collection[str]] = ()

    @property
    def topics(self) -> Collection[str]:
        """The topic."""
        return (self.topic,)

    @property
    def transforms(self) -> bool:
        """None are wanted."""
        return False

    def hears(self, message: Message) -> bool:
        """Tell whether a message is meant; a topic may carry other types beside."""
        return message.topic == self.topic and known_type(message.type) in self.types


@dataclass(frozen=True, slots=True)
class PictureReader(OneTopic):
    """Makes pictures of a topic's messages."""

    types: ClassVar[Collection[str]] = PICTURES | VIDEOS
    _video: VideoStream = field(default_factory=VideoStream, compare=False)

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give what one message says; of video only what comes from the first key frame on."""
        if not self.hears(message):
            return
        found, name = message.decode(), f"{self.topic} {number}"
        t_s = time_s(found, message.log_ns, recorded=recorded)
        if known_type(message.type) in PICTURES and codec_of(found) is None:
            yield Picture(t_s, partial(_picture, found), name)
        elif (part := self._video.add(found, t_s)) is not None:
            if part.note:
                yield Note(t_s, part.note)
            yield Picture(t_s, part.read, name)


@dataclass(slots=True)
class PoseReader:
    """Makes poses of a topic's messages, or of two frames of its transforms."""

    route: PoseTopic
    make: Callable[[float, F64], Timed]
    offset_s: float
    _tree: FrameTree = field(default_factory=FrameTree)

    @property
    def topics(self) -> Collection[str]:
        """The topic of poses or transforms."""
        return (self.route.topic,)

    @property
    def transforms(self) -> bool:
        """All of them, where two frames are wanted."""
        return self.route.frames is not None

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give what one message says."""
        del number
        if self.route.frames is not None:
            if known_type(message.type) in TRANSFORMS:
                yield from self._moved(links_of(message.decode()), message.log_ns, recorded=recorded)
        elif message.topic == self.route.topic and known_type(message.type) in POSES:
            found = message.decode()
            t_s = time_s(found, message.log_ns, recorded=recorded)
            yield self.make(t_s + self.offset_s, pose_of(found))

    def _moved(self, links: list[Link], log_ns: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the pose anew when one of the transforms between the two frames was said anew."""
        news = self._tree.news(links, *(self.route.frames or ("", "")))
        if news is not None:
            stamp, matrix = news
            stamp = None if recorded else stamp
            yield self.make((log_ns if stamp is None else stamp) / 1e9 + self.offset_s, planar(matrix))


@dataclass(frozen=True, slots=True)
class NoteReader(OneTopic):
    """Makes events of a topic of texts, which carry no time: when they were recorded."""

    types: ClassVar[Collection[str]] = (TEXT,)

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Give the text of one message."""
        del number, recorded
        if self.hears(message):
            yield Note(message.log_ns / 1e9, str(message.decode().data))


def time_s(message: Any, log_ns: int, *, recorded: bool) -> float:
    """Give the time of a message in seconds: the one it carries, or that of its recording."""
    stamp = None if recorded else stamp_ns(message)
    return (log_ns if stamp is None else stamp) / 1e9


def _picture(message: Any) -> U8:
    """Decode a picture; a message that lacks a field is no picture."""
    try:
        return picture_of(message)
    except PictureError:
        raise
    except MESSAGE_ERRORS as problem:
        raise PictureError(f"found a message without a picture ({problem}), expected one") from None


# Putting records in order that were written nearly so: each as soon as nothing earlier can come.

WINDOW_S = 1.0  # a message recorded later than another was measured at most so much earlier
MOST_WAITING = 5000  # records held back ...
MOST_PICTURES = 32  # ... and pictures among them, which are large


def in_order(records: Iterable[Timed], late: Callable[[Timed], None]) -> Iterator[Timed]:
    """Give records by their times; those that come too late for that go to `late` instead."""
    waiting: list[tuple[float, int, Timed]] = []
    newest_s = given_s = float("-inf")
    number = pictures = 0
    for record in records:
        if record.t_s < given_s:
            late(record)
            continue
        number += 1
        pictures += isinstance(record, Picture)
        heapq.heappush(waiting, (record.t_s, number, record))
        newest_s = max(newest_s, record.t_s)
        while waiting and (
            waiting[0][0] < newest_s - WINDOW_S or len(waiting) > MOST_WAITING or pictures > MOST_PICTURES
        ):
            given_s, _, first = heapq.heappop(waiting)
            pictures -= isinstance(first, Picture)
            yield first
    while waiting:
        yield heapq.heappop(waiting)[2]
