"""ROS 2 bags, a folder with metadata.yaml or one file of messages, through `rosbags`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bag_source import BagSource, Message, Topic, short_type, sorted_topics
from .errors import LogError
from .mcap_bag import open_mcap
from .mcap_records import MAGIC as MCAP_MAGIC
from .ros_bag2_files import message_files, opened_as
from .ros_extra import bag_errors, require_ros
from .ros_sqlite import BrokenDatabase
from .ros_types import decode_cdr

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

SQLITE_MAGIC = b"SQLite format 3\0"
ADVICE = "--keep-going reads one file as far as it goes"


@contextmanager
def open_ros2(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open a ROS 2 bag. LogError when it is damaged; with `keep_going` one file is read until it breaks."""
    require_ros(path)
    with _opening(path, keep_going=keep_going) as bag:
        yield bag


def _opening(path: Path, *, keep_going: bool) -> AbstractContextManager[BagSource]:
    opened = opened_as(path)
    if starts_with(opened, MCAP_MAGIC):
        return open_mcap(opened, keep_going=keep_going)
    files = message_files(opened) if opened.is_dir() else [opened]
    alone = files[0] if len(files) == 1 else None
    try:
        bag = _Ros2Bag(opened, keep_going=keep_going)
        if alone is None or bag.packed or not starts_with(alone, MCAP_MAGIC):
            return closing(bag)
        bag.close()  # `rosbags` ends at the first damaged chunk, and does not say where that is
    except LogError:
        if alone is None or not keep_going:
            raise
    if starts_with(alone, MCAP_MAGIC):
        return open_mcap(alone, keep_going=keep_going)
    return closing(BrokenDatabase(alone))


def starts_with(path: Path, magic: bytes) -> bool:
    """Tell whether a file begins with these bytes; False for what cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False


def _reader(path: Path) -> Any:
    """Choose the reader by what is there, whatever its name ends with."""
    if path.is_dir():
        from rosbags.rosbag2.reader import DirectoryReader

        return DirectoryReader(path)
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    return Sqlite3Reader(path.absolute())


class _Ros2Bag:
    """A bag, opened by `rosbags`."""

    def __init__(self, path: Path, *, keep_going: bool) -> None:
        self._path = path
        self._keep_going = keep_going
        self.cut = ""
        self.damaged: tuple[str, ...] = ()  # it breaks off instead
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
        read = 0
        try:
            for connection, log_ns, data in self._raw(wanted):
                read += 1
                decode = partial(self._decode, connection, data)
                yield Message(connection.topic, short_type(connection.msgtype), log_ns, decode)
        except LogError:
            if not self._keep_going:
                raise
            self.cut = f"breaks off after {read} messages"

    def _raw(self, wanted: list[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        if wanted:  # with none, it would give all
            with bag_errors(self._path, ADVICE):
                for connection, log_ns, data in self._reader.messages(connections=wanted):
                    yield connection, int(log_ns), bytes(memoryview(data))  # a damaged row may hold anything

    def _decode(self, connection: Connection, data: bytes) -> Any:
        definition, form = connection.msgdef.data, connection.msgdef.format.name.lower()
        with bag_errors(self._path):
            return decode_cdr(data, connection.msgtype, definition, form)
