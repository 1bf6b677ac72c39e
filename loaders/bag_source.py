"""One face for every kind of bag: topics with their types and counts, and messages decoded lazily."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol


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
    decode: Callable[[], Any]  # gives an object whose attributes are the message's fields; raises LogError


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
        """Give the messages of these topics by the time of recording. LogError where the bag is damaged."""
        ...


class OpenBag(Protocol):
    """What opens a bag, every time it is read."""

    def __call__(self, path: Path, *, keep_going: bool) -> AbstractContextManager[BagSource]:
        """Open the bag. LogError when it is damaged."""
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
