"""CARMEN logs, tables and videos as other programs write them: all open, or say what is wrong."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.dialect_files import COUNTS, QUARTER, counts, image, read, write
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import OdometryPose, Picture, TruthPose

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
}


@pytest.mark.parametrize("name", CARMEN)
@pytest.mark.parametrize("ending", [".log", ".clf", ".log.gz"])
def test_carmen_dialects(name: str, ending: str, tmp_path: Path) -> None:
    data = CARMEN[name].encode()
    file = write(tmp_path / f"drive{ending}", gzip.compress(data) if ending.endswith("gz") else data)
    assert guess(file).name == "carmen"
    assert counts(file) == {"OdometryPose": 3}


def test_carmen_truth_beside_odometry(tmp_path: Path) -> None:
    text = "\n".join(f"{odom(k)}\nTRUEPOS {k} 0 0 {k} 0 0 {k}.05 host {k}.05" for k in range(3))
    assert counts(write(tmp_path / "a.log", text)) == {"OdometryPose": 3, "TruthPose": 3}


def test_text_that_only_shouts_is_no_carmen_log(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected one of .*; see --reading format="):
        read(write(tmp_path / "a.log", "HELLO WORLD\nODOM"[:11]))


# tables

NAMES = "time_s,image,x_m,y_m,heading_deg"


def moving(file: Path, code: str) -> None:
    """Write a video of four frames, each brighter than the one before."""
    video = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*code), 10, (64, 48))
    for value in range(4):
        video.write(np.full((48, 64, 3), 50 * value, np.uint8))
    video.release()


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
        assert counts(path, ReadingOptions(columns=ODD_ROLES)) == {"TruthPose": 2, "Picture": 2}
    for one in tmp_path.glob("*.png"):
        one.unlink()
    for path in (folder, folder / "drive.csv"):
        with pytest.raises(InputError, match=r"drive\.csv is a table, .* with --reading columns="):
            guess(path)


def test_rows_go_with_the_frames_of_the_one_video_in_a_folder(tmp_path: Path) -> None:
    moving(tmp_path / "drive.avi", "MJPG")
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


def test_a_picture_whose_name_no_file_can_have_is_left_out(tmp_path: Path) -> None:
    folder = table(tmp_path, f"{NAMES}\n{rows()}2,{'9' * 300},0,0,90\n")
    session = open_session(folder, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) == 3
    assert session.problem_count == 1


def test_a_table_without_names_by_the_numbers_of_its_columns(tmp_path: Path) -> None:
    folder = table(tmp_path, rows())
    columns = {"time": "1:s", "image": "2", "x": "3:m", "y": "4:m", "heading": "5:deg"}
    assert counts(folder, ReadingOptions(columns=columns)) == COUNTS
    found, said = read(folder)  # the pictures alone, and a word of it
    assert len(found) == 3
    assert any("drive.csv beside them is not used" in text for text in said)
    with pytest.raises(
        InputError, match=r"no names of columns, and 5 columns; they are called 1, 2, 3 .*--reading columns="
    ):
        read(folder / "drive.csv", ReadingOptions(format="table"))


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
        read(folder / "drive.csv", ReadingOptions(format="table"))


# videos


def test_pictures_one_after_the_other_are_a_video(tmp_path: Path) -> None:
    jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()
    found, said = read(write(tmp_path / "camera.mjpeg", jpeg * 4))
    assert len(found) == 4
    assert "without times" in said[0]
    with pytest.raises(InputError, match=r"expected one of .*; see --reading format="):
        read(write(tmp_path / "one.jpg", jpeg))


@pytest.mark.parametrize(
    ("ending", "code"), [("mp4", "mp4v"), ("mov", "mp4v"), ("mkv", "MJPG"), ("avi", "MJPG")]
)
def test_containers(ending: str, code: str, tmp_path: Path) -> None:
    file = tmp_path / f"drive.{ending}"
    moving(file, code)
    found, _ = read(file)
    assert [one.t_s for one in found] == pytest.approx([0, 0.1, 0.2, 0.3], abs=2e-3)
