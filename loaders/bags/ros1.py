"""ROS 1 bags, through `rosbags`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .decoding import decode_ros1
from .source import BagSource, Message, Topic, bag_errors, require_ros, short_type, sorted_topics, starts_with

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader

MAGIC = b"#ROSBAG V2.0\n"


@contextmanager
def open_ros1(path: Path) -> Iterator[BagSource]:
    """Open a ROS 1 bag. InputError when it is damaged, or was never closed."""
    require_ros(path)
    from rosbags.rosbag1 import Reader

    if not starts_with(path, MAGIC):
        raise InputError(path, "found no ROS 1 bag of version 2.0, expected one; is it another format?")
    with bag_errors(path, _repair(path)):
        reader = Reader(path)
        reader.open()
    try:
        yield _Ros1Bag(path, reader)
    finally:
        reader.close()


def _repair(path: Path) -> str:
    return f"repair it with `rosbag reindex {path.name}`"


class _Ros1Bag:
    """An open ROS 1 bag."""

    def __init__(self, path: Path, reader: Reader) -> None:
        self._path, self._reader = path, reader
        self.topics = sorted_topics(
            [Topic(one.topic, short_type(one.msgtype), one.msgcount) for one in reader.connections]
        )

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics by recording time."""
        wanted = [one for one in self._reader.connections if one.topic in names]
        if not wanted:  # which the library takes for all
            return
        with bag_errors(self._path, _repair(self._path)):
            for one, log_ns, data in self._reader.messages(wanted):
                yield Message(one.topic, short_type(one.msgtype), log_ns, partial(self._decode, one, data))

    def _decode(self, connection: Connection, data: bytes) -> Any:
        with bag_errors(self._path):
            return decode_ros1(data, connection.msgtype, connection.msgdef.data)
