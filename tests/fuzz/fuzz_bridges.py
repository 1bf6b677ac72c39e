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
from fuzz_mutations import mutated
from fuzz_seeds import JPEG, PICTURE
from rosbags.typesys import Stores, get_typestore
from websockets.exceptions import ConnectionClosedOK

from maurice_loaders.live.websocket import ASK, HEAD

Message = str | bytes
Conversation = list[Message | None]  # None: nothing comes for a moment
STORE = get_typestore(Stores.LATEST)
TYPES = STORE.types
PIXELS = np.full(6 * 8 * 3, 90, np.uint8)
BEGIN_S = 1_700_000_000


def _definition(kind: str) -> str:
    return STORE.generate_msgdef(kind, ros_version=2)[0]


def _make(kind: str, **fields: Any) -> Any:
    return TYPES[kind](**fields)


def _header(t_s: int) -> Any:
    return _make(
        "std_msgs/msg/Header", stamp=_make("builtin_interfaces/msg/Time", sec=t_s, nanosec=5), frame_id="odom"
    )


def _pose(x_m: float) -> Any:
    turned = _make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return _make(
        "geometry_msgs/msg/Pose",
        position=_make("geometry_msgs/msg/Point", x=x_m, y=0.0, z=0.0),
        orientation=turned,
    )


def _cdr(kind: str, **fields: Any) -> bytes:
    return bytes(STORE.serialize_cdr(_make(kind, **fields), kind))


def _cdr_pose(t_s: int) -> bytes:
    return _cdr("geometry_msgs/msg/PoseStamped", header=_header(t_s), pose=_pose(t_s % 100))


def _cdr_image(t_s: int) -> bytes:
    size = {"height": 6, "width": 8, "step": 24, "is_bigendian": 0, "encoding": "rgb8"}
    return _cdr("sensor_msgs/msg/Image", header=_header(t_s), data=PIXELS, **size)


def _cdr_transforms(t_s: int) -> bytes:
    moved = _make("geometry_msgs/msg/Vector3", x=t_s % 100 / 1.0, y=0.0, z=0.0)
    turned = _make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    transform = _make("geometry_msgs/msg/Transform", translation=moved, rotation=turned)
    link = _make(
        "geometry_msgs/msg/TransformStamped",
        header=_header(t_s),
        child_frame_id="base_link",
        transform=transform,
    )
    return _cdr("tf2_msgs/msg/TFMessage", transforms=[link])


def _json_pose(t_s: int) -> dict[str, Any]:
    turned = {"x": 0, "y": 0, "z": 0, "w": 1}
    return {
        "timestamp": {"sec": t_s, "nsec": 0},
        "pose": {"position": {"x": t_s % 100, "y": 0, "z": 0}, "orientation": turned},
    }


def _json_image(t_s: int) -> dict[str, Any]:
    return {"timestamp": {"sec": t_s, "nsec": 0}, "format": "jpeg", "data": PICTURE}


def _proto_pose(t_s: int) -> bytes:
    where = fox.Pose(
        position=fox.Vector3(x=t_s % 100, y=1, z=0),
        orientation=fox.Quaternion(x=0, y=0, z=math.sin(0.1), w=math.cos(0.1)),
    )
    return fox.PoseInFrame(timestamp=fox.Timestamp(t_s), frame_id="odom", pose=where).encode()


def _proto_link(t_s: int) -> bytes:
    names = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
    moved = {
        "translation": fox.Vector3(x=t_s % 100, y=0, z=0),
        "rotation": fox.Quaternion(x=0, y=0, z=0, w=1),
    }
    return fox.FrameTransform(timestamp=fox.Timestamp(t_s), **names, **moved).encode()


def _proto_image(t_s: int) -> bytes:
    size = {"width": 8, "height": 6, "encoding": "rgb8", "step": 24}
    return fox.RawImage(
        timestamp=fox.Timestamp(t_s), frame_id="camera", data=PIXELS.tobytes(), **size
    ).encode()


def _channel(
    number: int, topic: str, encoding: str, kind: str, schema: str = "", form: str = ""
) -> dict[str, Any]:
    named = {"id": number, "topic": topic, "encoding": encoding, "schemaName": kind}
    return named | {"schema": schema, "schemaEncoding": form}


def _ros_channel(number: int, topic: str, kind: str) -> dict[str, Any]:
    return _channel(number, topic, "cdr", kind, _definition(kind), "ros2msg")


def _proto_channel(number: int, topic: str, kind: Any) -> dict[str, Any]:
    schema = kind.get_schema()
    return _channel(
        number, topic, "protobuf", schema.name, base64.b64encode(schema.data).decode(), "protobuf"
    )


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


POSE, IMAGE = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Image"
FOXGLOVE: list[Conversation] = [
    _foxglove([_ros_channel(1, "/odom", POSE), _ros_channel(2, "/camera", IMAGE)], _cdr_pose, _cdr_image),
    _foxglove(
        [_ros_channel(1, "/tf", "tf2_msgs/msg/TFMessage"), _ros_channel(2, "/camera", IMAGE)],
        *(_cdr_transforms, _cdr_image),
    ),
    _foxglove(
        [
            _channel(1, "/odom", "json", "foxglove.PoseInFrame"),
            _channel(2, "/camera", "json", "foxglove.CompressedImage"),
        ],
        *(_as_json(_json_pose), _as_json(_json_image)),
    ),
    _foxglove(
        [_proto_channel(1, "/odom", fox.PoseInFrame), _proto_channel(2, "/camera", fox.RawImage)],
        *(_proto_pose, _proto_image),
    ),
    _foxglove(
        [_proto_channel(1, "/tf", fox.FrameTransform), _proto_channel(2, "/camera", fox.RawImage)],
        *(_proto_link, _proto_image),
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
