"""TUM, OpenLORIS, EuRoC and KITTI as other programs write them: every folder opens with its counts."""

from __future__ import annotations

import math
import os
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.dialect_files import BEGIN_NS, COUNTS, QUARTER, STAMPS, counts, image, poses, write
from helpers.recordings import odometry, read, truths
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Picture, TruthPose
from maurice_loaders.reading.time_alignment import clock_s

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
        poses(";").replace(".", ","),
        poses(" ").replace(".", ","),
        "timestamp;tx;ty;tz;qx;qy;qz;qw\n" + poses(";").replace(".", ","),
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


def test_seven_numbers_a_line_are_poses_that_lack_one(tmp_path: Path) -> None:
    rows = "\n".join(" ".join(line.split()[:7]) for line in poses().splitlines())
    with pytest.raises(
        InputError, match=r"t.txt:1: found 7 values .*expected 8 or more: t x y z qx qy qz qw"
    ):
        open_session(write(tmp_path / "t.txt", rows + "\n"))


def test_poses_that_failed_are_problems_also_the_first(tmp_path: Path) -> None:
    file = write(tmp_path / "t.txt", f"{STAMPS[0]}" + " nan" * 7 + "\n" + poses())
    recording, notes = open_recording(file), ReadingNotes(keep_going=True)
    assert sum(isinstance(record, TruthPose) for record in recording.records(notes)) == 3
    assert [str(problem) for problem in notes.problems] == [
        f"{file}:1: found value 'nan', expected a finite number"
    ]
    with pytest.raises(InputError, match=r"t.txt:1: found value 'nan'"):
        read(file)


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


PLAIN = {"header": True, "comment": "#", "end": "\n", "tail": "", "before": "", "separator": ",", "bits": 8}
PLAIN |= {"truth": "state_groundtruth_estimate0", "quaternion": "1,0,0,0"}


def euroc(folder: Path, **dialect: Any) -> Path:
    header, comment, end, tail, before, separator, bits, truth, quaternion = (PLAIN | dialect).values()
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
    folder = euroc(tmp_path, **dialect)
    assert counts(folder) == COUNTS
    assert counts(folder / "mav0") == COUNTS
    pictures = [one.read() for one in read(folder)[0] if isinstance(one, Picture)]
    assert {int(one.max()) for one in pictures} == {100}  # 16 bits are brought to 8


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


def test_an_extract_of_kitti_has_its_poses_inside_and_a_table_says_more(tmp_path: Path) -> None:
    folder = tmp_path / "extract"
    for k in range(3):
        image(folder / "image_l" / f"{k:06d}.png")
    write(folder / "poses.txt", "\n".join(f"1 0 0 {k} 0 1 0 0 0 0 1 {2 * k}" for k in range(3)))
    assert guess(folder).name == "kitti"
    np.testing.assert_allclose(truths(folder)[:, :2], [[2 * k, -k] for k in range(3)])
    write(folder / "poses.csv", "image,x_m,y_m,heading_rad", "image_l/000000.png,1,2,0")
    assert guess(folder).name == "table"


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


DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs"


real = pytest.mark.skipif(not DATA.is_dir(), reason="no recorded data here (MAURICE_DATA)")


def test_headings_are_the_robots_yaw_or_the_cameras_optical_axis(tmp_path: Path) -> None:
    """z forward, x right, y down: the rotation that looks along +y of the world."""
    turned = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
    w = math.sqrt(1 + np.trace(turned)) / 2
    x, y, z = ((turned[2, 1] - turned[1, 2]), (turned[0, 2] - turned[2, 0]), (turned[1, 0] - turned[0, 1]))
    file = write(tmp_path / "t.txt", f"0 1 2 3 {x / (4 * w)} {y / (4 * w)} {z / (4 * w)} {w}")
    np.testing.assert_allclose(truths(file), [[1, 2, math.pi / 2]])
    sin, cos = math.sin(math.radians(20)), math.cos(math.radians(20))
    file = write(tmp_path / "t.txt", *(f"{k} 1 2 3 0 0 {sin} {cos}" for k in range(3)))
    np.testing.assert_allclose(truths(file), [[1, 2, math.radians(40)]] * 3)
    found, warnings = read(write(tmp_path / "t.txt", "0 0 0 0 0 0 0 1", f"1 0 0 0 0 {sin} 0 {cos}"))
    assert [type(one).__name__ for one in found] == ["TruthPose", "Note", "TruthPose"]
    assert "tilted by up to 20 degrees" in warnings[0]  # from the mean of both


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("2 1 2 3 0 0 0", "found 7 values"),
        ("2 1 2 3 0 0 0 0", "a quaternion of length 0"),
        ("2 1 nan 3 0 0 0 1", "found value 'nan', expected a finite number"),
        ("1 1 2 3 0 0 0 1", r"found t 1 after t 1\.5"),
        ("1.4999999999999998 1 2 3 0 0 0 1", r"found t 1\.4999999999999998 after t 1\.5,"),
        ("x 1 2 3 0 0 0 1", "found time 'x'"),
        ("2 1 2 3 0 0 0 1\0", "binary data"),
    ],
)
def test_a_broken_row_is_named_by_its_line(line: str, told: str, tmp_path: Path) -> None:
    file = write(tmp_path / "t.txt", "# poses", "1.0 1 2 3 0 0 0 1", "1.5 1 2 3 0 0 0 1", line)
    with pytest.raises(InputError, match=rf"t\.txt:4: .*{told}"):
        read(file, Reading(format="tum-trajectory"))


