"""ROS 2 bags, a folder with metadata.yaml or one file of messages, through `rosbags`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bag_source import BagSource, Message, Topic, short_type, sorted_topics
from .errors import LogError
from .mcap_bag import open_mcap
from .ros_bag2_files import is_mcap, message_files, not_merged, not_there, opened_as
from .ros_bag2_parts import open_parts
from .ros_extra import bag_errors, require_ros
from .ros_types import decode_cdr

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

ADVICE = "--keep-going reads what can be read"


@contextmanager
def open_ros2(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open a ROS 2 bag. LogError when it is damaged; with `keep_going` what can be read of it is read."""
    require_ros(path)
    with _opening(path, keep_going=keep_going) as bag:
        yield bag


def _opening(path: Path, *, keep_going: bool) -> AbstractContextManager[BagSource]:
    files = message_files(path)
    lost = [text for file in files if (text := not_merged(file))]
    if lost and not keep_going:
        raise LogError(path, f"found that {lost[0]}, --keep-going reads without them")
    try:
        opened = opened_as(path)
        if is_mcap(opened):
            return open_mcap(opened, keep_going=keep_going)
        bag = _Ros2Bag(opened)
    except LogError:
        if not keep_going or not files:
            raise
        return open_parts(files, [*not_there(path), *lost])
    if len(files) == 1 and is_mcap(files[0]) and not bag.packed:
        bag.close()  # `rosbags` ends at the first damaged chunk, and does not say where that is
        return open_mcap(files[0], keep_going=keep_going)
    return closing(_PastDamage(bag, [] if bag.packed else files, lost) if keep_going else bag)


def _reader(path: Path) -> Any:
    """Choose the reader by what is there, whatever its name ends with."""
    if path.is_dir():
        from rosbags.rosbag2.reader import DirectoryReader

        return DirectoryReader(path)
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    return Sqlite3Reader(path.absolute())


class _Ros2Bag:
    """A bag, opened by `rosbags`. LogError where it is damaged."""

    cut = ""
    damaged: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self._path = path
        with bag_errors(path, ADVICE):
            self._reader = _reader(path)
            self._reader.open()
            found = [Topic(c.topic, short_type(c.msgtype), c.msgcount) for c in self._reader.connections]
            self.topics = sorted_topics(found)

    @property
    def packed(self) -> bool:
        """Tell whether messages or files are packed one by one."""
        return bool(self._reader.metadata.compression_mode)

    def close(self) -> None:
        """Close it."""
        with suppress(Exception):
            self._reader.close()

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording."""
        wanted = [c for c in self._reader.connections if c.topic in names]
        if not wanted:  # of which it would make all
            return
        with bag_errors(self._path, ADVICE):
            for connection, log_ns, data in self._reader.messages(connections=wanted):
                held = bytes(memoryview(data))  # a damaged row may hold anything
                decode = partial(self._decode, connection, held)
                yield Message(connection.topic, short_type(connection.msgtype), int(log_ns), decode)

    def _decode(self, connection: Connection, data: bytes) -> Any:
        definition, form = connection.msgdef.data, connection.msgdef.format.name.lower()
        with bag_errors(self._path):
            return decode_cdr(data, connection.msgtype, definition, form)


class _PastDamage:
    """A bag that is read from its files, past what is broken in them, where `rosbags` cannot go on."""

    def __init__(self, bag: _Ros2Bag, files: Sequence[Path], lost: Sequence[str]) -> None:
        self._bag = bag
        self._files = files
        self._lost = lost
        self.topics = bag.topics
        self.cut = ""
        self.damaged = tuple(lost)

    def close(self) -> None:
        """Close it."""
        self._bag.close()

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording, as far as they can be read."""
        given = _Given()
        try:
            for message in self._bag.messages(names):
                given.add(message)
                yield message
        except LogError:
            if not self._files:
                self.cut = f"breaks off after {given.messages} messages"
                return
            with open_parts(self._files, self._lost) as parts:
                yield from (message for message in parts.messages(names) if given.lacks(message))
                self.cut, self.damaged = parts.cut, parts.damaged


class _Given:
    """What has been given of messages in the order of time."""

    def __init__(self) -> None:
        self.messages = 0
        self._last_ns: float = -math.inf
        self._then = Counter[str]()  # messages of that time, by topic

    def add(self, message: Message) -> None:
        """Take note of the next one."""
        if message.log_ns != self._last_ns:
            self._then.clear()
        self.messages, self._last_ns = self.messages + 1, message.log_ns
        self._then[message.topic] += 1

    def lacks(self, message: Message) -> bool:
        """Tell whether one of those that are read once more was not given yet."""
        if message.log_ns != self._last_ns:
            return message.log_ns > self._last_ns
        self._then[message.topic] -= 1
        return self._then[message.topic] < 0
