"""A common interface to every kind of bag: topics, and messages decoded on demand."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import InputError
from ..files.text import read_json
from .unpacking import TooLarge, limit_libraries, unpack_zstd

if TYPE_CHECKING:
    from google.protobuf.message import Message as ProtobufMessage
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

MOST_DEFINITION = 256 * 1024  # bytes that define a type; those of robots have some thousand
MOST_ARRAY = 4096  # elements of an array of fixed length; a covariance has 36
INSTALL = "pip install 'maurice-replay[ros]'"


@dataclass(frozen=True, slots=True)
class Topic:
    """A stream of messages."""

    name: str
    type: str  # "nav_msgs/Odometry", "foxglove.CompressedImage"
    count: int
    unreadable: str = ""  # why its messages cannot be decoded; "" when they can


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """A message, not decoded yet."""

    topic: str
    type: str
    log_ns: int  # when it was recorded
    decode: Callable[[], Any]  # returns an object with the message's fields; raises InputError


class BagSource(Protocol):
    """An open bag."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics, by name; a name appears twice when it carries two types."""

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics by recording time. InputError if the bag is damaged."""


OpenBag = Callable[[Path], AbstractContextManager[BagSource]]  # called each time the bag is read; InputError


def short_type(name: str) -> str:
    """Return the ROS 1 form of a ROS 2 type name: `nav_msgs/Odometry` for `nav_msgs/msg/Odometry`."""
    return name.replace("/msg/", "/")


def sorted_topics(topics: Collection[Topic]) -> tuple[Topic, ...]:
    """Merge topics of the same name and type, and sort them by name."""
    merged: dict[tuple[str, str], Topic] = {}
    for topic in topics:
        known = merged.get((topic.name, topic.type))
        count = topic.count + (known.count if known else 0)
        merged[topic.name, topic.type] = Topic(topic.name, topic.type, count, topic.unreadable)
    return tuple(merged[key] for key in sorted(merged))


def require_ros(path: Path) -> None:
    """Raise InputError, with the command that installs it, where the extra that reads bags is missing.

    Else what reads them unpacks within limits from now on.
    """
    if any(importlib.util.find_spec(package) is None for package in ("rosbags", "mcap", "google")):
        raise InputError(path, f"reading bags and MCAP needs an extra; {INSTALL}")
    limit_libraries()


@contextmanager
def bag_errors(path: Path, repair: str = "was the recording closed properly?") -> Iterator[None]:
    """Convert any exception of a bag library into one InputError that names the repair."""
    try:
        yield
    except InputError:
        raise
    except TooLarge as problem:
        raise InputError(path, str(problem)) from None
    except Exception as problem:  # rosbags raises many kinds for damaged files
        what = " ".join(str(problem).split())[:200] or REASONS.get(type(problem).__name__, "unreadable")
        fault = f"found a damaged or incomplete file ({what.rstrip('.')}), expected a complete one"
        raise InputError(path, f"{fault}; {repair}") from None


REASONS = {"EndOfFile": "it ends in the middle of a record", "MemoryError": "a length out of range"}


def starts_with(path: Path, magic: bytes) -> bool:
    """Return whether a file begins with these bytes; False for one that cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False


ENCODINGS = ("cdr", "json", "ros1", "protobuf")
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
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
    if len(definition) > MOST_DEFINITION:
        raise ValueError(f"its type takes {len(definition):,} bytes, expected {MOST_DEFINITION:,} or less")
    if encoding == "json":
        return decode_json(data)
    if encoding == "protobuf":
        return decode_protobuf(data, kind, definition)
    if encoding == "ros1":
        return decode_ros1(data, long_type(kind), definition.decode())
    return decode_cdr(data, long_type(kind), definition.decode(), "idl" if "idl" in form else "msg")


def decode_json(data: bytes | str) -> Any:
    """Decode a JSON message into an object with its fields."""
    return read_json(data, object_hook=json_object)


def json_object(fields: dict[str, Any]) -> Any:
    """Return a JSON object as an object with fields; the parts of a ROS 1 time are named as in ROS 2."""
    if fields.keys() == {"secs", "nsecs"}:
        fields = {"sec": fields["secs"], "nanosec": fields["nsecs"]}
    return SimpleNamespace(**fields)


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
    """Decode a ROS 2 message, perhaps compressed, of a type `nav_msgs/msg/Odometry`; `form`: msg or idl."""
    if data.startswith(ZSTD_MAGIC):  # else the first byte is 0 (CDR)
        data = unpack_zstd(data)
    return _typestore(kind, definition, form, ros1=False).deserialize_cdr(data, kind)


def decode_ros1(data: bytes, kind: str, definition: str) -> Any:
    """Decode a ROS 1 message."""
    return _typestore(kind, definition, "msg", ros1=True).deserialize_ros1(data, kind)


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
        store.register(_bounded(get_types_from_msg(definition, kind)))
        return store
    line = "=" * 80 + "\n"  # several files in one, each headed by its name
    for part in definition.split(line):
        text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
        if text.strip():
            store.register(_bounded(get_types_from_idl(text)))
    return store


def _bounded(types: Typesdict) -> Typesdict:
    """Return the types unchanged. ValueError for a long array of fixed length.

    A decoder is a program with lines for each of its elements, however short the messages are.
    """
    from rosbags.interfaces import Nodetype

    for _, fields in types.values():
        for name, field in fields:
            if field[0] == Nodetype.ARRAY and field[1][1] > MOST_ARRAY:
                length = field[1][1]
                raise ValueError(f"its field {name} has {length:,} elements, expected {MOST_ARRAY:,} or less")
    return types
