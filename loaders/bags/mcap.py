"""MCAP files as bags: ROS 2 (CDR), ROS 1, JSON and protobuf messages, whatever profile the file names."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from .mcap_container import Channel, McapFile
from .mcap_proto import decode_proto
from .ros_types import bag_errors, decode_cdr, decode_ros1, long_type, require_ros
from .source import BagSource, FileDamage, Message, Topic, short_type, sorted_topics

ENCODINGS = ("json", "cdr", "ros1", "protobuf")
FORMS = {"ros2msg": "msg", "ros2idl": "idl", "omgidl": "idl"}


@contextmanager
def open_mcap(path: Path, *, keep_going: bool = False) -> Iterator[BagSource]:
    """Open an MCAP file. InputError when it is damaged, or cut and not kept going."""
    require_ros(path)
    with McapFile(path, keep_going=keep_going) as file:
        yield _McapBag(file)


class _McapBag(FileDamage):
    """An open MCAP file."""

    _file: McapFile

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self.topics = sorted_topics([self._topic(channel) for channel in file.channels.values()])

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics by the time of recording."""
        wanted = {number for number, channel in self._file.channels.items() if channel.topic in names}
        for channel, log_ns, data in self._file.messages(wanted):
            decode = partial(self._decode, channel, data)
            yield Message(channel.topic, short_type(channel.schema.name), log_ns, decode)

    def _topic(self, channel: Channel) -> Topic:
        known = channel.encoding in ENCODINGS
        why = "" if known else f"its messages are encoded as {channel.encoding!r}"
        return Topic(channel.topic, short_type(channel.schema.name), self._file.counts[channel.id], why)

    def _decode(self, channel: Channel, data: bytes) -> Any:
        with bag_errors(self._file.path):
            if channel.encoding == "json":
                return json.loads(data, object_hook=lambda found: SimpleNamespace(**found))
            if channel.encoding == "protobuf":
                return decode_proto(data, channel.schema.name, channel.schema.data)
            kind, definition = long_type(channel.schema.name), channel.schema.data.decode()
            if channel.encoding == "ros1":
                return decode_ros1(data, kind, definition)
            return decode_cdr(data, kind, definition, FORMS.get(channel.schema.encoding, "msg"))
