"""What can be read of a damaged ROS 2 bag: its files one after the other, each past what is broken in it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from pathlib import Path

from .bag_source import BagSource, Message, Topic, sorted_topics
from .errors import LogError
from .mcap_bag import open_mcap
from .ros_bag2_files import is_mcap, opened_as
from .ros_sqlite import BrokenDatabase


@contextmanager
def open_parts(files: Sequence[Path], lost: Sequence[str] = ()) -> Iterator[BagParts]:
    """Open the files of a bag, of which something may be `lost` already. LogError where none can be."""
    opened: list[tuple[Path, BagSource]] = []
    refused: list[LogError] = []
    with ExitStack() as stack:
        for file in files:
            try:
                opened.append((file, stack.enter_context(_part(file))))
            except LogError as problem:
                refused.append(problem)
        if not opened:
            raise refused[0]
        yield BagParts(opened, [*lost, *map(str, refused)])


def _part(file: Path) -> AbstractContextManager[BagSource]:
    opened_as(file)  # which a packed file is not
    return open_mcap(file, keep_going=True) if is_mcap(file) else closing(BrokenDatabase(file))


class BagParts:
    """Open files of one bag, in the order of time whatever their names are, as a `BagSource`."""

    def __init__(self, parts: Sequence[tuple[Path, BagSource]], lost: Sequence[str]) -> None:
        self._parts = sorted(parts, key=lambda part: _begin_ns(part[1]))
        self._lost = lost  # what could not be opened, and why
        counts = Counter[tuple[str, str, str]]()
        for topic in (topic for _, part in parts for topic in part.topics):
            counts[topic.name, topic.type, topic.unreadable] += topic.count
        self.topics = sorted_topics([Topic(name, kind, n, why) for (name, kind, why), n in counts.items()])

    @property
    def cut(self) -> str:
        """What is missing at the end of the last file."""
        return self._parts[-1][1].cut

    @property
    def damaged(self) -> tuple[str, ...]:
        """What is missing elsewhere."""
        found = [f"{file.name}: {text}" for file, part in self._parts for text in part.damaged]
        found += [f"{file.name}: {part.cut}" for file, part in self._parts[:-1] if part.cut]
        return (*self._lost, *found)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics, file by file."""
        for _, part in self._parts:
            yield from part.messages(names)


def _begin_ns(part: BagSource) -> float:
    """Give when the first message of a file was recorded; infinity for one without any."""
    messages = part.messages({topic.name for topic in part.topics})
    return next((message.log_ns for message in messages), math.inf)
