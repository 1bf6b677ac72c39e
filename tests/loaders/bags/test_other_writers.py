"""Bags as other programs leave them: without metadata, packed, of other distributions, with odd topics."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap import reader

from helpers import bags as making
from helpers import expect_facts
from helpers.bags import BEGIN_NS, Ros, Said
from helpers.recordings import counted
from maurice_loaders.bags.containers import open_mcap
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose

DRIVE = {"Picture": 5, "OdometryPose": 10, "TruthPose": 10}


def written(folder: Path, **how: str) -> Path:
    return making.write_ros2(folder / "drive", making.drive(Ros(2)), **how)  # type: ignore[arg-type]  # as named


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
@pytest.mark.parametrize("how", [{}, {"compression": "message"}])
def test_the_one_file_of_a_recording_that_was_not_ended(
    storage: str, how: dict[str, str], tmp_path: Path
) -> None:
    bag = written(tmp_path, storage=storage, **how)
    (bag / "metadata.yaml").unlink()
    assert guess(bag).name == "rosbag2"
    (file,) = bag.iterdir()
    assert counted(bag) == counted(file) == DRIVE
    shutil.copy(file, bag / f"more{file.suffix}")
    with pytest.raises(InputError, match=r"found 2 files .* create it with `ros2 bag reindex drive`"):
        open_recording(bag)
    (bag / "notes.txt").write_text("more than a bag\n")
    with pytest.raises(InputError, match=r"expected one of .*; see --reading format="):
        guess(bag)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_packed_file_alone_is_refused_with_the_command(storage: str, tmp_path: Path) -> None:
    bag = written(tmp_path, storage=storage, compression="file")
    assert counted(bag) == DRIVE
    (packed,) = bag.glob("*.zstd")
    with pytest.raises(InputError, match=rf"decompress it with `zstd -d {packed.name}`"):
        open_recording(packed)


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize("distro", ["ROS2_FOXY", "ROS2_JAZZY", "ROS2_KILTED"])
def test_messages_of_other_distributions(distro: str, version: int, tmp_path: Path) -> None:
    ros = Ros(2, distro)
    bag = making.write_ros2(tmp_path / "drive", making.drive(ros), ros=ros, version=version)  # type: ignore[arg-type]  # 8 or 9
    assert counted(bag) == DRIVE


def test_topics_of_several_types_without_stamps_and_definitions_in_idl(tmp_path: Path) -> None:
    ros, said = Ros(1), []
    for number in range(4):
        t_ns = BEGIN_NS + number * 10**8
        said.append(Said("/x", "nav_msgs/Odometry", t_ns, ros.odometry(t_ns, (0.1 * number, 0, 0))))
        said.append(making.seen(ros, t_ns, number, "/x"))
    assert counted(making.write_ros1(tmp_path / "a.bag", said)) == {"OdometryPose": 4, "Picture": 4}
    said = making.drive(Ros(1))
    for one in said:
        if "camera" in one.topic:
            one.message.header.stamp.sec = one.message.header.stamp.nanosec = 0
    assert counted(making.write_ros1(tmp_path / "b.bag", said)) == DRIVE
    kind = "geometry_msgs/msg/Pose2D"
    idl = "module geometry_msgs { module msg { struct Pose2D { double x; double y; double theta; }; }; };"
    said = [
        Said("/odom", kind, BEGIN_NS + i, b"\x00\x01\x00\x00" + struct.pack("<3d", i, 0, 0)) for i in range(3)
    ]
    path = making.write_json_mcap(
        tmp_path / "a.mcap",
        said,
        encoding="cdr",
        schema_encoding="ros2idl",
        schemas={kind: f"{'=' * 80}\nIDL: {kind}\n{idl}\n"},
    )
    assert counted(path) == {"OdometryPose": 3}


def test_an_empty_bag_says_that_it_holds_nothing(tmp_path: Path) -> None:
    for path in (
        making.write_ros1(tmp_path / "a.bag", []),
        making.write_ros2(tmp_path / "b", []),
        making.write_ros2(tmp_path / "c", [], storage="mcap"),
    ):
        with pytest.raises(InputError, match="it holds no topic at all"):
            open_recording(path)


@pytest.mark.parametrize("option", [{"time_unit": "ns"}, {"table": Path("p.csv")}, {"columns": {"x": "px"}}])
def test_options_of_tables_are_refused(option: dict[str, Any], tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "a.bag", making.drive(Ros(1)))
    with pytest.raises(InputError, match=r"found --reading (time_unit|table|columns)=.*this is a bag"):
        open_recording(path, Reading(**option))


def _protobuf_drive(path: Path, **how: object) -> Path:
    """A drive in Foxglove's own types, by Foxglove's own writer."""
    foxglove = pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    from foxglove import channels, messages
    from foxglove.mcap import MCAPWriteOptions

    context = foxglove.Context()
    with foxglove.open_mcap(str(path), writer_options=MCAPWriteOptions(**how), context=context):
        images = channels.RawImageChannel("/image", context=context)
        links = channels.FrameTransformChannel("/tf", context=context)
        for number in range(6):
            t_ns = BEGIN_NS + number * 10**8
            stamp = messages.Timestamp(sec=t_ns // 10**9, nsec=t_ns % 10**9)
            data = making.picture(number).tobytes()
            size = {"width": 16, "height": 12, "step": 48}
            images.log(messages.RawImage(timestamp=stamp, encoding="rgb8", data=data, **size), log_time=t_ns)
            named = {"timestamp": stamp, "parent_frame_id": "odom", "child_frame_id": "base_link"}
            moved = messages.Vector3(x=0.1 * number, y=0, z=0)
            level = messages.Quaternion(x=0, y=0, z=0, w=1)
            link = messages.FrameTransform(translation=moved, rotation=level, **named)
            links.log(link, log_time=t_ns)
    return path


NOTHING_MORE = ("emit_statistics", "emit_chunk_indexes", "emit_message_indexes", "repeat_channels")
WAYS: dict[str, dict[str, object]] = {
    "not packed": {"compression": None},
    "many chunks": {"chunk_size": 1},
    "no chunks": {"use_chunks": False},
    "no statistics": {"emit_statistics": False},
    "no index": dict.fromkeys((*NOTHING_MORE, "repeat_schemas"), False),
}


@pytest.mark.parametrize("way", WAYS)
def test_foxgloves_own_writer(way: str, tmp_path: Path) -> None:
    path = _protobuf_drive(tmp_path / "a.mcap", **WAYS[way])
    assert counted(path) == {"Picture": 6, "OdometryPose": 6}


def test_chunks_without_a_wanted_topic_are_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _protobuf_drive(tmp_path / "a.mcap", chunk_size=1)
    unpacked = []
    breakup = reader.breakup_chunk
    monkeypatch.setattr(reader, "breakup_chunk", lambda *a, **k: unpacked.append(1) or breakup(*a, **k))
    with open_mcap(path) as bag:
        assert len(list(bag.messages({"/image"}))) == 6
    assert len(unpacked) <= 7  # of 11 or 12


def _looking(tmp_path: Path, frame: str, x: float, y: float, z: float, w: float) -> Path:
    """A bag whose camera's frame stands on a mount with this quaternion; the mount is turned 0.5 rad left."""
    ros = Ros(2)
    image = ros.compressed(BEGIN_NS, making.picture(0))
    image.header.frame_id = frame
    rotation = ros.new("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)
    links = [
        ros.transforms(0, "base_link", "mount", (0.1, 0.0, 0.5)),
        ros.transforms(0, "mount", frame, (0.0, 0.0, 0.0), rotation),
    ]
    said = [Said("/tf_static", "tf2_msgs/TFMessage", BEGIN_NS, link) for link in links]
    said.append(Said("/camera/image/compressed", "sensor_msgs/CompressedImage", BEGIN_NS, image))
    return making.write_ros2(tmp_path / "bag", said)


OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # z forward, x right, y down (REP-103)


@pytest.mark.parametrize(
    ("frame", "rotation"), [("camera_optical_frame", OPTICAL), ("eye", OPTICAL), ("camera", (0, 0, 0, 1))]
)
def test_the_camera_looks_where_static_transforms_say(
    frame: str, rotation: tuple[float, float, float, float], tmp_path: Path
) -> None:
    info = open_recording(_looking(tmp_path, frame, *rotation)).info
    assert info.cameras[0].yaw_rad == pytest.approx(0.5)
    expect_facts(info.notes[0], "28.6 deg", f"base_link to {frame}")


def test_cameras_that_look_at_the_floor_or_move_have_no_yaw(tmp_path: Path) -> None:
    down = (1.0, 0.0, 0.0, 0.0)  # of an optical frame: z points down
    info = open_recording(_looking(tmp_path, "floor_optical_frame", *down)).info
    assert info.cameras == ()
    assert "yaw" not in info.notes[0]
    ros = Ros(2)
    said = [making.link(ros, BEGIN_NS, "base_link", "camera", (0, 0, 0.5)), making.seen(ros, BEGIN_NS)]
    assert open_recording(making.write_ros2(tmp_path / "moving", said)).info.cameras == ()


def test_odometry_from_transforms_alone(tmp_path: Path) -> None:
    ros = Ros(2)
    said = [making.link(ros, BEGIN_NS, "base_link", "lidar", (0, 0, 0), "/tf_static")]
    for number in range(6):
        t_ns = BEGIN_NS + number * 10**8
        for names in (("base_link", "wheel"), ("odom", "base_link"), ("map", "odom")):
            said.append(making.link(ros, t_ns, *names, (0.1 * number, 0.0, 0.0)))
        said.append(making.seen(ros, t_ns, number))
    path = making.write_ros2(tmp_path / "bag", said)
    records = open_recording(path).records(ReadingNotes(keep_going=False))
    poses = [record.pose for record in records if isinstance(record, OdometryPose)]
    np.testing.assert_allclose(np.array(poses)[:, 0], 0.1 * np.arange(6), atol=1e-9)
