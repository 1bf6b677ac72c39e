"""TUM, OpenLORIS, EuRoC and KITTI as other programs write them: every folder opens with its counts."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from helpers.dialect_files import BEGIN_NS, COUNTS, QUARTER, STAMPS, counts, image, poses, read, write
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import guess, open_recording
from maurice_loaders.recording import Picture, TruthPose
from maurice_loaders.time_alignment import clock_s

# TUM

TUM_LISTS = {
    "commented": "# color images\n# timestamp filename\n{}",
    "header without #": "timestamp filename\n{}",
    "windows": "\ufeff{}",
}


@pytest.mark.parametrize("between", [" ", "\t", "   ", ",", ", "])
@pytest.mark.parametrize("head", TUM_LISTS)
def test_tum_lists_of_pictures(head: str, between: str, tmp_path: Path) -> None:
    rows = "\n".join(f"{t}{between}rgb/{t}.png" for t in STAMPS) + "\n"
    end = "\r\n" if head == "windows" else "\n"
    write(tmp_path / "rgb.txt", TUM_LISTS[head].format(rows).replace("\n", end))
    write(tmp_path / "groundtruth.txt", poses(",") if between == "," else poses())
    for t in STAMPS:
        image(tmp_path / "rgb" / f"{t}.png")
    assert counts(tmp_path) == COUNTS


@pytest.mark.parametrize(
    "text",
    [
        poses(),
        "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n" + poses(),
        "timestamp tx ty tz qx qy qz qw\n" + poses(),
        poses("\t"),
        poses("  ").replace("\n", " \n"),
        poses(","),
        poses(stamp="{:.18e}"),
        "\ufeff" + poses().replace("\n", "\r\n"),
        "timestamp,tx,ty,tz,qx,qy,qz,qw\n" + poses(","),
        "#timestamp, tx, ty, tz, qx, qy, qz, qw\n" + poses(", "),
        "#timestamp [ns], x, y, z, qx, qy, qz, qw, vx\n"
        + "".join(f"{BEGIN_NS + k * 10**8},{0.1 * k},2,0,0,0,{QUARTER},{QUARTER},0\n" for k in range(3)),
        "%time,field.pose.position.x,field.pose.position.y,field.pose.position.z,field.pose.orientation.x,"
        "field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w\n"
        + "".join(f"{BEGIN_NS + k * 10**8},{0.1 * k},2,0,0,0,{QUARTER},{QUARTER}\n" for k in range(3)),
        "timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n"
        + "".join(f"{BEGIN_NS + k * 10**8},{0.1 * k},2,0,{QUARTER},0,0,{QUARTER}\n" for k in range(3)),
    ],
)
def test_trajectories_alone(text: str, tmp_path: Path) -> None:
    found, _ = read(write(tmp_path / "path.csv", text))
    assert guess(tmp_path / "path.csv").name == "tum-trajectory"
    got = np.array([one.pose for one in found if isinstance(one, TruthPose)])
    np.testing.assert_allclose(got, [[0.1 * k, 2, math.pi / 2] for k in range(3)], atol=1e-6)
    assert found[2].t_s - found[0].t_s == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize("pair", ["{0} rgb/{0}.png {0} depth/{0}.png", "{0} depth/{0}.png {0} rgb/{0}.png"])
def test_a_list_of_pairs_of_color_and_depth(pair: str, tmp_path: Path) -> None:
    write(tmp_path / "associations.txt", "\n".join(pair.format(t) for t in STAMPS))
    write(tmp_path / "groundtruth.txt", poses())
    for t in STAMPS:
        image(tmp_path / "rgb" / f"{t}.png")
    assert counts(tmp_path) == COUNTS


# OpenLORIS


@pytest.mark.parametrize("name", ["color", "fisheye1", "t265_fisheye1", "d400_color"])
@pytest.mark.parametrize("truth", ["groundtruth.txt", "groundtruth"])
def test_openloris_names(name: str, truth: str, tmp_path: Path) -> None:
    write(tmp_path / f"{name}.txt", "#Time Path\n" + "\n".join(f"{t} {name}/{t}.png" for t in STAMPS))
    write(tmp_path / truth, "#Time px py pz qx qy qz qw\n" + poses())
    write(tmp_path / "odom.txt", "#Time px py pz qx qy qz qw vx vy vz\n" + poses().replace("\n", " 0 0 0\n"))
    for t in STAMPS:
        image(tmp_path / name / f"{t}.png")
    assert counts(tmp_path) == COUNTS | {"OdometryPose": 3}
    assert guess(tmp_path).name == "openloris"


# EuRoC

PLACE = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]"
EUROC_POSES = f"{PLACE}, q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"


def euroc(
    folder: Path,
    *,
    header: bool = True,
    comment: str = "#",
    end: str = "\n",
    tail: str = "",
    before: str = "",
    separator: str = ",",
    truth: str = "state_groundtruth_estimate0",
    quaternion: str = "1,0,0,0",
    bits: int = 8,
) -> Path:
    names = {"cam0": f"{comment}timestamp [ns],filename", truth: EUROC_POSES.replace("#", comment)}
    rows = {
        "cam0": [f"{BEGIN_NS + k * 10**8},{BEGIN_NS + k * 10**8}.png{tail}" for k in range(3)],
        truth: [f"{BEGIN_NS + k * 10**8},{k},2,3,{quaternion}{tail}" for k in range(3)],
    }
    for name in rows:
        text = end.join([names[name]] * header + rows[name]) + end
        write(folder / "mav0" / name / "data.csv", before + text.replace(",", separator))
    for k in range(3):
        image(folder / "mav0" / "cam0" / "data" / f"{BEGIN_NS + k * 10**8}.png", bits=bits)
    return folder


@pytest.mark.parametrize(
    "dialect",
    [
        {},
        {"comment": ""},
        {"header": False},
        {"end": "\r\n", "before": "\ufeff"},
        {"tail": ","},
        {"tail": ",5,7"},
        {"separator": ", "},
        {"separator": ";"},
        {"truth": "mocap0", "bits": 16},  # TUM-VI's export
        {"truth": "vicon0"},
    ],
    ids=str,
)
def test_euroc_dialects(dialect: dict[str, object], tmp_path: Path) -> None:
    folder = euroc(tmp_path, **dialect)  # type: ignore[arg-type]  # each by its name
    assert counts(folder) == COUNTS
    assert counts(folder / "mav0") == COUNTS


def test_16_bits_are_brought_to_8(tmp_path: Path) -> None:
    found, _ = read(euroc(tmp_path, bits=16))
    assert {int(one.read().max()) for one in found if isinstance(one, Picture)} == {100}


def test_a_trackers_positions_are_no_poses_and_it_is_said(tmp_path: Path) -> None:
    euroc(tmp_path)
    (tmp_path / "mav0" / "state_groundtruth_estimate0").rename(tmp_path / "mav0" / "leica0")
    write(tmp_path / "mav0" / "leica0" / "data.csv", f"{PLACE}\n{BEGIN_NS},1,2,3\n")
    assert counts(tmp_path) == {"Picture": 3}
    assert any("leica0 holds positions without orientation" in text for text in read(tmp_path)[1])


SENSOR = """# General sensor definitions.
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [{}]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
"""
FLYING = f"{QUARTER},0,{-QUARTER},0"  # body x up


def looking(direction: list[float]) -> str:
    """T_BS of a camera at the body's middle whose optical axis points so on the body; rows over lines."""
    matrix = np.eye(4)
    matrix[:3, 2] = direction
    return ",\n         ".join(", ".join(f"{v:.10f}" for v in row) for row in matrix)


