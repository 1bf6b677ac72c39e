"""Decoding ROS messages by the definitions in a bag, or by the standard ones; the optional package for it."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .mcap_container import MOST_BYTES, ZSTD_MAGIC, unpack_zstd

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

# The optional package that reads bags, and its errors made ours.

INSTALL = "pip install 'maurice-replay[ros]'"


def require_ros(path: Path) -> None:
    """Raise InputError, with the command that fixes it, if the package that reads bags is not installed."""
    if importlib.util.find_spec("rosbags") is None:
        raise InputError(path, f"reading bags and MCAP needs an extra; {INSTALL}")


@contextmanager
def bag_errors(path: Path, advice: str = "was the recording ended properly?") -> Iterator[None]:
    """Turn whatever a reader stumbles over in a damaged file into a InputError.

    The readers raise anything, from their own errors to an assertion or a number that does not fit, so
    everything is caught here: wrap nothing but calls into them.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as problem:
        said = " ".join(str(problem).split())[:200] or type(problem).__name__
        found = f"found a damaged or unreadable bag ({said}), expected a whole one"
        raise InputError(path, f"{found}; {advice}") from None


# Decoding ROS messages by the definitions that a bag carries, or by the standard ones where it has none.

MORE = {  # not among the standard types; bags of ROS 2 before Iron carry no definitions
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight\n",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nnav2_msgs/Particle[] particles\n",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket": "std_msgs/Header header\nint32 width\nint32 height\n"
    "string encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data\n",
    "foxglove_msgs/msg/CompressedVideo": "builtin_interfaces/Time timestamp\nstring frame_id\n"
    "uint8[] data\nstring format\n",
}


def decode_cdr(data: bytes, kind: str, definition: str = "", form: str = "msg") -> Any:
    """Decode a ROS 2 message of type `nav_msgs/msg/Odometry`. `form` of the definition: msg or idl.

    A message may be packed, as those are of bags that were packed message by message.
    """
    if data.startswith(ZSTD_MAGIC):  # else the first byte is 0 (CDR)
        data = unpack_zstd(data, MOST_BYTES)
    return _store(kind, definition, form, ros1=False).deserialize_cdr(data, kind)


def decode_ros1(data: bytes, kind: str, definition: str) -> Any:
    """Decode a ROS 1 message."""
    return _store(kind, definition, "msg", ros1=True).deserialize_ros1(data, kind)


def long_type(name: str) -> str:
    """Write a type's name as the definitions do: `nav_msgs/Odometry` is `nav_msgs/msg/Odometry`."""
    package, _, rest = name.partition("/")
    return name if "/" in rest or not rest else f"{package}/msg/{rest}"


@lru_cache(maxsize=100)  # a peer may announce new ones for ever
def _store(kind: str, definition: str, form: str, *, ros1: bool) -> Typestore:
    """Make what decodes one type. Each type has its own, so that bags of mixed versions do no harm."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    if not definition:
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
        for name, text in MORE.items():
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
