"""What each text and folder format means: frames, columns, clocks; and real files of other writers."""

from __future__ import annotations

import gzip
import math
import os
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import Motion, OdometryPose, Picture, Record, TruthPose
from maurice_mcl.arrays import F64

DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs"
real = pytest.mark.skipif(not DATA.is_dir(), reason="no recorded data here (MAURICE_DATA)")


def read(path: Path, options: ReadingOptions | None = None) -> tuple[list[Record], tuple[str, ...]]:
    notes = ReadingNotes(keep_going=False)
    return list(open_recording(path, options).records(notes)), notes.warnings


def truths(path: Path, options: ReadingOptions | None = None) -> F64:
    return np.array([r.pose for r in read(path, options)[0] if isinstance(r, TruthPose)])


def odometry(path: Path, options: ReadingOptions | None = None) -> F64:
    return np.array([r.pose for r in read(path, options)[0] if isinstance(r, OdometryPose)])


def write(file: Path, *lines: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n")
    return file


def image(file: Path, value: int = 100) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), np.full((4, 6, 3), value, np.uint8))


def test_a_robots_heading_is_its_yaw(tmp_path: Path) -> None:
    half = math.radians(40) / 2
    file = write(tmp_path / "t.txt", *(f"{k} 1 2 3 0 0 {math.sin(half)} {math.cos(half)}" for k in range(3)))
    np.testing.assert_allclose(truths(file), [[1, 2, math.radians(40)]] * 3)


def test_a_cameras_heading_is_its_optical_axis(tmp_path: Path) -> None:
    """z forward, x right, y down: the rotation that looks along +y of the world."""
    turned = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
    w = math.sqrt(1 + np.trace(turned)) / 2
    x, y, z = ((turned[2, 1] - turned[1, 2]), (turned[0, 2] - turned[2, 0]), (turned[1, 0] - turned[0, 1]))
    file = write(tmp_path / "t.txt", f"0 1 2 3 {x / (4 * w)} {y / (4 * w)} {z / (4 * w)} {w}")
    np.testing.assert_allclose(truths(file), [[1, 2, math.pi / 2]])


def test_poses_out_of_the_plane_are_told_of(tmp_path: Path) -> None:
    half = math.radians(40) / 2
    level, nose_up = "0 0 0 0 0 0 0 1", f"1 0 0 0 0 {math.sin(half)} 0 {math.cos(half)}"
    found, warnings = read(write(tmp_path / "t.txt", level, nose_up))
    assert len(found) == 2
    assert "40 degrees out of the plane" in warnings[0]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("2 1 2 3 0 0 0", "found 7 values"),
        ("2 1 2 3 0 0 0 0", "a quaternion of length 0"),
        ("2 1 nan 3 0 0 0 1", "found value 'nan', expected a finite number"),
        ("1 1 2 3 0 0 0 1", r"found t 1 after t 1\.5"),
        ("x 1 2 3 0 0 0 1", "found time 'x'"),
        ("2 1 2 3 0 0 0 1\0", "binary data"),
    ],
)
def test_a_broken_row_is_named_by_its_line(line: str, told: str, tmp_path: Path) -> None:
    file = write(tmp_path / "t.txt", "# poses", "1.0 1 2 3 0 0 0 1", "1.5 1 2 3 0 0 0 1", line)
    with pytest.raises(InputError, match=rf"t\.txt:4: .*{told}"):
        read(file, ReadingOptions(format="tum-trajectory"))


def test_kitti_lies_on_its_side(tmp_path: Path) -> None:
    """One metre ahead (z), then to the left (-x) with a quarter turn to the left."""
    left = "0 0 -1 -2  0 1 0 0  1 0 0 1"
    file = write(tmp_path / "00.txt", "1 0 0 0 0 1 0 0 0 0 1 0", "1 0 0 0 0 1 0 0 0 0 1 1", left)
    np.testing.assert_allclose(truths(file), [[0, 0, 0], [1, 0, 0], [1, 2, math.pi / 2]], atol=1e-12)