@pytest.mark.parametrize(
    ("quaternion", "direction", "yaw_deg"),
    [
        ("1,0,0,0", [1, 0, 0], 0),  # a driving robot: z up, x ahead
        ("1,0,0,0", [0, 1, 0], 90),  # its left
        ("1,0,0,0", [0, -1, 0], -90),
        (FLYING, [0.004, 0.026, 0.9997], 0),  # EuRoC's own: x up, z ahead
        (FLYING, [0, -1, 0], 90),  # with x up and z ahead, left is -y
        (FLYING, [0, 1, 0], -90),
    ],
)
def test_where_a_camera_looks_on_the_body(
    quaternion: str, direction: list[float], yaw_deg: float, tmp_path: Path
) -> None:
    euroc(tmp_path, quaternion=quaternion)
    write(tmp_path / "mav0" / "cam0" / "sensor.yaml", SENSOR.format(looking(direction)))
    recording = open_recording(tmp_path)
    (camera,) = recording.info.cameras
    assert (camera.name, camera.width_px, camera.height_px) == ("cam0", 752, 480)
    assert camera.horizontal_fov_rad == pytest.approx(2 * math.atan(376 / 458.654))
    assert math.degrees(camera.yaw_rad) == pytest.approx(yaw_deg, abs=2)
    said = read(tmp_path)[1]
    assert any("cam0 looks" in text for text in said) == (yaw_deg != 0)
    assert any("headings are those of its z axis" in text for text in said) == (quaternion == FLYING)


