"""A common interface to every kind of bag: topics with types and counts, and messages decoded on demand."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ..errors import InputError

INSTALL = "pip install 'maurice-replay[ros]'"


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
    decode: Callable[[], Any]  # returns an object with the message's fields; raises InputError


class BagSource(Protocol):
    """An open bag."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics, by name; a name appears twice when it carries two types."""
        ...

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics by recording time. InputError where the bag is damaged."""
        ...


class OpenBag(Protocol):
    """The function that opens a bag; called each time the bag is read."""

    def __call__(self, path: Path) -> AbstractContextManager[BagSource]:
        """Open the bag. InputError when it is damaged or cut."""
        ...


def short_type(name: str) -> str:
    """Return the ROS 1 form of a ROS 2 type name: `nav_msgs/Odometry` for `nav_msgs/msg/Odometry`."""
    return name.replace("/msg/", "/")


def sorted_topics(topics: Collection[Topic]) -> tuple[Topic, ...]:
    """Merge topics of the same name and type, and sort them by name."""
    merged: dict[tuple[str, str], Topic] = {}
    for topic in topics:
        known = merged.get((topic.name, topic.type))
        count = topic.count + (known.count if known else 0)
        merged[topic.name, topic.type] = Topic(topic.name, topic.type, count, topic.unreadable)
    return tuple(merged[key] for key in sorted(merged))


def require_ros(path: Path) -> None:
    """Raise InputError, with the command that installs it, where the extra that reads bags is missing."""
    if any(importlib.util.find_spec(package) is None for package in ("rosbags", "mcap", "google")):
        raise InputError(path, f"reading bags and MCAP needs an extra; {INSTALL}")


@contextmanager
def bag_errors(path: Path, repair: str = "was the recording closed properly?") -> Iterator[None]:
    """Convert whatever a bag library raises on damaged bytes into one InputError that names the repair.

    The libraries raise anything, from their own errors to assertions and integers out of range, so everything
    is caught here: wrap nothing but calls into them.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as problem:
        what = " ".join(str(problem).split())[:200] or REASONS.get(type(problem).__name__, "unreadable")
        found = f"found a damaged or incomplete file ({what.rstrip('.')}), expected a complete one"
        raise InputError(path, f"{found}; {repair}") from None


REASONS = {"EndOfFile": "it ends in the middle of a record", "MemoryError": "a length out of range"}


def starts_with(path: Path, magic: bytes) -> bool:
    """Return whether a file begins with these bytes; False for one that cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False
