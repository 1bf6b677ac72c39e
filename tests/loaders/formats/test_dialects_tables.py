"""CARMEN logs, tables and videos as other programs write them: all open, or say what is wrong."""

from __future__ import annotations

import gzip
import math
import os
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.dialect_files import COUNTS, QUARTER, counts, image, moving, write
from helpers.format_samples import write_tub
from helpers.recordings import odometry, read, truths
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Motion, OdometryPose, Picture, Scan, TruthPose
from maurice_loaders.runs.manifest import is_saved, source_hash

# CARMEN


def odom(k: int) -> str:
    return f"ODOM {0.1 * k} 0 0 0.1 0 0 {k}.0 host {k}.0"


def laser(k: int, word: str = "FLASER") -> str:
    return f"{word} 3 1 nan 3 {0.1 * k} 0 0 {0.1 * k} 0 0 {k}.1 host {k}.1"


def robotlaser(k: int, number: int = 1) -> str:
    ranges = "3 1 2 3 0"
    pose = f"{0.1 * k} 0 0"
    end = f"0 0 0.3 0.3 1e6 {k}.1 host {k}.1"
    return f"ROBOTLASER{number} 0 -1.57 3.14 0.0174 81.9 0.01 0 {ranges} {pose} {pose} {end}"


HEAD = "# CARMEN Logfile\n# file format is one message per line\n"
CARMEN = {
    "odometry": "\n".join(map(odom, range(3))),
    "head, parameters, comments": HEAD
    + "PARAM a 0 h 0\nSYNC l 0 h 0\n"
    + "\n# stop\n".join(map(odom, range(3))),
    "scans": "\n".join(map(laser, range(3))),
    "rear scans as well": "\n".join(f"{odom(k)}\n{laser(k)}\n{laser(k, 'RLASER')}" for k in range(3)),
    "robotlaser": "\n".join(f"{robotlaser(k)}\n{robotlaser(k, 2)}" for k in range(3)),
    "corrections": "\n".join(f"{odom(k)}\nNEFF {k} 0.5\n{laser(k)}" for k in range(3)),
    "unknown words first": "IMU 0 0 0 h 0\nGPSGGA 1 2 h 0\n" + "\n".join(map(odom, range(3))),
    "many parameters": "PARAM some_parameter 0.123456 nohost 0\n" * 2000 + "\n".join(map(odom, range(3))),
    "windows": "\r\n".join(map(odom, range(3))) + "\r\n",
    "truth": "\n".join(f"{odom(k)}\nTRUEPOS {k} 0 0 {k} 0 0 {k}.05 host {k}.05" for k in range(3)),
}


@pytest.mark.parametrize("name", CARMEN)
@pytest.mark.parametrize("ending", [".log", ".clf", ".log.gz"])
def test_carmen_dialects(name: str, ending: str, tmp_path: Path) -> None:
    data = CARMEN[name].encode()
    file = write(tmp_path / f"drive{ending}", gzip.compress(data) if ending.endswith("gz") else data)
    assert guess(file).name == "carmen"
    scans = {"Scan": 3} if "LASER" in CARMEN[name] else {}
    poses = 3 * (("ODOM" in CARMEN[name]) + len(scans))  # a scan tells where the robot was by its odometry
    truth = {"TruthPose": 3} if "TRUEPOS" in CARMEN[name] else {}
    assert counts(file) == {"OdometryPose": poses} | scans | truth