def test_kitti_poses_end_early_and_it_is_said(tmp_path: Path) -> None:
    write(tmp_path / "sequences" / "03" / "times.txt", "0", "0.1", "0.2")
    image(tmp_path / "sequences" / "03" / "image_2" / "000000.png")
    write(tmp_path / "poses" / "03.txt", "1 0 0 0 0 1 0 0 0 0 1 0", "1 0 0 0 0 1 0 0 0 0 1 1")
    found, warnings = read(tmp_path / "sequences" / "03")
    assert Counter(type(r).__name__ for r in found) == {"Picture": 3, "TruthPose": 2}
    assert "2 poses for 3 times" in warnings[0]
    assert len(truths(tmp_path / "sequences" / "03", ReadingOptions(truth_offset_s=0.05))) == 2


def test_kitti_pictures_beyond_the_times_are_told(tmp_path: Path) -> None:
    write(tmp_path / "03" / "times.txt", "0", "0.1")
    for number in range(3):
        image(tmp_path / "03" / "image_2" / f"{number:06}.png")
    found, warnings = read(tmp_path / "03")
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
    found, _ = read(tmp_path, ReadingOptions(camera="cam1"))
    assert [int(r.read()[0, 0, 0]) for r in found if isinstance(r, Picture)] == [200]
    with pytest.raises(InputError, match="found cam0, cam1, expected 'cam9'"):
        read(tmp_path, ReadingOptions(camera="cam9"))


def test_a_raw_carmen_log_has_no_truth(tmp_path: Path) -> None:
    """The laser sits 0.2 m ahead of the robot's middle all the way."""
    lines = []
    for k in range(5):
        lines.append(f"ODOM {k} 0 0 1 0 0 {k}.0 host {k}.0")
        lines.append(f"FLASER 2 1.5 1.6 {k + 0.2} 0 0 {k} 0 0 {k}.1 host {k}.1")
    found, warnings = read(write(tmp_path / "raw.log", *lines))
    assert Counter(type(r).__name__ for r in found) == {"OdometryPose": 5}
    assert warnings == ()


def test_a_corrected_carmen_log_has_the_scans_as_truth(tmp_path: Path) -> None:
    lines = [f"FLASER 1 1.5 {k} {0.1 * k} 0 {k} 0 0 {k}.1 host {k}.1" for k in range(4)]
    found, _ = read(write(tmp_path / "corrected.log", *lines))
    np.testing.assert_allclose(
        [r.pose[1] for r in found if isinstance(r, TruthPose)], [0, 0.1, 0.2, 0.3], atol=1e-9
    )
    assert sum(isinstance(r, OdometryPose) for r in found) == 4


def test_odometry_that_is_set_anew_goes_on_from_where_it_was(tmp_path: Path) -> None:
    lines = [
        "ODOM 0 0 0 0 0 0 20.0 host 20.0",
        "ODOM 1 0 0 0 0 0 21.0 host 21.0",
        "FLASER 1 1.5 5 5 0 5 5 0 21.0 host 21.0",
        "ODOM 5 5 0 0 0 0 3e-43 host 3e-43",
        "ODOM 6 5 0 0 0 0 22.0 host 22.0",
    ]
    file = tmp_path / "corrected.log.gz"
    file.write_bytes(gzip.compress("\n".join(lines).encode()))
    np.testing.assert_allclose(odometry(file)[:, 0], [0, 1, 1, 2])
    np.testing.assert_allclose(truths(file)[:, :2], [[5, 5]])


def test_small_falls_of_a_carmen_log_are_raised_and_large_ones_refused(tmp_path: Path) -> None:
    lines = [f"ODOM {t} 0 0 0 0 0 {t} host {t}" for t in (20, 21.5, 21.0, 22)]
    found, warnings = read(write(tmp_path / "a.log", *lines))
    assert [r.t_s for r in found] == [20, 21.5, 21.5, 22]
    assert "1 times fall" in warnings[0]
    with pytest.raises(InputError, match=r"b\.log:5: found time 3 after 22"):
        read(write(tmp_path / "b.log", *lines, "ODOM 3 0 0 0 0 0 3 host 3"))


