"""ROS 2 bags, a folder with metadata.yaml or one .db3, through `rosbags`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bag_source import BagSource, Message, Topic, short_type, sorted_topics
from .ros_extra import bag_errors, each, require_ros
from .ros_types import decode_cdr

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

SQLITE_MAGIC = b"SQLite format 3\0"
METADATA = "metadata.yaml"


@contextmanager
def open_ros2(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open a ROS 2 bag. LogError when it is damaged, which keeping going does not help."""
    del keep_going
    require_ros(path)
    with bag_errors(path):
        reader = _reader(path)
        reader.open()
    try:
        yield _Ros2Bag(path, reader)
    finally:
        with suppress(Exception):
            reader.close()


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
    """An open bag."""

    def __init__(self, path: Path, reader: Any) -> None:
        self._path = path
        self._reader = reader
        found = [Topic(c.topic, short_type(c.msgtype), c.msgcount) for c in reader.connections]
        self.topics = sorted_topics(found)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording."""
        wanted = [c for c in self._reader.connections if c.topic in names]
        if not wanted:
            return
        with bag_errors(self._path):
            going = self._reader.messages(connections=wanted)
        for connection, log_ns, data in each(self._path, going):
            decode = partial(self._decode, connection, bytes(data))
            yield Message(connection.topic, short_type(connection.msgtype), log_ns, decode)

    def _decode(self, connection: Connection, data: bytes) -> Any:
        definition, form = connection.msgdef.data, connection.msgdef.format.name.lower()
        with bag_errors(self._path):
            return decode_cdr(data, connection.msgtype, definition, form)
