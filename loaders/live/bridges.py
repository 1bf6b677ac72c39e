"""The clients of the Foxglove and rosbridge protocols.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md

https://github.com/RobotWebTools/rosbridge_suite/blob/ros2/ROSBRIDGE_PROTOCOL.md
"""

from __future__ import annotations

import base64
import json
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from ..bags.decoding import ENCODINGS, decode, json_object
from ..bags.source import Message, Topic, short_type, sorted_topics
from ..errors import FieldError
from ..io.fields import items, mapping

# The Foxglove WebSocket protocol, as a client: topics, subscriptions and messages.

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MESSAGE_DATA = 1  # first byte of a binary message
HEAD = struct.Struct("<BIQ")  # opcode, subscription, time in ns
MOST_CHANNELS = 5000


@dataclass(frozen=True, slots=True)
class _Channel:
    topic: str
    encoding: str
    schema: str
    definition: str
    form: str  # of the definition


class Foxglove:
    """A connection to a Foxglove bridge."""

    def __init__(self) -> None:
        self._channels: dict[int, _Channel] = {}
        self._subscribed: dict[int, _Channel] = {}  # by the subscription's number, which is the channel's

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that are announced now."""
        return sorted_topics([_topic(one) for one in self._channels.values()])

    def greet(self) -> Iterator[str]:
        """Nothing: the server sends first."""
        yield from ()

    def subscribe(self, names: tuple[str, ...]) -> Iterator[str]:
        """Subscribe to the channels of these topics that are new."""
        new = {
            number: one
            for number, one in self._channels.items()
            if one.topic in names and number not in self._subscribed and one.encoding in ENCODINGS
        }
        self._subscribed |= new
        if new:
            parts = [{"id": number, "channelId": number} for number in new]
            yield json.dumps({"op": "subscribe", "subscriptions": parts})

    def hear(self, message: str | bytes) -> Message | None:
        """Process a message. FieldError when it violates the protocol."""
        if isinstance(message, str):
            self._hear_text(message)
            return None
        if len(message) < HEAD.size or message[0] != MESSAGE_DATA:
            return None
        _, number, log_ns = HEAD.unpack_from(message)
        channel = self._subscribed.get(number)
        if channel is None:
            return None
        decode = partial(_decode, channel, message[HEAD.size :])
        return Message(channel.topic, short_type(channel.schema), log_ns, decode)

    def _hear_text(self, text: str) -> None:
        try:
            found = mapping(json.loads(text), "a message")
        except (ValueError, RecursionError):
            raise FieldError("found a text that is not JSON, expected a message of the bridge") from None
        if found.get("op") == "advertise":
            for one in items(found.get("channels"), "channels"):
                self._announce(mapping(one, "a channel"))
        elif found.get("op") == "unadvertise":
            for number in items(found.get("channelIds"), "channelIds"):
                if isinstance(number, int):
                    self._channels.pop(number, None)
                    self._subscribed.pop(number, None)

    def _announce(self, found: dict[str, Any]) -> None:
        number = found.get("id")
        if not isinstance(number, int) or not 0 <= number < 2**32 or len(self._channels) >= MOST_CHANNELS:
            raise FieldError("found a channel without a number, or too many of them")
        words = (
            str(found.get(key) or "")
            for key in ("topic", "encoding", "schemaName", "schema", "schemaEncoding")
        )
        topic, encoding, schema, definition, form = words
        self._channels[number] = _Channel(topic, encoding, schema, definition, form)


def _topic(channel: _Channel) -> Topic:
    unreadable = "" if channel.encoding in ENCODINGS else f"encoded as {channel.encoding or 'nothing'}"
    return Topic(channel.topic, short_type(channel.schema), 1, unreadable)


def _decode(channel: _Channel, data: bytes) -> Any:
    binary = channel.encoding == "protobuf"  # whose description is base64
    definition = base64.b64decode(channel.definition) if binary else channel.definition.encode()
    return decode(data, channel.encoding, channel.schema, definition, channel.form)


# The rosbridge protocol, as a client: topics, subscriptions and messages in JSON.

ASK = "/rosapi/topics"
QUEUE = 10  # messages that the bridge buffers for us


class Rosbridge:
    """A connection to a rosbridge server."""

    def __init__(self) -> None:
        self._topics: tuple[Topic, ...] = ()
        self._subscribed: set[str] = set()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that the server reported."""
        return self._topics

    def greet(self) -> Iterator[str]:
        """Ask for the topics; the server needs its node rosapi for an answer."""
        yield json.dumps({"op": "call_service", "service": ASK, "id": ASK})

    def subscribe(self, names: tuple[str, ...]) -> Iterator[str]:
        """Subscribe to the topics that are new."""
        for name in names:
            if name not in self._subscribed:
                self._subscribed.add(name)
                wish = {"op": "subscribe", "id": name, "topic": name, "queue_length": QUEUE}
                yield json.dumps(wish | {"compression": "none"})

    def hear(self, message: str | bytes) -> Message | None:
        """Process a message. FieldError when it violates the protocol."""
        try:
            found = mapping(json.loads(message), "a message")
        except (ValueError, RecursionError):
            raise FieldError("found a message that is not JSON, expected rosbridge's") from None
        name = found.get("topic")
        if found.get("op") == "publish" and isinstance(name, str) and name in self._subscribed:
            text = json.dumps(found.get("msg"))
            kind = next((topic.type for topic in self._topics if topic.name == name), "")
            decode = partial(json.loads, text, object_hook=json_object)
            return Message(name, kind, time.time_ns(), decode)
        if found.get("op") == "service_response" and found.get("id") == ASK:
            self._announce(found)
        return None

    def _announce(self, found: dict[str, object]) -> None:
        if found.get("result") is False:
            raise FieldError(f"found no answer to {ASK} ({found.get('values')}); does the robot run rosapi?")
        values = mapping(found.get("values"), "values")
        names, types = items(values.get("topics"), "topics"), items(values.get("types"), "types")
        pairs = zip(names, types, strict=False)
        self._topics = sorted_topics([Topic(str(name), short_type(str(kind)), 1) for name, kind in pairs])
