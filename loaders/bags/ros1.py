"""ROS 1 bags, with their messages decoded by `rosbags`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from .ros1_container import BagConnection, Ros1File
from .ros_types import bag_errors, decode_ros1, long_type, require_ros
from .source import BagSource, FileDamage, Message, Topic, short_type, sorted_topics


@contextmanager
def open_ros1(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open a ROS 1 bag. InputError when it is damaged, or was never closed and is not kept going."""
    require_ros(path)
    with Ros1File(path, keep_going=keep_going) as file:
        yield _Ros1Bag(file)


class _Ros1Bag(FileDamage):
    """An open ROS 1 bag."""

    _file: Ros1File

    def __init__(self, file: Ros1File) -> None:
        self._file = file
        parts = file.connections.items()
        found = [Topic(c.topic, short_type(c.type), file.counts[key]) for key, c in parts]
        self.topics = sorted_topics(found)

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording."""
        wanted = {key for key, connection in self._file.connections.items() if connection.topic in names}
        for connection, log_ns, data in self._file.messages(wanted):
            decode = partial(self._decode, connection, data)
            yield Message(connection.topic, short_type(connection.type), log_ns, decode)

    def _decode(self, connection: BagConnection, data: bytes) -> Any:
        with bag_errors(self._file.path):
            return decode_ros1(data, long_type(connection.type), connection.definition)
