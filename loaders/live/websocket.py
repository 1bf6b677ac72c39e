"""A robot's WebSocket, Foxglove bridge or rosbridge, as lines of a session log."""

from __future__ import annotations

import importlib.util
import json
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..bags.messages import TRANSFORMS, known_type, links_of
from ..bags.source import INSTALL, Message, Topic
from ..bags.topics import TopicChoice, TopicRequest, choose, nothing_to_read, readable
from ..errors import FieldError, SourceError
from ..reading import ReadingOptions
from ..session_log.header import FORMAT, VERSION
from .bridges import SUBPROTOCOLS, Foxglove, Rosbridge
from .translation import MESSAGE_ERRORS, MOST_FRAMES, ChosenTopics, Translator, decoded

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

MOST_MESSAGE_BYTES = 64 * 2**20  # a raw picture of 20 megapixels
OPEN_S = 5.0
CHOOSE_S = 5.0  # time in which topics may be announced, and transforms may name frames
Edges = frozenset[tuple[str, str]]  # parents and children of transforms
ASSUMED: Edges = frozenset((("odom", "base_link"),))  # frames that transforms may turn out to have


class Bridge(Protocol):
    """A client of one of the protocols."""

    def greet(self) -> Iterator[str]:
        """Yield the first messages to send."""
        ...

    def hear(self, message: str | bytes) -> Message | None:
        """Process a message and return it if it is of a subscribed topic. FieldError when it is invalid."""
        ...

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that were announced so far."""
        ...

    def subscribe(self, names: tuple[str, ...]) -> Iterator[str]:
        """Yield what to send to subscribe to those of the topics that are not subscribed yet."""
        ...


def connect_websocket(name: str, options: ReadingOptions) -> WebsocketStream:
    """Connect to a bridge. OSError where it cannot be reached, SourceError without the extra."""
    if any(importlib.util.find_spec(package) is None for package in ("websockets", "rosbags")):
        raise SourceError(name, f"listening to a bridge needs an extra; {INSTALL}")
    from websockets.exceptions import InvalidHandshake, InvalidURI
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    opened = ExitStack()
    try:
        wish = connect(
            name,
            subprotocols=[Subprotocol(one) for one in SUBPROTOCOLS],
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
        self, name: str, connection: ClientConnection, close: Callable[[], None], options: ReadingOptions
    ) -> None:
        self._name, self._connection, self._close, self._options = name, connection, close, options
        self._bridge: Bridge = Foxglove() if connection.subprotocol in SUBPROTOCOLS else Rosbridge()
        self._topics: ChosenTopics | None = None
        self._translator = Translator(options.max_dt_s)
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
                return header + b"".join(map(_line, self._translator.idle())) or None
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
        """Return the lines of a message. FieldError for an invalid one."""
        heard = self._bridge.hear(message)
        if heard is None:
            return self._choose(late=False)
        learned = b""
        if known_type(heard.type) in TRANSFORMS and (self._topics is None or self._topics.odometry is None):
            learned = self._learn(heard)
        if self._topics is None:
            return learned
        return learned + b"".join(map(_line, self._translator.take(heard, self._topics)))

    def _learn(self, message: Message) -> bytes:
        """Learn from transforms which frames exist, as long as there is no odometry."""
        try:
            edges = {(link.parent, link.child) for link in links_of(decoded(message))}
        except MESSAGE_ERRORS as problem:
            raise FieldError(f"found invalid transforms ({problem})") from None
        if len(self._edges) < MOST_FRAMES and not edges <= self._edges:
            self._edges |= edges
            return self._choose(late=False)
        return b""

    def _choose(self, *, late: bool) -> bytes:
        """Choose topics as they are announced; return the header once there are pictures to read."""
        known, taken = self._bridge.topics, self._topics
        if taken is not None and ((known, self._edges) == self._known or (taken.odometry and taken.truth)):
            return b""
        self._known = (known, self._edges)
        chosen, assumed = self._chosen(known, self._edges, late), self._chosen(known, ASSUMED, late)
        transforms = tuple(topic.name for topic in readable(known, TRANSFORMS))
        if not late and _needs_frames(assumed) and not _needs_frames(chosen):
            self._send(self._bridge.subscribe(transforms))
            return b""
        if chosen.image is None:
            if late:
                raise SourceError(self._name, nothing_to_read(known))
            return b""
        needed = transforms if _needs_frames(chosen) else ()
        self._topics = ChosenTopics(chosen.image, chosen.odometry, chosen.truth, needed)
        self._send(self._bridge.subscribe(self._topics.names))
        return b"" if taken else _line(_header(self._name, chosen.guess))

    def _chosen(self, known: tuple[Topic, ...], edges: Edges, late: bool) -> TopicChoice:
        options = self._options
        wishes = TopicRequest(options.image_topic, options.odometry_topic, options.truth_topic)
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
    """Leave out requested topics that are not announced yet."""
    names = {one.name.lstrip("/") for one in known} | {"none"}
    asked = (wishes.image, wishes.odometry, wishes.truth)
    there = [one is None or one.partition(":")[0].lstrip("/") in names for one in asked]
    return TopicRequest(*(one if here else "none" for one, here in zip(asked, there, strict=True)))


def _header(name: str, guess: str) -> dict[str, Any]:
    header = {"format": FORMAT, "version": VERSION, "kind": "session", "name": name}
    return header | {"notes": [guess] if guess else []}


def _line(value: dict[str, Any]) -> bytes:
    return (json.dumps(value) + "\n").encode()  # ASCII: what a bridge says may hold half a character
