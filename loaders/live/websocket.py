"""A robot's WebSocket, Foxglove bridge or rosbridge, as lines of a session log."""

from __future__ import annotations

import base64
import importlib.util
import json
import logging
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..bags.messages import MESSAGE_ERRORS, TRANSFORMS, known_type, links_of
from ..bags.readers import MOST_FRAMES
from ..bags.source import ENCODINGS, INSTALL, Message, Topic, decode, decode_json, short_type, sorted_topics
from ..bags.topics import TopicChoice, TopicRequest, choose, nothing_to_read, readable
from ..errors import FieldError, SourceError
from ..files.text import items, mapping, read_json
from ..reading.options import Reading
from ..session_log.header import header_of
from ..session_log.records import ascii_line
from .poses import short
from .translation import ChosenTopics, Translator, decoded

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

# The Foxglove WebSocket protocol, as a client: topics, subscriptions and messages.

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MESSAGE_DATA = 1  # first byte of a binary message
HEAD = struct.Struct("<BIQ")  # opcode, subscription, time in ns
MOST_CHANNELS = 5000
MOST_DEFINITIONS = 32 * 2**20  # characters of all channels together; a robot has some 500,000


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
        return sorted_topics([_topic(channel) for channel in self._channels.values()])

    @property
    def silence(self) -> str:
        """Why no topic is known, where that can be told."""
        return "" if self._channels else f"found no topic: the bridge announced none in {CHOOSE_S:g} s"

    def greet(self) -> Iterator[str]:
        """Nothing: the server sends first."""
        yield from ()

    def subscribe(self, names: tuple[str, ...]) -> Iterator[str]:
        """Subscribe to the channels of these topics that are new."""
        new = {
            number: channel
            for number, channel in self._channels.items()
            if channel.topic in names and number not in self._subscribed and channel.encoding in ENCODINGS
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
            fields = mapping(read_json(text), "a message")
        except ValueError as problem:
            raise FieldError(
                f"found a text that is not JSON, or too much ({short(problem)}), expected a message"
            ) from None
        if fields.get("op") == "advertise":
            for channel in items(fields.get("channels"), "channels"):
                self._announce(mapping(channel, "a channel"))
        elif fields.get("op") == "unadvertise":
            for number in items(fields.get("channelIds"), "channelIds"):
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
        known = sum(len(channel.definition) + len(channel.topic) for channel in self._channels.values())
        if known + len(definition) + len(topic) > MOST_DEFINITIONS:
            raise FieldError(f"found types defined in more than {MOST_DEFINITIONS // 2**20} MiB")
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
ROSAPI = "is the node rosapi running? On the robot: ros2 run rosapi rosapi_node, or rosrun in ROS 1"
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

    @property
    def silence(self) -> str:
        """Why no topic is known, where that can be told."""
        fault = f"found no answer to {ASK} from the server, expected its list of topics"
        return "" if self._topics else f"{fault}; {ROSAPI}"

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
            fields = mapping(read_json(message), "a message")
        except ValueError as problem:
            raise FieldError(
                f"found a text that is not JSON, or too much ({short(problem)}), expected a message"
            ) from None
        name = fields.get("topic")
        if fields.get("op") == "publish" and isinstance(name, str) and name in self._subscribed:
            text = json.dumps(fields.get("msg"))
            kind = next((topic.type for topic in self._topics if topic.name == name), "")
            decode = partial(decode_json, text)
            return Message(name, kind, time.time_ns(), decode)
        if fields.get("op") == "service_response" and fields.get("id") == ASK:
            self._announce(fields)
        return None

    def _announce(self, found: dict[str, object]) -> None:
        if found.get("result") is False:
            raise FieldError(f"found no answer to {ASK} ({found.get('values')}); {ROSAPI}")
        values = mapping(found.get("values"), "values")
        names, types = items(values.get("topics"), "topics"), items(values.get("types"), "types")
        pairs = zip(names, types, strict=False)
        self._topics = sorted_topics([Topic(str(name), short_type(str(kind)), 1) for name, kind in pairs])


MOST_MESSAGE_BYTES = 64 * 2**20  # a raw picture of 20 megapixels
OPEN_S = 5.0
CHOOSE_S = 5.0  # time in which topics may be announced, and transforms may name frames
Edges = frozenset[tuple[str, str]]  # parents and children of transforms
ASSUMED: Edges = frozenset((("odom", "base_link"),))  # frames that transforms may turn out to have


Bridge = Foxglove | Rosbridge


def connect_websocket(name: str, options: Reading) -> WebsocketStream:
    """Connect to a bridge. OSError if it cannot be reached, SourceError without the extra."""
    if any(importlib.util.find_spec(package) is None for package in ("websockets", "rosbags")):
        raise SourceError(name, f"listening to a bridge needs an extra; {INSTALL}")
    from websockets.exceptions import InvalidHandshake, InvalidURI
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    opened = ExitStack()
    try:
        wish = connect(
            name,
            subprotocols=[Subprotocol(protocol) for protocol in SUBPROTOCOLS],
            open_timeout=OPEN_S,
            close_timeout=1,
            max_size=MOST_MESSAGE_BYTES,
            logger=_quiet(),
            proxy=None,
        )
        connection = opened.enter_context(wish)
    except (InvalidHandshake, InvalidURI, EOFError) as problem:
        raise ConnectionError(0, f"is no WebSocket that we can use ({problem})") from None
    return WebsocketStream(name, connection, opened.close, options)


def _quiet() -> logging.Logger:
    """Return a silent logger: errors of a peer are reported in one line, not by a traceback."""
    logger = logging.getLogger("maurice-replay.websockets")
    logger.setLevel(logging.CRITICAL + 1)
    return logger


class WebsocketStream:
    """A connection to a bridge, as a `ByteStream` of session-log lines."""

    def __init__(
        self, name: str, connection: ClientConnection, close: Callable[[], None], options: Reading
    ) -> None:
        self._name, self._connection, self._close, self._options = name, connection, close, options
        self._bridge: Bridge = Foxglove() if connection.subprotocol in SUBPROTOCOLS else Rosbridge()
        self._topics: ChosenTopics | None = None
        self._translator = Translator(options.max_dt_s, name)
        self._edges: Edges = frozenset()
        self._known: tuple[tuple[Topic, ...], Edges] = ((), frozenset())  # when topics were chosen last
        self._begun_s = time.monotonic()
        self._send(self._bridge.greet())

    def read(self, wait_s: float) -> bytes | None:
        """Return the lines of what was received, a header first. OSError, FieldError, SourceError."""
        from websockets.exceptions import ConnectionClosed

        until = time.monotonic() + wait_s
        while True:
            if self._translator.problems:
                raise self._translator.problems.popleft()
            try:
                left_s = until - time.monotonic()
                message = self._connection.recv(timeout=max(0.0, left_s))
            except TimeoutError:
                header = self._choose(late=time.monotonic() - self._begun_s > CHOOSE_S)
                return header + b"".join(map(ascii_line, self._translator.idle())) or None
            except ConnectionClosed as problem:
                if problem.rcvd is None and problem.sent is not None:
                    raise ConnectionError(0, f"was disconnected: {problem.sent.reason or problem}") from None
                return b""
            if data := self._take(message):
                return data

    def close(self) -> None:
        """Close the connection."""
        self._close()

    def _take(self, message: str | bytes) -> bytes:
        content = self._bridge.hear(message)
        if content is None:
            return self._choose(late=False)
        learned = b""
        if known_type(content.type) in TRANSFORMS and (self._topics is None or self._topics.scan is not None):
            self._translator.learn(content)
        if known_type(content.type) in TRANSFORMS and (self._topics is None or self._topics.odometry is None):
            learned = self._learn(content)
        if self._topics is None:
            return learned
        return learned + b"".join(map(ascii_line, self._translator.take(content, self._topics)))

    def _learn(self, message: Message) -> bytes:
        try:
            edges = {(link.parent, link.child) for link in links_of(decoded(message))}
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found invalid transforms ({problem})") from None
        if len(self._edges) < MOST_FRAMES and not edges <= self._edges:
            self._edges |= edges
            return self._choose(late=False)
        return b""

    def _choose(self, *, late: bool) -> bytes:
        """Choose topics as they are announced; return the header once there are pictures or scans to read."""
        known, subscribed = self._bridge.topics, self._topics
        if subscribed is not None and (
            (known, self._edges) == self._known or (subscribed.odometry and subscribed.truth)
        ):
            return b""
        self._known = (known, self._edges)
        chosen, assumed = self._chosen(known, self._edges, late), self._chosen(known, ASSUMED, late)
        transforms = tuple(topic.name for topic in readable(known, TRANSFORMS))
        if not late and _needs_frames(assumed) and not _needs_frames(chosen):
            self._send(self._bridge.subscribe(transforms))
            return b""
        if chosen.image is None and not (late and chosen.scan):  # a camera may yet be announced
            if late:
                raise SourceError(self._name, self._bridge.silence or nothing_to_read(known, live=True))
            return b""
        frame_topics = transforms if _needs_frames(chosen) or chosen.scan else ()
        self._topics = ChosenTopics(chosen.image, chosen.odometry, chosen.truth, frame_topics, chosen.scan)
        self._send(self._bridge.subscribe(self._topics.names))
        guess = "; ".join(text for text in (chosen.guess, chosen.others) if text)
        header = header_of(self._name, notes=[guess] if guess else [])
        return b"" if subscribed else ascii_line(header)

    def _chosen(self, known: tuple[Topic, ...], edges: Edges, late: bool) -> TopicChoice:
        options = self._options
        wishes = TopicRequest(
            options.image_topic, options.odometry_topic, options.truth_topic, options.scan_topic
        )
        return choose(Path(self._name), known, wishes if late else _present(wishes, known), edges)

    def _send(self, messages: Iterator[str]) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            for message in messages:
                self._connection.send(message)
        except ConnectionClosed as problem:
            raise ConnectionError(0, f"closed the connection ({problem})") from None


def _needs_frames(chosen: TopicChoice) -> bool:
    return any(route is not None and route.frames is not None for route in (chosen.odometry, chosen.truth))


def _present(wishes: TopicRequest, known: tuple[Topic, ...]) -> TopicRequest:
    names = {topic.name.lstrip("/") for topic in known} | {"none"}
    roles = (wishes.image, wishes.odometry, wishes.truth, wishes.scan)
    flags = [name is None or name.partition(":")[0].lstrip("/") in names for name in roles]
    return TopicRequest(*(role if here else "none" for role, here in zip(roles, flags, strict=True)))
