"""Protobuf messages are decoded by the description beside them; bytes that are none raise one error."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from hypothesis import given
from hypothesis import strategies as st

from helpers import bags as making
from maurice_loaders.bags.source import bag_errors, decode, decode_protobuf
from maurice_loaders.errors import InputError
from maurice_loaders.files.text import read_json
from maurice_loaders.formats.registry import open_session


def _description() -> bytes:
    """Two files, the one that is needed last; the message of one holds a message of the other."""
    files = FileDescriptorSet()
    outer = files.file.add(name="outer.proto", package="test", syntax="proto3", dependency=["inner.proto"])
    message = outer.message_type.add(name="Outer")
    kinds = FieldDescriptorProto
    fields = [("name", kinds.TYPE_STRING), ("count", kinds.TYPE_INT64), ("data", kinds.TYPE_BYTES)]
    for number, (name, kind) in enumerate(fields, 1):
        message.field.add(name=name, number=number, type=kind, label=kinds.LABEL_OPTIONAL)
    message.field.add(
        name="inner", number=4, type=kinds.TYPE_MESSAGE, type_name=".test.Inner", label=kinds.LABEL_OPTIONAL
    )
    inner = files.file.add(name="inner.proto", package="test", syntax="proto3").message_type.add(name="Inner")
    inner.field.add(name="x", number=1, type=kinds.TYPE_DOUBLE, label=kinds.LABEL_OPTIONAL)
    return files.SerializeToString()


DESCRIPTION = _description()


def test_fields_are_read_by_their_names() -> None:
    found = decode_protobuf(
        b"\x0a\x05caf\xc3\xa9\x10\xfb\xff\xff\xff\xff\xff\xff\xff\xff\x01\x1a\x02\x00\xff"
        b"\x22\x09\x09\x00\x00\x00\x00\x00\x00\x04@\x9a\x06\x01x",  # the last of a later version
        "test.Outer",
        DESCRIPTION,
    )
    assert (found.name, found.count, found.data, found.inner.x) == ("café", -5, b"\x00\xff", 2.5)


@given(st.binary(max_size=200), st.sampled_from(["json", "cdr", "ros1", "protobuf"]))
def test_any_bytes_are_a_message_or_one_error(data: bytes, encoding: str) -> None:
    kind = "test.Outer" if encoding == "protobuf" else "nav_msgs/Odometry"
    for message, definition in ((data, DESCRIPTION if encoding == "protobuf" else b""), (b"", data)):
        with suppress(InputError), bag_errors(Path("x")):
            decode(message, encoding, kind, definition, "")


@pytest.mark.parametrize("kind", ["test.Other", ""])
def test_types_that_are_not_described_are_one_error(kind: str) -> None:
    with pytest.raises(InputError), bag_errors(Path("x")):
        decode_protobuf(b"", kind, DESCRIPTION)


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


@pytest.mark.parametrize("form", ["ros2msg", "ros1"])
@pytest.mark.parametrize(
    "definition",
    [
        "string[300000000] data",
        "Part[5000] data\n" + "=" * 80 + "\nMSG: std_msgs/Part\n",
        "uint8 a\n" * 40_000,
    ],
    ids=["strings", "parts", "fields"],
)
def test_a_length_that_a_type_announces_takes_neither_memory_nor_time(definition: str, form: str) -> None:
    with peak_memory() as peak, pytest.raises(ValueError, match=r"expected \S+ or less"):
        decode(bytes(100), "ros1" if form == "ros1" else "cdr", "std_msgs/msg/X", definition.encode(), form)
    assert peak() < 20_000_000


@pytest.mark.parametrize("text", ["[" + "{}," * 5_000_000 + "{}]", "[" * 5_000_000], ids=["wide", "deep"])
def test_json_of_very_many_values_is_not_read(text: str) -> None:
    with peak_memory() as peak, pytest.raises(ValueError, match="more than 4,000,000 values"):
        read_json(text)
    assert peak() < 20_000_000


@contextmanager
def peak_memory() -> Iterator[Callable[[], int]]:
    """Return how many bytes Python took at the most since then."""
    tracemalloc.start()
    try:
        yield lambda: tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