def test_kitti_lies_on_its_side_and_poses_end_early_is_said(tmp_path: Path) -> None:
    """One metre ahead (z), then to the left (-x) with a quarter turn to the left."""
    left = "0 0 -1 -2  0 1 0 0  1 0 0 1"
    file = write(tmp_path / "00.txt", "1 0 0 0 0 1 0 0 0 0 1 0", "1 0 0 0 0 1 0 0 0 0 1 1", left)
    np.testing.assert_allclose(truths(file), [[0, 0, 0], [1, 0, 0], [1, 2, math.pi / 2]], atol=1e-12)
    write(tmp_path / "sequences" / "03" / "times.txt", "0", "0.1", "0.2")
    image(tmp_path / "sequences" / "03" / "image_2" / "000000.png")
    write(tmp_path / "poses" / "03.txt", "1 0 0 0 0 1 0 0 0 0 1 0", "1 0 0 0 0 1 0 0 0 0 1 1")
    found, warnings = read(tmp_path / "sequences" / "03")
    assert Counter(type(r).__name__ for r in found) == {"Picture": 3, "TruthPose": 2}
    assert "2 poses for 3 times" in warnings[0]
    assert len(truths(tmp_path / "sequences" / "03", Reading(truth_offset_s=0.05))) == 2
    write(tmp_path / "04" / "times.txt", "0", "0.1")
    for number in range(3):
        image(tmp_path / "04" / "image_2" / f"{number:06}.png")
    found, warnings = read(tmp_path / "04")
    assert len(found) == 2
    assert any("2 times, and more pictures" in text for text in warnings)


def test_euroc_columns_go_by_their_names(tmp_path: Path) -> None:
    half = math.radians(30) / 2
    header = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []"
    row = f"1000000000,1,2,3,{math.cos(half)},0,0,{math.sin(half)},9,9,9"
    write(tmp_path / "mav0" / "state_groundtruth_estimate0" / "data.csv", header, row)
    write(
        tmp_path / "mav0" / "odom" / "data.csv",
        "timestamp [ns],x [m],y [m],z [m],x,y,z,w",
        f"1000000000,1,2,3,0,0,{math.sin(half)},{math.cos(half)}",
    )
    write(
        tmp_path / "mav0" / "imu0" / "data.csv",
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y,w_RS_S_z",
        "1,2,3,4",
    )
    np.testing.assert_allclose(truths(tmp_path), [[1, 2, math.radians(30)]])
    np.testing.assert_allclose(odometry(tmp_path), [[1, 2, math.radians(30)]])


def test_another_camera_by_name(tmp_path: Path) -> None:
    for name, value in (("cam0", 10), ("cam1", 200)):
        write(tmp_path / name / "data.csv", "#timestamp [ns],filename", "1000000000,a.png")
        image(tmp_path / name / "data" / "a.png", value)
    found, warnings = read(tmp_path)
    assert [int(r.read()[0, 0, 0]) for r in found if isinstance(r, Picture)] == [10]
    assert "cam1 is not" in warnings[0]
    found, _ = read(tmp_path, Reading(camera="cam1"))
    assert [int(r.read()[0, 0, 0]) for r in found if isinstance(r, Picture)] == [200]
    with pytest.raises(InputError, match="found cameras cam0, cam1, expected 'cam9'"):
        read(tmp_path, Reading(camera="cam9"))


@real
def test_openloris_counts_and_frames() -> None:
    found, warnings = read(DATA / "openloris_txt")
    assert Counter(type(r).__name__ for r in found) == {"Picture": 4, "OdometryPose": 3, "TruthPose": 6}
    assert warnings == ()
    session = open_session(DATA / "openloris_txt")
    assert session.overview() == (4, True)
    assert session.info.cameras[0].width_px == 848
    assert next(session.moments()).frame.image.shape == (480, 848, 3)


@real
def test_asl_counts_and_clocks_that_disagree() -> None:
    path = DATA / "asl_csv" / "expected_output"
    found, warnings = read(path)
    assert Counter(type(r).__name__ for r in found) == {"Picture": 11, "OdometryPose": 3453}
    assert "clocks disagree" in warnings[0]
    offset = float(warnings[0].rsplit("truth_offset_s=", 1)[1])
    assert offset == pytest.approx(1403636601.1135554 - 81.605, abs=1e-3)
    found, _ = read(path, Reading(truth_offset_s=offset))
    assert sum(isinstance(r, TruthPose) for r in found) == 490
    assert open_session(path).overview() == (11, False)
