"""A common interface for every kind of bag: topics with types and counts, messages decoded when asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, Generic, Protocol, Self, TypeVar

from ..errors import InputError

# One face for every kind of bag: topics with their types and counts, and messages decoded lazily.


@dataclass(frozen=True, slots=True)
class Topic:
    """A stream of messages."""

    name: str
    type: str  # "nav_msgs/Odometry", "foxglove.CompressedImage"
    count: int
    unreadable: str = ""  # why its messages cannot be decoded; "" when they can


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """A message, not decoded yet."""

    topic: str
    type: str
    log_ns: int  # when it was recorded
    decode: Callable[[], Any]  # gives an object whose attributes are the message's fields; raises InputError


class BagSource(Protocol):
    """An open bag."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics, by name; a name stands twice when it carries two types."""
        ...

    @property
    def cut(self) -> str:
        """What is missing of a damaged bag that is read all the same, as far as that is known so far."""
        ...

    @property
    def damaged(self) -> tuple[str, ...]:
        """What was left out in the middle of it, as far as that is known so far."""
        ...

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording. InputError where the bag is damaged."""
        ...


class OpenBag(Protocol):
    """What opens a bag, every time it is read."""

    def __call__(self, path: Path, *, keep_going: bool) -> AbstractContextManager[BagSource]:
        """Open the bag. InputError when it is damaged."""
        ...


def short_type(name: str) -> str:
    """Write ROS 1 and ROS 2 names of a type alike: `nav_msgs/msg/Odometry` is `nav_msgs/Odometry`."""
    return name.replace("/msg/", "/")


def sorted_topics(topics: Collection[Topic]) -> tuple[Topic, ...]:
    """Join topics of the same name and type, and sort them by name."""
    joined: dict[tuple[str, str], Topic] = {}
    for topic in topics:
        known = joined.get((topic.name, topic.type))
        count = topic.count + (known.count if known else 0)
        joined[topic.name, topic.type] = Topic(topic.name, topic.type, count, topic.unreadable)
    return tuple(joined[key] for key in sorted(joined))


# A bag in one file: how it is opened and read, and what is said where it is damaged.

Source = TypeVar("Source")  # what a message came from: a channel, a connection
Held = TypeVar("Held")


class BagError(ValueError):
    """What is wrong with the bytes of a bag."""


class BagCut(BagError):
    """The file ends in the middle of a record, or without its index."""


class ChunkDamaged(BagError):
    """One chunk makes no sense; the others may."""


BROKEN = (BagError, OSError, MemoryError)  # what a damaged file leads to


class BagFile(ABC, Generic[Source]):
    """A bag; a context manager, and read lazily as often as one likes.

    Raises InputError for another, damaged or cut file. With `keep_going` chunks that are damaged are
    left out, without an index the file is read from its beginning, and a cut one as far as it goes.
    """

    whole: ClassVar[str]  # what was expected, for errors
    mends: ClassVar[str]  # the command that mends a file that is cut
    advice: ClassVar[str]  # what to do of other damage

    def __init__(self, path: Path, *, keep_going: bool = False) -> None:
        self.path = path
        self.cut = ""  # what is missing of a file that is read all the same
        self.damaged: dict[
            int, str
        ] = {}  # chunks that were left out: the byte where each begins, what is wrong
        self._keep_going = keep_going
        self._size = 0

    def __enter__(self) -> Self:
        """Open the file and read what it says of itself."""
        try:
            self._file: BinaryIO = self.path.open("rb")
        except OSError as problem:
            raise InputError(self.path, f"cannot be read: {problem.strerror}") from None
        try:
            self._size = self._file.seek(0, 2)
            self._file.seek(0)
            self._open()
        except BROKEN as problem:
            self._file.close()
            raise self._refusal(problem) from None
        except InputError:
            self._file.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[Source, int, bytes]]:
        """Give messages by their source's number: source, time of recording in ns, bytes.

        They come by the time of recording where the file has an index, else as written. InputError where the
        file is damaged, or cut and not kept going.
        """
        try:
            for source, log_ns, data in self._held(wanted):
                yield source, log_ns, bytes(data)
        except BagError as problem:
            if not self._keep_going:
                raise self._refusal(problem) from None
            self.cut = str(problem)
        except BROKEN as problem:
            raise self._refusal(problem) from None

    def _sound(self, at: int, messages: Iterator[Held]) -> Iterator[Held]:
        """Give the messages of the chunk at a byte, up to where it is damaged."""
        try:
            yield from messages
        except BagError as problem:
            what = f"the chunk at byte {at} is damaged ({problem})"
            if not self._keep_going:
                raise ChunkDamaged(what) from None
            self.damaged[at] = f"{what} and was left out"

    @abstractmethod
    def _open(self) -> None:
        """Read what the file says of itself."""

    @abstractmethod
    def _held(self, wanted: Collection[int]) -> Iterator[tuple[Source, int, bytes | memoryview]]:
        """Give messages not yet copied out of their chunk."""

    def _refusal(self, problem: Exception) -> InputError:
        advice = self.advice
        if isinstance(problem, ChunkDamaged):
            advice = "--keep-going leaves it out and reads on"
        elif isinstance(problem, BagCut):
            advice = f"{self.mends} mends it, --keep-going reads it as far as it goes"
        return InputError(
            self.path, f"{str(problem) or type(problem).__name__}; expected {self.whole}; {advice}"
        )


class FileDamage:
    """What a `BagSource` that reads a `BagFile` says of its damage."""

    _file: BagFile[Any]

    @property
    def cut(self) -> str:
        """What is missing of a cut file."""
        return self._file.cut

    @property
    def damaged(self) -> tuple[str, ...]:
        """The chunks that were left out."""
        return tuple(self._file.damaged.values())
