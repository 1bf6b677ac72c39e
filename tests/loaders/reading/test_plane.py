"""Recordings whose poses are in a camera's frame: the plane is found, said, and can be chosen."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.format_samples import SAMPLES, sample
from helpers.recordings import odometry, read, truths
from maurice_loaders.bags.recording import BagRecording
from maurice_loaders.doctor.inspection import inspect_recording
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.plane import plane_of
from maurice_loaders.reading.recording import OdometryPose, TruthPose
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.values.arrays import F64
from maurice_viz.app.inspect import doctor

STEPS = 120
BEGIN_S = 1_700_000_000.0
# position, forward and up of a body that is at u, v in its plane, w above it, and looks along (cos, sin)
WORLDS = {
    "camera": ("xz", lambda u, v, w: (u, -w, v)),  # y down
    "y up": ("xz", lambda u, v, w: (u, w, -v)),
    "x up": ("yz", lambda u, v, w: (w, u, v)),
    "robot": ("xy", lambda u, v, w: (u, v, w)),
}


def drive(steps: int = STEPS) -> F64:
    """Two rounds of an ellipse, 20 x 8 m: x, y, heading."""
    angle = np.linspace(0, 4 * math.pi, steps)
    x, y = 20 * np.cos(angle), 8 * np.sin(angle)
    return np.column_stack([x, y, np.arctan2(8 * np.cos(angle), -20 * np.sin(angle))])


def in_space(world: str, poses: F64, body: str = "robot", bumps: float = 0.3) -> list[tuple[F64, F64]]:
    """Return positions and rotations of a robot (x ahead, z up) or a camera (z ahead, y down)."""
    put = WORLDS[world][1]
    found = []
    for number, (x, y, heading) in enumerate(poses):
        ahead = np.array(put(math.cos(heading), math.sin(heading), 0.0))
        up = np.array(put(0.0, 0.0, 1.0))
        left = np.cross(up, ahead)
        axes = (ahead, left, up) if body == "robot" else (-left, -up, ahead)
        found.append((np.array(put(x, y, bumps * math.sin(number))), np.column_stack(axes)))
    return found


@pytest.mark.parametrize("kind", ["tum", "bag"])
def test_motion_that_leaves_the_plane_is_told_and_named(kind: str, tmp_path: Path) -> None:
    """Pitch and roll out of the plane: a line, events where it begins and ends, and a finding."""
    rng = np.random.default_rng(0)
    placed = in_space("robot", drive(), bumps=0.0)
    tilt = np.radians(25) * np.sin(np.linspace(0, 6 * np.pi, len(placed)))
    tilted = [
        (place, turned @ Rotation.from_euler("xy", [0.3 * t, t]).as_matrix())
        for (place, turned), t in zip(placed, tilt, strict=True)
    ]
    for poses, leaves in ((placed, False), (tilted, True)):
        noisy = [(p, r @ Rotation.from_rotvec(rng.normal(0, 0.01, 3)).as_matrix()) for p, r in poses]
        folder = tmp_path / str(leaves)
        folder.mkdir()
        path = WRITERS[kind](folder, noisy)
        session = RecordedSession(open_recording(path))
        found = inspect_recording(session)
        told = [text for text in found.warnings if "leaves the plane" in text]
        assert bool(told) == leaves
        assert any(text.startswith("tilted") for text in found.events) == leaves
        assert ("out-of-plane" in [one.code for one in doctor(path).findings]) == leaves


def quaternion(turned: F64) -> F64:
    """Return x, y, z, w."""
    return np.asarray(Rotation.from_matrix(turned).as_quat())


def tum(folder: Path, poses: list[tuple[F64, F64]], name: str = "path.txt") -> Path:
    rows = [
        " ".join(f"{v:.9f}" for v in (BEGIN_S + 0.1 * k, *at, *quaternion(turned)))
        for k, (at, turned) in enumerate(poses)
    ]
    file = folder / name
    file.write_text("\n".join(rows) + "\n")
    return file


def euroc(folder: Path, poses: list[tuple[F64, F64]]) -> Path:
    file = folder / "mav0" / "groundtruth" / "data.csv"
    file.parent.mkdir(parents=True)
    head = "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w [], q_x [], q_y [], q_z []\n"
    rows = []
    for k, (at, turned) in enumerate(poses):
        x, y, z, w = quaternion(turned)
        rows.append(f"{int(BEGIN_S) * 10**9 + k * 10**8}," + ",".join(f"{v:.9f}" for v in (*at, w, x, y, z)))
    file.write_text(head + "\n".join(rows) + "\n")
    return folder


def bag(folder: Path, poses: list[tuple[F64, F64]]) -> Path:
    """The poses as truth, and the drive in x-y as odometry."""
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    from helpers.bags import Ros, Said, write_ros2

    ros, said = Ros(2), []
    for k, ((at, turned), pose) in enumerate(zip(poses, drive(len(poses)), strict=True)):
        t_ns = int(BEGIN_S) * 10**9 + k * 10**8
        x, y, z, w = map(float, quaternion(turned))
        placed = ros.new(
            "geometry_msgs/Pose",
            position=ros.new("geometry_msgs/Point", x=float(at[0]), y=float(at[1]), z=float(at[2])),
            orientation=ros.new("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w),
        )
        stamped = ros.new("geometry_msgs/PoseStamped", header=ros.header(t_ns), pose=placed)
        said.append(Said("/ground_truth", "geometry_msgs/PoseStamped", t_ns, stamped))
        said.append(Said("/odom", "nav_msgs/Odometry", t_ns, ros.odometry(t_ns, [float(v) for v in pose])))
    return write_ros2(folder / "bag", said)


WRITERS = {"tum": tum, "euroc": euroc, "bag": bag}


def way(poses: F64) -> float:
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("body", ["robot", "camera"])
@pytest.mark.parametrize("world", ["camera", "y up", "x up"])
def test_the_plane_of_the_motion_is_found_and_said(
    world: str, body: str, writer: str, tmp_path: Path
) -> None:
    if (world, body) in (("y up", "camera"), ("x up", "camera")) and writer == "euroc":
        pytest.skip("the same as tum")
    path = WRITERS[writer](tmp_path, in_space(world, drive(), body))
    got, wanted = truths(path), drive()
    np.testing.assert_allclose(got[:, :2], wanted[:, :2], atol=1e-6)
    np.testing.assert_allclose(np.cos(got[:, 2] - wanted[:, 2]), 1, atol=1e-9)
    assert way(got) == pytest.approx(way(wanted), rel=1e-9)
    name = WORLDS[world][0]
    [text] = [one for one in read(path)[1] if "the motion lies" in one]
    assert f"{name[0]} and {name[1]}" in text
    inspected = inspect_recording(RecordedSession(open_recording(path)))
    assert text in inspected.warnings
    assert inspected.distance_truth_m == pytest.approx(way(wanted), rel=1e-9)
    assert text in doctor(path).remarks
    if writer == "bag":
        np.testing.assert_allclose(odometry(path), wanted, atol=1e-9)
    asked = Reading(plane=name)
    np.testing.assert_array_equal(truths(path, asked), got)
    assert not any("the motion lies" in one for one in read(path, asked)[1])
    assert way(truths(path, Reading(plane="xy"))) < 0.95 * way(wanted)


@pytest.mark.parametrize(("plane", "quarters"), [("zx", 1), ("auto", None)])
def test_a_frame_with_y_up_whose_bodies_have_y_up_is_not_mirrored_if_said(
    plane: str, quarters: int | None, tmp_path: Path
) -> None:
    robots = in_space("y up", drive())
    with_y_up = [(at, np.column_stack([turned[:, 1], turned[:, 2], turned[:, 0]])) for at, turned in robots]
    path = tum(tmp_path, with_y_up)
    got, wanted = truths(path, Reading(plane=plane)), drive()
    turning = np.sign(np.median(np.diff(np.unwrap(got[:, 2]))))
    if quarters is None:  # the poses of a camera in its own frame are the same: y is taken to point down
        [text] = [one for one in read(path)[1] if "the motion lies" in one]
        assert "y is taken to point down" in text
        assert "--reading plane=zx if it points up" in text
        assert turning == -1
        return
    np.testing.assert_allclose(got[:, :2], np.column_stack([-wanted[:, 1], wanted[:, 0]]), atol=1e-6)
    np.testing.assert_allclose(np.cos(got[:, 2] - wanted[:, 2] - quarters * np.pi / 2), 1, atol=1e-9)
    assert turning == 1


@pytest.mark.parametrize("body", ["robot", "camera"])
@pytest.mark.parametrize(("world", "name"), [("y up", "zx"), ("camera", "xz"), ("x up", "yz")])
def test_a_named_side_agrees_with_what_the_bodies_show(
    world: str, name: str, body: str, tmp_path: Path
) -> None:
    path = tum(tmp_path, in_space(world, drive(), body))
    found, named = truths(path), truths(path, Reading(plane=name))
    apart = np.hypot(*(found[:, None, :2] - found[None, :, :2]).T)
    np.testing.assert_allclose(apart, np.hypot(*(named[:, None, :2] - named[None, :, :2]).T), atol=1e-6)
    np.testing.assert_allclose(np.diff(np.unwrap(found[:, 2])), np.diff(np.unwrap(named[:, 2])), atol=1e-9)


def test_odometry_in_a_camera_s_frame_follows(tmp_path: Path) -> None:
    (tmp_path / "rgb.txt").write_text(f"{BEGIN_S:.1f} a.png\n")
    tum(tmp_path, in_space("camera", drive(), "camera"), "odometry.txt")
    tum(tmp_path, in_space("robot", drive()), "groundtruth.txt")
    np.testing.assert_allclose(odometry(tmp_path)[:, :2], drive()[:, :2], atol=1e-6)
    np.testing.assert_allclose(truths(tmp_path)[:, :2], drive()[:, :2], atol=1e-6)


@pytest.mark.parametrize("bumps", [0.0, 0.01, 0.3, 2.0])
@pytest.mark.parametrize("body", ["robot", "camera"])
def test_a_motion_in_x_y_is_read_as_ever(body: str, bumps: float, tmp_path: Path) -> None:
    path = tum(tmp_path, in_space("robot", drive(), body, bumps))
    found, warnings = read(path)
    assert not any("the motion lies" in text for text in warnings)
    np.testing.assert_array_equal(truths(path), truths(path, Reading(plane="xy")))
    assert len(found) == STEPS


@pytest.mark.parametrize("kind", SAMPLES)
def test_every_format_is_read_as_ever(kind: str, tmp_path: Path) -> None:
    path = sample(kind, tmp_path, 60)
    found, warnings = read(path)
    assert not any("the motion lies" in text for text in warnings)
    flat, _ = read(path, Reading(plane="xy"))
    assert [type(one) for one in found] == [type(one) for one in flat]
    for one, other in zip(found, flat, strict=True):
        assert one.t_s == other.t_s
        if isinstance(one, OdometryPose | TruthPose) and isinstance(other, OdometryPose | TruthPose):
            np.testing.assert_array_equal(one.pose, other.pose)


def test_a_doubtful_plane_changes_nothing() -> None:
    def auto(poses: list[tuple[F64, F64]]) -> tuple[str, str]:
        plane = plane_of(poses, None)
        return plane.name, plane.remark

    assert auto(in_space("camera", drive(19), "camera")) == ("xy", "")  # few
    straight = np.column_stack([np.linspace(0, 30, 200), np.zeros(200), np.zeros(200)])
    assert auto(in_space("camera", straight, "camera")) == ("xy", "")
    uphill = [(np.array([*at[:2], 0.3 * at[0]]), turned) for at, turned in in_space("robot", straight)]
    assert auto(uphill) == ("xy", "")
    still = [(at, np.eye(3)) for at, _ in in_space("camera", drive(), "camera")]
    name, remark = auto(still)
    assert name == "xy"
    assert "--reading plane=xz reads x and z" in remark
    random = np.random.default_rng(3)
    shaken = [(random.normal(0, [5, 1, 5]), turned) for _, turned in in_space("robot", drive())]
    assert auto(shaken)[0] == "xy"  # z is up on the body, whatever the positions say


def test_formats_in_the_plane_refuse_another(tmp_path: Path, small_session: Path) -> None:
    with pytest.raises(InputError, match=r"plane=xz.* session-log"):
        open_recording(small_session, Reading(plane="xz"))
    assert open_recording(small_session, Reading(plane="auto"))


def test_a_flat_bag_is_not_read_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bag(tmp_path, in_space("robot", drive(), bumps=0.0))
    recording = open_recording(path, Reading(plane="xy"))
    assert isinstance(recording, BagRecording)
    assert recording.chosen.truth is not None
    monkeypatch.setattr(recording, "open_bag", None)
    assert recording.plane(recording.chosen.truth).name == "xy"
