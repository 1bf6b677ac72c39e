"""The rosbridge protocol, as a client: topics asked for, subscribed to, and their messages in JSON.

https://github.com/RobotWebTools/rosbridge_suite/blob/ros2/ROSBRIDGE_PROTOCOL.md
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from functools import partial

from .bag_source import Message, Topic, short_type, sorted_topics
from .fields import FieldError, items, mapping
from .live_messages import as_object

ASK = "/rosapi/topics"
QUEUE = 10  # messages that the bridge keeps for us


class Rosbridge:
    """One conversation with a rosbridge server."""

    def __init__(self) -> None:
        self._topics: tuple[Topic, ...] = ()
        self._subscribed: set[str] = set()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics that the server told of."""
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
        """Take in a message. FieldError for what is not of the protocol."""
        try:
            found = mapping(json.loads(message), "a message")
        except (ValueError, RecursionError):
            raise FieldError("found a message that is not JSON, expected rosbridge's") from None
        name = found.get("topic")
        if found.get("op") == "publish" and isinstance(name, str) and name in self._subscribed:
            text = json.dumps(found.get("msg"))
            kind = next((topic.type for topic in self._topics if topic.name == name), "")
            decode = partial(json.loads, text, object_hook=as_object)
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
