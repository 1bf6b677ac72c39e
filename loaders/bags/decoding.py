"""Message decoding: CDR (ROS 2), ROS 1, JSON and protobuf, by definitions that a bag or bridge carries."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from google.protobuf.message import Message as ProtobufMessage
    from rosbags.typesys.store import Typestore

ENCODINGS = ("cdr", "json", "ros1", "protobuf")
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MOST_BYTES = 2**30  # of one unpacked message or chunk; writers stay far below
SCHEMAS = 100  # kept; a peer may announce new ones forever
EXTRA_TYPES = {  # not among the standard types; bags of ROS 2 before Iron carry no definitions
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight\n",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nnav2_msgs/Particle[] particles\n",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket": "std_msgs/Header header\nint32 width\nint32 height\n"
    "string encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data\n",
    "foxglove_msgs/msg/CompressedVideo": "builtin_interfaces/Time timestamp\nstring frame_id\n"
    "uint8[] data\nstring format\n",
}


def decode(data: bytes, encoding: str, kind: str, definition: bytes, form: str) -> Any:
    """Decode a message of one of `ENCODINGS`. Raises anything for bytes that are no such message.

    `definition` of the type in its `form`: "ros2msg", "ros2idl", "protobuf" ...
    """
    if encoding == "json":
        return decode_json(data)
    if encoding == "protobuf":
        return decode_protobuf(data, kind, definition)
    if encoding == "ros1":
        return decode_ros1(data, long_type(kind), definition.decode())
    return decode_cdr(data, long_type(kind), definition.decode(), "idl" if "idl" in form else "msg")


def decode_json(data: bytes | str) -> Any:
    """Decode a JSON message into an object with its fields."""
    return json.loads(data, object_hook=json_object)


def json_object(found: dict[str, Any]) -> Any:
    """Return a JSON object as an object with fields; the parts of a ROS 1 time are named as in ROS 2."""
    if found.keys() == {"secs", "nsecs"}:
        found = {"sec": found["secs"], "nanosec": found["nsecs"]}
    return SimpleNamespace(**found)


def decode_protobuf(data: bytes, kind: str, description: bytes) -> Any:
    """Decode a protobuf message, `foxglove.RawImage` for example, by its FileDescriptorSet."""
    return _protobuf_parser(kind, description)(data)


@lru_cache(maxsize=SCHEMAS)
def _protobuf_parser(kind: str, description: bytes) -> Callable[[bytes], ProtobufMessage]:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    files = {file.name: file for file in FileDescriptorSet.FromString(description).file}

    def add(name: str) -> None:
        file = files.pop(name, None)
        if file is not None:
            for needed in file.dependency:
                add(needed)
            pool.AddSerializedFile(file.SerializeToString())

    for name in tuple(files):
        add(name)
    return GetMessageClass(pool.FindMessageTypeByName(kind)).FromString


def decode_cdr(data: bytes, kind: str, definition: str = "", form: str = "msg") -> Any:
    """Decode a ROS 2 message of type `nav_msgs/msg/Odometry`. `form` of the definition: msg or idl.

    A message may be compressed, as in bags that were compressed message by message.
    """
    if data.startswith(ZSTD_MAGIC):  # else the first byte is 0 (CDR)
        data = _unpacked(data)
    return _typestore(kind, definition, form, ros1=False).deserialize_cdr(data, kind)


def decode_ros1(data: bytes, kind: str, definition: str) -> Any:
    """Decode a ROS 1 message."""
    return _typestore(kind, definition, "msg", ros1=True).deserialize_ros1(data, kind)


def _unpacked(data: bytes) -> bytes:
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return bytes(zstd.ZstdDecompressor().decompress(data, max_length=MOST_BYTES))


def long_type(name: str) -> str:
    """Return a type's name as in its definition: `nav_msgs/msg/Odometry` for `nav_msgs/Odometry`."""
    package, _, rest = name.partition("/")
    return name if "/" in rest or not rest else f"{package}/msg/{rest}"


@lru_cache(maxsize=SCHEMAS)
def _typestore(kind: str, definition: str, form: str, *, ros1: bool) -> Typestore:
    """Return the decoder of one type. Each type has its own, so that mixed versions in a bag do no harm."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    if not definition:
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
        for name, text in EXTRA_TYPES.items():
            store.register(get_types_from_msg(text, name))
        return store
    store = get_typestore(Stores.EMPTY)
    if form == "msg":
        store.register(get_types_from_msg(definition, kind))
        return store
    line = "=" * 80 + "\n"  # several files in one, each headed by its name
    for part in definition.split(line):
        text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
        if text.strip():
            store.register(get_types_from_idl(text))
    return store