def test_text_that_only_shouts_is_no_carmen_log(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected one of .*; see --reading format="):
        read(write(tmp_path / "a.log", "HELLO WORLD\nODOM"[:11]))


# tables

NAMES = "time_s,image,x_m,y_m,heading_deg"


def table(folder: Path, text: str | bytes, name: str = "drive.csv") -> Path:
    for k in range(3):
        image(folder / f"{k}.png")
    return write(folder / name, text).parent


def rows(separator: str = ",", decimal: str = ".") -> str:
    made = [
        (f"{0.5 * k}".replace(".", decimal), f"{k}.png", f"{1.5 * k}".replace(".", decimal), "2", "90")
        for k in range(3)
    ]
    return "".join(separator.join(row) + "\n" for row in made)


TABLES = {
    "plain": f"{NAMES}\n{rows()}",
    "semicolons": f"{NAMES}\n{rows()}".replace(",", ";"),
    "decimal commas": NAMES.replace(",", ";") + "\n" + rows(";", ","),
    "decimal commas, tabs": NAMES.replace(",", "\t") + "\n" + rows("\t", ","),
    "quoted": '"' + f"{NAMES}\n{rows()}".strip().replace(",", '","').replace("\n", '"\n"') + '"\n',
    "windows": "\ufeff" + f"{NAMES}\n{rows()}".replace("\n", "\r\n"),
    "blanks": f"{NAMES}\n{rows()}".replace(",", ", "),
    "trailing commas": f"{NAMES}\n{rows()}".replace("\n", ",\n"),
    "a comment first": f"# made by a program, in 2026\n{NAMES}\n{rows()}",
    "names in a comment": f"# made by a program\n#{NAMES}\n{rows()}",
    "excel": "sep=;\n" + f"{NAMES}\n{rows()}".replace(",", ";"),
    "empty cells at the end": f"{NAMES}\n{rows()},,,,\n,,,,\n",
    "capitals": f"{NAMES.upper()}\n{rows()}",
    "quaternion": "timestamp,filename,x,y,z,qx,qy,qz,qw\n"
    + "".join(f"{0.5 * k},{k}.png,{1.5 * k},2,0,0,0,{QUARTER},{QUARTER}\n" for k in range(3)),
    "pose names": "time,image,pose_x,pose_y,pose_theta_deg\n" + rows(),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(name: str, tmp_path: Path) -> None:
    folder = table(tmp_path, TABLES[name])
    assert counts(folder) == COUNTS
    found, _ = read(folder)
    got = np.array([one.pose for one in found if isinstance(one, TruthPose)])
    np.testing.assert_allclose(got, [[1.5 * k, 2, math.pi / 2] for k in range(3)], atol=1e-6)
    assert [one.t_s for one in found if isinstance(one, Picture)] == [0, 0.5, 1]


ODD = "zeit;bild;ost;nord;richtung\n0;0.png;0;2;90\n1;1.png;1,5;2;90\n"
ODD_ROLES = {"time": "zeit:s", "image": "bild", "x": "ost", "y": "nord", "heading": "richtung:deg"}


def test_odd_names_make_a_table_of_a_file_and_of_a_folder(tmp_path: Path) -> None:
    folder = table(tmp_path, ODD)
    for path in (folder, folder / "drive.csv"):
        assert counts(path, Reading(columns=ODD_ROLES)) == {"TruthPose": 2, "Picture": 2}
    for one in tmp_path.glob("*.png"):
        one.unlink()
    for path in (folder, folder / "drive.csv"):
        with pytest.raises(InputError, match=r"drive\.csv is a table, .* with --reading columns="):
            guess(path)


def test_rows_go_with_the_frames_of_the_one_video_in_a_folder(tmp_path: Path) -> None:
    moving(tmp_path / "drive.avi")
    write(tmp_path / "drive.csv", "time_s,x,y,heading_deg\n" + "".join(f"{k},{k},0,0\n" for k in range(3)))
    found, _ = read(tmp_path)
    pictures = [one for one in found if isinstance(one, Picture)]
    assert [one.t_s for one in pictures] == [0, 1, 2]
    assert [one.read().mean() for one in pictures] == pytest.approx([0, 50, 100], abs=4)


@pytest.mark.parametrize(
    "bad", ["1.5,3.png,0,\r0,90", "1.5,3.png," + "9" * 200_000 + ",0,90", "1.5," + "9" * 300]
)
def test_rows_that_are_none_are_problems(bad: str, tmp_path: Path) -> None:
    first, *others = rows().splitlines()
    folder = table(tmp_path, "\n".join([NAMES, first, bad, *others]))
    with pytest.raises(InputError, match=r"drive\.csv:3: "):
        read(folder)
    notes = ReadingNotes(keep_going=True)
    assert len(list(open_recording(folder).records(notes))) == 6
    assert notes.count == 1
    folder = table(tmp_path, f"{NAMES}\n{rows()}2,{'9' * 300},0,0,90\n")  # a name that no file can have
    session = open_session(folder, Reading(keep_going=True))
    assert (len(list(session.moments())), session.problem_count) == (3, 1)


def test_a_table_without_names_by_the_numbers_of_its_columns(tmp_path: Path) -> None:
    folder = table(tmp_path, rows())
    columns = {"time": "1:s", "image": "2", "x": "3:m", "y": "4:m", "heading": "5:deg"}
    assert counts(folder, Reading(columns=columns)) == COUNTS
    found, said = read(folder)  # the pictures alone, and a word of it
    assert len(found) == 3
    assert any("drive.csv beside them is not used" in text for text in said)
    with pytest.raises(InputError, match=r"5 columns.*called 1, 2, 3 .*--reading columns="):
        read(folder / "drive.csv", Reading(format="table"))


def test_odometry_by_quaternions(tmp_path: Path) -> None:
    names = "t_s,image,odom_x,odom_y,odom_qw,odom_qx,odom_qy,odom_qz"
    made = "".join(f"{k},{k}.png,{k},0,{QUARTER},0,0,{QUARTER}\n" for k in range(3))
    found, _ = read(table(tmp_path, f"{names}\n{made}"))
    assert [one.pose.tolist() for one in found if isinstance(one, OdometryPose)] == [
        [k, 0, pytest.approx(math.pi / 2)] for k in range(3)
    ]
    bad = made.replace(str(QUARTER), "0")
    with pytest.raises(InputError, match=r"drive\.csv:2: found a quaternion of length 0"):
        read(table(tmp_path, f"{names}\n{bad}"))


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_a_table_in_another_encoding_is_named(encoding: str, tmp_path: Path) -> None:
    folder = table(tmp_path, f"{NAMES}\n{rows()}".replace("0.png", "ä.png").encode(encoding))
    assert any("is not used" in text for text in read(folder)[1])
    with pytest.raises(InputError, match=r"not UTF-8|binary data"):
        read(folder / "drive.csv", Reading(format="table"))


# videos


def test_pictures_one_after_the_other_are_a_video(tmp_path: Path) -> None:
    jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()
    found, said = read(write(tmp_path / "camera.mjpeg", jpeg * 4))
    assert len(found) == 4
    assert "without times" in said[0]
    with pytest.raises(
        InputError, match=r"found a single picture, .* put the pictures of a drive into a folder"
    ):
        read(write(tmp_path / "one.jpg", jpeg))


@pytest.mark.parametrize(
    ("ending", "code"), [("mp4", "mp4v"), ("mov", "mp4v"), ("mkv", "MJPG"), ("avi", "MJPG")]
)
def test_containers(ending: str, code: str, tmp_path: Path) -> None:
    file = tmp_path / f"drive.{ending}"
    moving(file, code)
    found, _ = read(file)
    assert [one.t_s for one in found] == pytest.approx([0, 0.1, 0.2, 0.3], abs=2e-3)


DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs"


real = pytest.mark.skipif(not DATA.is_dir(), reason="no recorded data here (MAURICE_DATA)")


def test_a_raw_carmen_log_has_no_truth_and_a_corrected_one_has_its_scans(tmp_path: Path) -> None:
    """The laser of the raw one sits 0.2 m ahead of the robot's middle all the way."""
    raw = [
        f"ODOM {k} 0 0 1 0 0 {k}.0 host {k}.0\nFLASER 2 1.5 1.6 {k + 0.2} 0 0 {k} 0 0 {k}.1 host {k}.1"
        for k in range(5)
    ]
    found, warnings = read(write(tmp_path / "raw.log", *raw))
    assert Counter(type(r).__name__ for r in found) == {"OdometryPose": 10, "Scan": 5}
    assert warnings == ()
    for record in found:
        if isinstance(record, Scan):
            np.testing.assert_allclose(record.scan.mount, [0.2, 0, 0], atol=1e-12)
    scans = [f"FLASER 1 1.5 {k} {0.1 * k} 0 {k} 0 0 {k}.1 host {k}.1" for k in range(4)]
    file = write(tmp_path / "corrected.log", *scans)
    np.testing.assert_allclose(truths(file)[:, 1], [0, 0.1, 0.2, 0.3], atol=1e-9)
    assert len(odometry(file)) == 4
    assert not any(r.scan.mount.any() for r in read(file)[0] if isinstance(r, Scan))
    assert "an estimate" in open_session(file).remarks[0]


def test_odometry_that_is_set_anew_goes_on_from_where_it_was(tmp_path: Path) -> None:
    lines = [
        "ODOM 0 0 0 0 0 0 20.0 host 20.0",
        "ODOM 1 0 0 0 0 0 21.0 host 21.0",
        "FLASER 1 1.5 5 5 0 5 5 0 21.0 host 21.0",
        "ODOM 5 5 0 0 0 0 3e-43 host 3e-43",
        "ODOM 6 5 0 0 0 0 22.0 host 22.0",
    ]
    file = write(tmp_path / "corrected.log.gz", gzip.compress("\n".join(lines).encode()))
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
    found, _ = read(file, Reading(columns=columns))
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
        read(file, Reading(format="table", columns=whole))


def test_a_table_beside_pictures_goes_row_for_row(tmp_path: Path) -> None:
    for k in (2, 10, 1):
        image(tmp_path / "views" / f"v{k}.png", k)
    table = write(tmp_path / "p.csv", "x_m,y_m,heading_rad", "0,0,0", "1,0,0", "2,0,0")
    found, warnings = read(tmp_path / "views", Reading(table=table))
    assert [r.name for r in found if isinstance(r, Picture)] == ["v1.png", "v2.png", "v10.png"]
    assert "one row per second" in warnings[0]
    write(tmp_path / "p.csv", "x_m,y_m,heading_rad", *["0,0,0"] * 4)
    with pytest.raises(InputError, match=r"p\.csv:5: found no picture 3, there are 3"):
        read(tmp_path / "views", Reading(table=table))


def test_a_table_beside_a_video(tmp_path: Path) -> None:
    video = moving(tmp_path / "v.avi", values=(0, 80, 160))
    table = write(tmp_path / "p.csv", "time,frame,x_m,y_m,heading_rad", "7,2,0,0,0", "8,0,1,0,0")
    found = [r for r in read(video, Reading(table=table))[0] if isinstance(r, Picture)]
    assert [r.t_s for r in found] == [7, 8]
    assert [round(float(r.read().mean()), -1) for r in found] == [160, 0]


def test_an_unknown_format_lists_those_there_are(tmp_path: Path) -> None:
    file = write(tmp_path / "letter.txt", "Dear reader")
    with pytest.raises(InputError, match=r"begins with b'Dear reader.*session-log, .*--reading format="):
        guess(file)
    with pytest.raises(InputError, match="there is no format 'bag'"):
        open_recording(file, Reading(format="bag"))


@real
def test_carmen_counts_and_a_continuous_odometry() -> None:
    path = DATA / "carmen" / "intel-corrected.log.gz"
    found, _ = read(path)
    assert Counter(type(r).__name__ for r in found) == {"OdometryPose": 14541, "TruthPose": 910, "Scan": 910}
    steps = np.diff([r.pose[:2] for r in found if isinstance(r, OdometryPose)], axis=0)
    assert np.hypot(*steps.T).max() < 0.3  # no jump to a scan's pose


# Donkeycar tubs


def test_the_times_of_a_tub_are_replaced_and_said_where_they_are_useless(tmp_path: Path) -> None:
    found, warnings = read(write_tub(tmp_path, 5, False, step_ms=4))
    assert [record.t_s for record in found] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])
    assert any("times 4 ms apart, which no camera's are; 20 pictures" in one for one in warnings)
    assert any("commands" in one and "no odometry" in one for one in warnings)


def test_a_tub_leaves_deleted_records_out_and_counts_broken_ones(tmp_path: Path) -> None:
    tub = write_tub(tmp_path, 4, False)
    with (tub / "catalog_0.catalog").open("a") as file:
        file.write('{"_index": 9, "_timestamp_ms": "late"}\n{"_index"')
    notes = ReadingNotes(keep_going=True)
    names = [one.name for one in open_recording(tub).records(notes) if isinstance(one, Picture)]
    assert names == [f"images/{k}_cam_image_array_.jpg" for k in range(4)]
    assert notes.count == 2
    assert not is_saved(tub)  # though it has a manifest.json
    hashed = source_hash(tub)
    (tub / "catalog_0.catalog").write_text("")
    assert source_hash(tub) != hashed
    with pytest.raises(InputError, match=r"found cameras cam/image_array, expected 'left'"):
        open_recording(tub, Reading(camera="left"))