@pytest.mark.parametrize("cut", ["ODOM 1 2", "FLASER 180 1 2 3", "FLASER x 1 2", "ODOM 1 2 x 0 0 0 1 h 1"])
def test_cut_lines_of_a_carmen_log_are_named(cut: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.log:2: "):
        read(write(tmp_path / "a.log", "ODOM 0 0 0 0 0 0 1 host 1", cut))


def test_columns_by_name_by_option_and_in_other_units(tmp_path: Path) -> None:
    image(tmp_path / "a.png")
    file = write(
        tmp_path / "d.csv", "stamp;jpg;px;py;yaw;forward_cm;turn_deg", "5;a.png;1000;-2000;90;30;180"
    )
    columns = {"time": "stamp:ms", "image": "jpg", "x": "px:mm", "y": "py:mm", "heading": "yaw:deg"}
    found, _ = read(file, ReadingOptions(columns=columns))
    motion, pose, taken = found
    assert isinstance(motion, Motion)
    assert isinstance(pose, TruthPose)
    assert isinstance(taken, Picture)
    np.testing.assert_allclose(motion.motion, [0.3, 0, math.pi])
    np.testing.assert_allclose(pose.pose, [1, -2, math.pi / 2])
    assert taken.t_s == 0.005
    assert taken.read().shape == (4, 6, 3)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"x": "nothing"}, "expected also 'nothing'"),
        ({"wheel": "a"}, "no role 'wheel'"),
        ({"heading": "c"}, "say --reading columns=heading=c:deg or :rad"),
        ({"x": "a:deg"}, "found unit 'deg' of x"),
    ],
)
def test_columns_that_cannot_be(columns: dict[str, str], told: str, tmp_path: Path) -> None:
    file = write(tmp_path / "d.csv", "a,b,c", "1,2,3")
    whole = {"x": "a", "y": "b", "heading": "c:deg"} | columns
    with pytest.raises(InputError, match=told):
        read(file, ReadingOptions(format="table", columns=whole))


def test_a_table_beside_pictures_goes_row_for_row(tmp_path: Path) -> None:
    for k in (2, 10, 1):
        image(tmp_path / "views" / f"v{k}.png", k)
    table = write(tmp_path / "p.csv", "x_m,y_m,heading_rad", "0,0,0", "1,0,0", "2,0,0")
    found, warnings = read(tmp_path / "views", ReadingOptions(table=table))
    assert [r.name for r in found if isinstance(r, Picture)] == ["v1.png", "v2.png", "v10.png"]
    assert "one row per second" in warnings[0]
    write(tmp_path / "p.csv", "x_m,y_m,heading_rad", *["0,0,0"] * 4)
    with pytest.raises(InputError, match=r"p\.csv:5: found no picture 3, there are 3"):
        read(tmp_path / "views", ReadingOptions(table=table))


def test_a_table_beside_a_video(tmp_path: Path) -> None:
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (32, 32))
    for value in (0, 80, 160):
        video.write(np.full((32, 32, 3), value, np.uint8))
    video.release()
    table = write(tmp_path / "p.csv", "time,frame,x_m,y_m,heading_rad", "7,2,0,0,0", "8,0,1,0,0")
    found = [r for r in read(tmp_path / "v.avi", ReadingOptions(table=table))[0] if isinstance(r, Picture)]
    assert [r.t_s for r in found] == [7, 8]
    assert [round(float(r.read().mean()), -1) for r in found] == [160, 0]


def test_a_video_has_its_own_times(tmp_path: Path) -> None:
    video = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (32, 32))
    for _ in range(4):
        video.write(np.full((32, 32, 3), 90, np.uint8))
    video.release()
    assert [r.t_s for r in read(tmp_path / "v.avi")[0]] == pytest.approx([0, 0.1, 0.2, 0.3], abs=1e-3)


def test_an_unknown_format_lists_those_there_are(tmp_path: Path) -> None:
    file = write(tmp_path / "letter.txt", "Dear reader")
    with pytest.raises(InputError, match=r"begins with b'Dear reader.*session-log, .*--reading format="):
        guess(file)
    with pytest.raises(InputError, match="there is no format 'bag'"):
        open_recording(file, ReadingOptions(format="bag"))


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
    found, _ = read(path, ReadingOptions(truth_offset_s=offset))
    assert sum(isinstance(r, TruthPose) for r in found) == 490
    assert open_session(path).overview() == (11, False)


@real
def test_carmen_counts_and_a_continuous_odometry() -> None:
    path = DATA / "carmen" / "intel-corrected.log.gz"
    found, _ = read(path)
    assert Counter(type(r).__name__ for r in found) == {"OdometryPose": 14541, "TruthPose": 910}
    steps = np.diff([r.pose[:2] for r in found if isinstance(r, OdometryPose)], axis=0)
    assert np.hypot(*steps.T).max() < 0.3  # no jump to a scan's pose
