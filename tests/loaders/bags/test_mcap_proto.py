"""Protobuf messages, decoded by the description beside them."""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path

import bag_making as making
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.bags.mcap_proto import (
    BOOL,
    DATA,
    DOUBLE,
    FLOAT,
    INT64,
    MESSAGE,
    REPEATED,
    SINT64,
    STRING,
    UINT32,
    ProtoError,
    decode_proto,
)
from maurice_loaders.formats.registry import open_session


def varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def whole(number: int, value: int) -> bytes:
    return varint(number << 3) + varint(value)


def held(number: int, data: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(data)) + data


def field(number: int, name: str, kind: int, *, repeated: bool = False, inner: str = "") -> bytes:
    label = whole(4, REPEATED if repeated else 1)
    data = held(1, name.encode()) + whole(3, number) + label + whole(5, kind) + held(6, inner.encode())
    return held(2, data)


INNER = held(1, b"Inner") + field(1, "x", DOUBLE)
OUTER = b"".join(
    (
        held(1, b"Outer"),
        field(1, "name", STRING),
        field(2, "count", INT64),
        field(3, "zigzag", SINT64),
        field(4, "data", DATA),
        field(5, "flags", UINT32, repeated=True),
        field(6, "inner", MESSAGE, inner=".test.Outer.Inner"),
        field(7, "values", FLOAT, repeated=True),
        field(8, "on", BOOL),
        held(3, INNER),
    )
)
DESCRIPTION = held(1, held(2, b"test") + held(4, OUTER))


def test_every_kind_of_field() -> None:
    message = b"".join(
        (
            held(1, b"caf\xc3\xa9"),
            whole(2, -5),
            whole(3, 9),
            held(4, b"\x00\xff"),
            held(5, varint(1) + varint(300)),
            whole(5, 7),  # and one that is not packed
            held(6, varint(1 << 3 | 1) + struct.pack("<d", 2.5)),
            held(7, struct.pack("<2f", 0.5, -1.0)),
            whole(8, 1),
            held(99, b"of a later version"),
        )
    )
    found = decode_proto(message, "test.Outer", DESCRIPTION)
    assert (found.name, found.count, found.zigzag, found.data) == ("café", -5, -5, b"\x00\xff")
    assert (found.flags, found.values, found.inner.x, found.on) == ([1, 300, 7], [0.5, -1.0], 2.5, 1)


def test_what_is_left_out_has_a_default() -> None:
    found = decode_proto(b"", "test.Outer", DESCRIPTION)
    assert (found.name, found.count, found.data, found.flags, found.inner) == ("", 0, b"", [], None)


def test_types_that_are_not_described() -> None:
    with pytest.raises(ProtoError, match=r"no description of test\.Other"):
        decode_proto(b"", "test.Other", DESCRIPTION)


@given(st.binary(max_size=200))
def test_any_bytes_are_a_message_or_a_proto_error(data: bytes) -> None:
    with suppress(ProtoError):
        decode_proto(data, "test.Outer", DESCRIPTION)
    with suppress(ProtoError):
        decode_proto(b"", "test.Outer", data)


def test_a_file_of_foxglove_s_own_writer(tmp_path: Path) -> None:
    foxglove = pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    from foxglove import messages as made
    from foxglove.channels import CompressedImageChannel, FrameTransformChannel, PoseInFrameChannel

    path = tmp_path / "drive.mcap"
    with foxglove.open_mcap(str(path)):
        camera, frames = CompressedImageChannel(topic="/camera"), FrameTransformChannel(topic="/tf")
        truth = PoseInFrameChannel(topic="/truth")
        for number in range(6):
            stamp = made.Timestamp(sec=1_700_000_000, nsec=number * 10**8)
            at = {"log_time": stamp.sec * 10**9 + stamp.nsec}
            place = made.Vector3(x=0.1 * number, y=2.0, z=0.0)
            level = made.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            named = {"parent_frame_id": "odom", "child_frame_id": "base_link"}
            moved = made.FrameTransform(timestamp=stamp, translation=place, rotation=level, **named)
            frames.log(moved, **at)
            pose = made.Pose(position=place, orientation=level)
            truth.log(made.PoseInFrame(timestamp=stamp, frame_id="map", pose=pose), **at)
            _, data = cv2.imencode(".png", making.picture(number)[..., ::-1])
            image = made.CompressedImage(timestamp=stamp, frame_id="c", data=data.tobytes(), format="png")
            camera.log(image, **at)
    moments = list(open_session(path).moments())
    assert len(moments) == 6
    for number, moment in enumerate(moments):
        assert np.array_equal(moment.frame.image, making.picture(number))
        assert moment.truth is not None
        np.testing.assert_allclose(moment.truth, [0.1 * number, 2.0, 0.0], atol=1e-9)
