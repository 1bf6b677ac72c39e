"""What bridges say when all is well, from which nonsense is made: Foxglove's protocol and rosbridge's."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import foxglove.messages as fox
import numpy as np
from fuzz_inputs import JPEG, PICTURE, mutated
from websockets.exceptions import ConnectionClosedOK

from helpers.bags import Ros
from maurice_loaders.live.websocket import ASK, HEAD

Message = str | bytes
Conversation = list[Message | None]  # None: nothing comes for a moment
ROS = Ros(2)
POSE, IMAGE = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Image"
LINKS = "tf2_msgs/msg/TFMessage"
PIXELS = np.full(6 * 8 * 3, 90, np.uint8)
BEGIN_S = 1_700_000_000


def _cdr(kind: str, message: Any) -> bytes:
    return bytes(ROS.store.serialize_cdr(message, kind))


def _cdr_pose(t_s: int) -> bytes:
    return _cdr(POSE, ROS.pose_stamped(t_s * 10**9 + 5, (t_s % 100, 0.0, 0.0)))


def _cdr_image(t_s: int) -> bytes:
    return _cdr(IMAGE, ROS.image(t_s * 10**9 + 5, PIXELS.reshape(6, 24), "rgb8", width=8))


def _cdr_transforms(t_s: int) -> bytes:
    return _cdr(LINKS, ROS.transforms(t_s * 10**9 + 5, "odom", "base_link", (t_s % 100 / 1.0, 0.0, 0.0)))


def _json_pose(t_s: int) -> dict[str, Any]:
    turned = {"x": 0, "y": 0, "z": 0, "w": 1}
    return {
        "timestamp": {"sec": t_s, "nsec": 0},
        "pose": {"position": {"x": t_s % 100, "y": 0, "z": 0}, "orientation": turned},
    }


def _json_image(t_s: int) -> dict[str, Any]:
    return {"timestamp": {"sec": t_s, "nsec": 0}, "format": "jpeg", "data": PICTURE}


def _proto_pose(t_s: int) -> bytes:
    turned = fox.Quaternion(x=0, y=0, z=math.sin(0.1), w=math.cos(0.1))
    where = fox.Pose(position=fox.Vector3(x=t_s % 100, y=1, z=0), orientation=turned)
    return fox.PoseInFrame(timestamp=fox.Timestamp(t_s), frame_id="odom", pose=where).encode()


def _proto_link(t_s: int) -> bytes:
    names = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
    moved, turned = fox.Vector3(x=t_s % 100, y=0, z=0), fox.Quaternion(x=0, y=0, z=0, w=1)
    when = fox.Timestamp(t_s)
    return fox.FrameTransform(timestamp=when, **names, translation=moved, rotation=turned).encode()


def _proto_image(t_s: int) -> bytes:
    fields = {"width": 8, "height": 6, "encoding": "rgb8", "step": 24, "data": PIXELS.tobytes()}
    return fox.RawImage(timestamp=fox.Timestamp(t_s), frame_id="camera", **fields).encode()


def _channel(number: int, topic: str, encoding: str, kind: str, *schema: str) -> dict[str, Any]:
    text, form = schema or ("", "")
    return {
        "id": number, "topic": topic, "encoding": encoding,
        "schemaName": kind, "schema": text, "schemaEncoding": form,
    }  # fmt: skip


def _ros_channels(*kinds: tuple[str, str]) -> list[dict[str, Any]]:
    return [
        _channel(n, topic, "cdr", kind, ROS.store.generate_msgdef(kind, ros_version=2)[0], "ros2msg")
        for n, (topic, kind) in enumerate(kinds, 1)
    ]


def _proto_channels(*kinds: tuple[str, Any]) -> list[dict[str, Any]]:
    schemas = [(topic, kind.get_schema()) for topic, kind in kinds]
    return [
        _channel(n, topic, "protobuf", one.name, base64.b64encode(one.data).decode(), "protobuf")
        for n, (topic, one) in enumerate(schemas, 1)
    ]


Says = Callable[[int], bytes]


def _foxglove(channels: list[dict[str, Any]], *says: Says) -> Conversation:
    told: Conversation = ['{"op": "serverInfo", "name": "robot", "capabilities": []}']
    told.append(json.dumps({"op": "advertise", "channels": channels}))
    if "tf" in channels[0]["topic"]:
        told.append(HEAD.pack(1, 1, BEGIN_S * 10**9) + says[0](BEGIN_S))
    for second in range(BEGIN_S, BEGIN_S + 3):
        for number, say in enumerate(says, start=1):
            told.append(HEAD.pack(1, number, second * 10**9) + say(second))
    return [*told, None]


def _as_json(say: Callable[[int], dict[str, Any]]) -> Says:
    return lambda t_s: json.dumps(say(t_s)).encode()


JSON = [("/odom", "foxglove.PoseInFrame"), ("/camera", "foxglove.CompressedImage")]
FOXGLOVE: list[Conversation] = [
    _foxglove(_ros_channels(("/odom", POSE), ("/camera", IMAGE)), _cdr_pose, _cdr_image),
    _foxglove(_ros_channels(("/tf", LINKS), ("/camera", IMAGE)), _cdr_transforms, _cdr_image),
    _foxglove(
        [_channel(n, topic, "json", kind) for n, (topic, kind) in enumerate(JSON, 1)],
        *(_as_json(_json_pose), _as_json(_json_image)),
    ),
    _foxglove(
        _proto_channels(("/odom", fox.PoseInFrame), ("/camera", fox.RawImage)), _proto_pose, _proto_image
    ),
    _foxglove(
        _proto_channels(("/tf", fox.FrameTransform), ("/camera", fox.RawImage)), _proto_link, _proto_image
    ),
]


def _rosbridge() -> Conversation:
    stamp = {"secs": BEGIN_S, "nsecs": 0}
    kinds = {"/odom": "geometry_msgs/PoseStamped", "/camera": "sensor_msgs/CompressedImage"}
    values = {"topics": list(kinds), "types": list(kinds.values())}
    told: Conversation = [json.dumps({"op": "service_response", "id": ASK, "values": values, "result": True})]
    for second in range(3):
        header = {"stamp": stamp | {"secs": BEGIN_S + second}, "frame_id": "odom"}
        pose = {"header": header, "pose": _json_pose(second)["pose"]}
        image = {"header": header, "format": "jpeg", "data": base64.b64encode(JPEG).decode()}
        for topic, message in (("/odom", pose), ("/camera", image)):
            told.append(json.dumps({"op": "publish", "topic": topic, "msg": message}))
    return [*told, None]


ROSBRIDGE: list[Conversation] = [_rosbridge()]


def mutated_talk(talks: list[Conversation], random: Random) -> Conversation:
    """Give a conversation in which something is wrong."""
    talk = list(random.choice(talks))
    others = [_bytes(one) for one in random.choice(talks) if one is not None]
    for _ in range(random.choice((1, 1, 2, 5))):
        at, what = random.randrange(len(talk)), random.random()
        if what < 0.1:
            talk.insert(random.randrange(len(talk)), talk[at])
        elif what < 0.15 and len(talk) > 1:
            del talk[at]
        else:
            talk[at] = _mutated_message(talk[at], others, random)
    return talk


def _mutated_message(message: Message | None, others: list[bytes], random: Random) -> Message | None:
    if message is None:
        return None
    if isinstance(message, str):
        return mutated(message.encode(), others, random).decode("utf-8", "replace")
    if random.random() < 0.8:  # what a message carries, more often than its head
        return message[: HEAD.size] + mutated(message[HEAD.size :], others, random)
    return mutated(message, others, random)


def _bytes(message: Message) -> bytes:
    return message.encode() if isinstance(message, str) else message


class ScriptedConnection:
    """Stands for a WebSocket: what is received is scripted, what is sent is taken in."""

    def __init__(self, subprotocol: str | None, talk: Conversation) -> None:
        self.subprotocol = subprotocol
        self.sent = 0
        self._talk: Iterator[Message | None] = iter(talk)

    def recv(self, timeout: float) -> Message:
        try:
            message = next(self._talk)
        except StopIteration:
            raise ConnectionClosedOK(None, None) from None
        if message is None:
            raise TimeoutError
        return message

    def send(self, text: str) -> None:
        assert json.loads(text)["op"]
        self.sent += len(text)

    def close(self) -> None: ...