@pytest.mark.parametrize(
    "text", ["", "T_BS: 3", "resolution: [a, b]\nintrinsics: []", "\0\xff", "T_BS:\n data: [1, 2]"]
)
def test_a_sensor_file_without_sense_leaves_the_camera_unknown(text: str, tmp_path: Path) -> None:
    write(euroc(tmp_path) / "mav0" / "cam0" / "sensor.yaml", text)
    (camera,) = open_recording(tmp_path).info.cameras
    assert (camera.width_px, camera.yaw_rad) == (None, 0.0)


# KITTI

ROWS = "".join(f"1 0 0 0 0 1 0 0 0 0 1 {0.5 * k}\n" for k in range(3))


@pytest.mark.parametrize("camera", ["image_0", "image_2", "image_02/data", "image_00/data"])
@pytest.mark.parametrize("times", ["times.txt", "timestamps.txt", None])
@pytest.mark.parametrize("place", ["../../poses/00.txt", "poses.txt", "00.txt", "poses/00.txt"])
def test_kitti_layouts(camera: str, times: str | None, place: str, tmp_path: Path) -> None:
    sequence = tmp_path / "sequences" / "00"
    for k in range(3):
        image(sequence / camera / (f"{k:010d}.png" if "data" in camera else f"{k:06d}.png"))
    if times:
        write(sequence / times, "".join(f"{0.1 * k:e}\n" for k in range(3)))
    write(sequence / place, ROWS)
    assert counts(sequence) == COUNTS
    assert [one.t_s for one in read(sequence)[0][::2]] == pytest.approx([0, 0.1, 0.2])


def test_a_raw_drive_of_kitti_has_dates(tmp_path: Path) -> None:
    for k in range(2):
        image(tmp_path / "image_02" / "data" / f"{k:010d}.png")
    stamps = "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.064390000\n"
    write(tmp_path / "image_02" / "timestamps.txt", stamps)
    found, _ = read(tmp_path)
    assert found[0].t_s == pytest.approx(1317042145.964389)
    assert found[1].t_s - found[0].t_s == pytest.approx(0.100000555, abs=1e-6)
    assert clock_s("1970-01-01T01:00:00+01:00") == 0
    with pytest.raises(ValueError, match="date and a time"):
        clock_s("12")


def test_the_root_of_kitti_names_a_sequence(tmp_path: Path) -> None:
    image(tmp_path / "sequences" / "00" / "image_2" / "000000.png")
    with pytest.raises(InputError, match=r"did you mean .*sequences.00\?"):
        read(tmp_path)


@pytest.mark.parametrize("text", [ROWS, ROWS.replace(" ", ","), ROWS.replace(" 1 ", " 1.000000e+00 ")])
def test_kitti_poses_alone(text: str, tmp_path: Path) -> None:
    assert counts(write(tmp_path / "00.txt", text)) == {"TruthPose": 3}
