"""Headers and lines: everything comes back, and every way of being wrong is named with its line."""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.reading.recording import Record
from maurice_loaders.session_log import records as log_lines
from maurice_loaders.session_log.header import header_from_json, header_to_json
from maurice_loaders.session_log.records import LineReader, read_header
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import Camera, SessionInfo

from ..conftest import WriteLog

TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.5]])
ARENA = Arena(
    bounds=(0.0, -1.0, 5.0, 4.0),
    walls=np.array([[0.0, 0.0, 1.0, 1.0], [2.0, 3.0, 4.0, 4.0]]),
    obstacles=(Region("sofa", TRIANGLE),),
    floors=(Region("wood", TRIANGLE), Region("carpet", TRIANGLE + 1)),
    rooms=(Region("north", TRIANGLE - 1),),
)


def test_everything_comes_back(tmp_path: Path) -> None:
    info = SessionInfo(
        name="a",
        display_units="in",
        robot="Maurice",
        motion={"turn_gain": 0.73, "drift": {"wood": {"bias_rad_per_m": 0.1}}},
        cameras=(Camera("front", 176, 144, 0.8, 0.1, 0.25), Camera("rear")),
        start=np.array([1.0, 2.0, -0.5]),
        survey=tmp_path / "library",
        arena=ARENA,
        notes=("one", "two"),
    )
    written = json.loads(json.dumps(header_to_json(info, "survey", tmp_path)))
    read, kind = header_from_json(written, tmp_path / "a.log")
    assert kind == "survey"
    plain = ("name", "display_units", "robot", "motion", "cameras", "survey", "notes")
    assert [getattr(read, key) for key in plain] == [getattr(info, key) for key in plain]
    assert read.start is not None
    assert read.start.tolist() == [1, 2, -0.5]
    assert read.arena is not None
    assert read.arena.bounds == ARENA.bounds
    assert np.array_equal(read.arena.walls, ARENA.walls)
    for key in ("obstacles", "floors", "rooms"):
        for a, b in zip(getattr(read.arena, key), getattr(ARENA, key), strict=True):
            assert a.name == b.name
            assert np.array_equal(a.polygon, b.polygon)


def test_the_survey_is_written_relative_and_read_resolved(tmp_path: Path) -> None:
    info = SessionInfo("a", survey=tmp_path / "surveys" / "s.log")
    header = header_to_json(info, "session", tmp_path / "drives")
    assert header["survey"] == "../surveys/s.log"
    moved = tmp_path / "elsewhere"
    assert header_from_json(header, moved / "drives/a.log")[0].survey == moved / "surveys/s.log"
    beside = header_to_json(SessionInfo("a", survey=Path("s.log")), "session", tmp_path)
    assert beside["survey"] == "s.log"


def test_the_least_header(tmp_path: Path) -> None:
    found = {"format": "maurice-session-log", "version": 1, "kind": "session"}
    info, kind = header_from_json(found, tmp_path / "drive.log")
    assert (info.name, info.display_units, kind) == ("drive", "m", "session")
    assert info.motion is info.arena is None


def region(**changes: Any) -> dict[str, Any]:
    sofa = {"name": "sofa", "polygon_m": [[0, 0], [1, 0], [0, 1]]} | changes
    return {"bounds_m": [0, 0, 1, 1], "obstacles": [sofa]}


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "format": ({"format": "rosbag"}, "found format 'rosbag', expected 'maurice-session-log'"),
    "no format": ({"format": None}, "found format nothing, expected"),
    "version": ({"version": 2}, "found format version 2, expected 1"),
    "version true": ({"version": True}, "found format version True, expected 1"),
    "kind": ({"kind": "movie"}, "found kind 'movie', expected 'session' or 'survey'"),
    "name": ({"name": 5}, "found name 5, expected a text"),
    "robot": ({"robot": "Maurice"}, "found robot 'Maurice', expected an object"),
    "motion": ({"robot": {"motion": [1]}}, r"found robot.motion \[1\], expected an object"),
    "cameras": ({"cameras": ["front"]}, "found cameras .*, expected an object"),
    "camera width": ({"cameras": {"a": {"width_px": 1.5}}}, "found cameras.a.width_px 1.5, expected a whole"),
    "camera angle": ({"cameras": {"a": {"yaw_rad": "left"}}}, "found cameras.a.yaw_rad 'left', expected"),
    "units": ({"display_units": "ft"}, "found display_units 'ft', expected 'm' or 'in'"),
    "start": ({"start": [1, 2]}, "found start .*, expected a list of 3 numbers"),
    "start too far": ({"start": [0, 1e300, 0]}, r"found start 1e\+300, expected a number up to 1e9 in size"),
    "camera too high": ({"cameras": {"a": {"height_m": 1e10}}}, "found cameras.a.height_m .* up to 1e9"),
    "map too large": ({"map": {"bounds_m": [0, 0, 1e300, 1]}}, r"found map.bounds_m 1e\+300, .* up to 1e9"),
    "wall too far": (
        {"map": {"bounds_m": [0, 0, 1, 1], "walls_m": [[0, 0, 1, -1e10]]}},
        "found map.walls_m .* up to 1e9",
    ),
    "corner too far": (
        {"map": region(polygon_m=[[0, 0], [1, 1], [1e10, 0]])},
        "found map.obstacles.polygon_m .* up to 1e9",
    ),
    "survey": ({"survey": 1}, "found survey 1, expected a text"),
    "survey with a zero": ({"survey": "a\0b"}, "found survey 'a.x00b', expected the path of a file"),
    "map with a zero": ({"map": "a\0b.yaml"}, "found map 'a.x00b.yaml', expected the path of a file"),
    "map of a long name": ({"map": "a" * 5000 + ".yaml"}, "found map 'a{56}..., expected the path of a file"),
    "map of another file": (
        {"map": "/etc/passwd"},
        "found map '/etc/passwd', expected an object, or the path",
    ),
    "notes": ({"notes": "hello"}, "found notes 'hello', expected a list"),
    "map without bounds": ({"map": {}}, "found map.bounds_m nothing, expected a list of 4"),
    "map turned over": ({"map": {"bounds_m": [1, 0, 0, 1]}}, "expected x_min < x_max and y_min < y_max"),
    "walls": (
        {"map": {"bounds_m": [0, 0, 1, 1], "walls_m": [[1, 2, 3]]}},
        "found map.walls_m .* of 4 numbers",
    ),
    "obstacle of two corners": (
        {"map": region(polygon_m=[[0, 0], [1, 1]])},
        "found 2 corners .*, expected at least 3",
    ),
    "obstacle without a name": ({"map": region(name=None)}, "found map.obstacles.name nothing, expected"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_header_is_an_error_at_line_1(write_log: WriteLog, name: str) -> None:
    changes, message = WRONG[name]
    path = write_log()
    header = json.loads(path.read_text().splitlines()[0]) | changes
    path.write_text(json.dumps(header) + "\n")
    with pytest.raises(InputError, match=message) as caught:
        read_header(path)
    assert str(caught.value).startswith(f"{path}:1: found ")


def read(path: Path, *, keep_going: bool = False) -> list[Record]:
    _, kind = read_header(path)
    return list(LineReader(path, kind).records(ReadingNotes(keep_going)))


GOOD = {"t": 5, "event": "fine"}
SCAN = {"ranges_m": [1, 2], "start_rad": 0, "step_rad": 0.1, "min_m": 0, "max_m": 8}
BROKEN: dict[str, tuple[Any, str]] = {
    "broken JSON": ('{"t": 6, "event"}', "found broken JSON .* at column 17"),
    "two objects": ('{"t": 6, "event": "a"} {}', "found broken JSON"),
    "a list": ("[1, 2]", r"found a line \[1, 2\], expected an object"),
    "a bare number": ("6", "found a line 6, expected an object"),
    "NaN": ('{"t": 6, "odometry": [NaN, 0, 0]}', "found NaN, expected finite numbers"),
    "Infinity": ('{"t": 6, "truth": [0, Infinity, 0]}', "found Infinity, expected finite"),
    "-Infinity": ('{"t": 6, "truth": [0, -Infinity, 0]}', "found -Infinity, expected finite"),
    "NaN where nobody looks": ('{"t": 6, "event": "a", "more": NaN}', "found NaN, expected finite"),
    "a number too large": ('{"t": 6, "odometry": [1e999, 0, 0]}', "found '1e999', expected finite"),
    "a whole number too large": (
        '{"t": 6, "odometry": [1' + "0" * 400 + ", 0, 0]}",
        r"found odometry 10+\.\.\., expected a number up to 1e9 in size",
    ),
    "a way too long": (
        {"t": 6, "odometry": [1e300, 0, 0]},
        r"found odometry 1e\+300, expected a number up to 1e9 in size",
    ),
    "a way back too long": ({"t": 6, "odometry": [-1.1e9, 0, 0]}, "expected a number up to 1e9 in size"),
    "an encoder too far": (
        {"t": 6, "odometry": [1, 2, 3], "encoders_m": [0, 0, 0, 1e10]},
        r"found encoders_m 1e\+10|found encoders_m 10000000000",
    ),
    "truth too far": ({"t": 6, "truth": [0, 2e9, 0]}, "found truth .*, expected a number up to 1e9 in size"),
    "a time too late": ({"t": 1e300, "event": "a"}, r"found t 1e\+300, expected a number up to 4e9 in size"),
    "a time too early": ({"t": -5e9, "event": "a"}, "found t .*, expected a number up to 4e9 in size"),
    "an endless number": ('{"t": 6, "odometry": [' + "1" * 5000 + ", 0, 0]}", "endless number"),
    "nesting": ('{"t": ' + "[" * 100_000, "nested too deeply|broken JSON"),
    "a control character": ('{"t": 6, "event": "a\0b"}', "found binary data"),
    "no time": ({"event": "a"}, "found t nothing, expected a finite number"),
    "a time in words": ({"t": "noon", "event": "a"}, "found t 'noon', expected a finite number"),
    "true for a time": ({"t": True, "event": "a"}, "found t True, expected a finite number"),
    "time falling": ({"t": 4.5, "event": "a"}, "found t 4.5 after t 5, expected time not to fall"),
    "nothing known": (
        {"t": 6, "lidar": []},
        "found none, expected exactly one of odometry",
    ),
    "two at once": ({"t": 6, "truth": [0, 0, 0], "event": "a"}, "found truth and event, expected exactly"),
    "odometry too short": ({"t": 6, "odometry": [1, 2]}, "expected a list of 3 numbers"),
    "odometry in words": ({"t": 6, "odometry": [1, "2", 3]}, "found odometry '2', expected a finite"),
    "odometry as an object": ({"t": 6, "odometry": {"x": 1}}, "expected a list of 3 numbers"),
    "three encoders": ({"t": 6, "odometry": [1, 2, 3], "encoders_m": [1, 2, 3]}, "expected a list of 4"),
    "truth too long": ({"t": 6, "truth": [1, 2, 3, 4]}, "expected a list of 3 numbers"),
    "truth unknown": ({"t": 6, "truth": None}, "found truth nothing, expected a list"),
    "a scan as a list": ({"t": 6, "scan": [1, 2]}, "found scan .*, expected an object"),
    "a scan without ranges": ({"t": 6, "scan": SCAN | {"ranges_m": None}}, "found scan.ranges_m nothing"),
    "ranges that are NaN": ('{"t": 6, "scan": {"ranges_m": [NaN]}}', "found NaN, expected finite numbers"),
    "ranges in words": ({"t": 6, "scan": SCAN | {"ranges_m": [1, "far"]}}, "found scan.ranges_m 'far'"),
    "ranges that are huge": (
        {"t": 6, "scan": SCAN | {"ranges_m": [1e12]}},
        "found scan.ranges_m 1000000000000",
    ),
    "a million beams": (
        {"t": 6, "scan": SCAN | {"ranges_m": [1] * 10**6}},
        "found 1000000 beams, expected 1 to",
    ),
    "no beam": ({"t": 6, "scan": SCAN | {"ranges_m": []}}, "found 0 beams"),
    "no step": (
        {"t": 6, "scan": {k: v for k, v in SCAN.items() if k != "step_rad"}},
        "found scan.step_rad nothing",
    ),
    "no reach": ({"t": 6, "scan": SCAN | {"max_m": 0}}, "found ranges from 0 to 0 m"),
    "half a mount": ({"t": 6, "scan": SCAN | {"mount": [1, 2]}}, "expected a list of 3 numbers"),
    "an event as a number": ({"t": 6, "event": 7}, "found event 7, expected a text"),
    "half a character": ('{"t": 6, "event": "\\ud800"}', "found half a character in event"),
    "an image as a number": ({"t": 6, "image": 7}, "found image 7, expected a path or"),
    "no path": ({"t": 6, "image": ""}, "found image '', expected a text"),
    "an absolute path": ({"t": 6, "image": "/a/b.jpg"}, "expected a path relative to the log"),
    "an empty inline image": ({"t": 6, "image": {}}, "found image.base64 nothing, expected a text"),
    "covered in words": ({"t": 6, "image": "a.jpg", "covered": "yes"}, "expected true or false"),
    "a camera by number": ({"t": 6, "image": "a.jpg", "camera": 1}, "found camera 1, expected a text"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_line_is_named_or_skipped_alone(write_log: WriteLog, name: str) -> None:
    line, message = BROKEN[name]
    path = write_log(GOOD, line, {"t": 7, "event": "after"})
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}:3: found ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).removeprefix(str(path))) < 250
    assert [record.t_s for record in read(path, keep_going=True)] == [5, 7]


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({}, "found a picture without its pose"),
        ({"pose": [0, 1e300, 0]}, r"found pose 1e\+300, expected a number up to 1e9 in size"),
        ({"covered": True}, None),
    ],
)
def test_a_survey_wants_poses(write_log: WriteLog, more: dict[str, Any], told: str | None) -> None:
    path = write_log({"t": 0, "image": "a.jpg"} | more, kind="survey")
    with nullcontext() if told is None else pytest.raises(InputError, match=f"log:2: {told}"):
        assert len(read(path)) == 1


def test_the_largest_numbers_and_unix_time_are_read(write_log: WriteLog) -> None:
    path = write_log({"t": -4e9, "truth": [1e9, -1e9, 0]}, {"t": 1.8e9, "odometry": [-1e9, 1e9, 1e9]})
    assert [record.t_s for record in read(path)] == [-4e9, 1.8e9]


def test_bytes_that_are_not_utf8_and_lines_that_are_too_long(
    write_log: WriteLog, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_log(GOOD)
    path.write_bytes(path.read_bytes() + b'{"t": 6, "event": "\xff"}\n')
    with pytest.raises(InputError, match="log:3: found bytes that are not UTF-8 at column 20"):
        read(path)
    monkeypatch.setattr(log_lines, "MAX_LINE_BYTES", 200)
    path = write_log(GOOD, {"t": 6, "event": "x" * 1000}, {"t": 7, "event": "after"})
    with pytest.raises(InputError, match="log:3: found a line of more than"):
        read(path)
    assert [record.t_s for record in read(path, keep_going=True)] == [5, 7]


@pytest.mark.parametrize("length", [199, 200, 201])
def test_the_limit_is_exact(tmp_path: Path, length: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_lines, "MAX_LINE_BYTES", 200)
    (tmp_path / "a").write_bytes(b"x" * (length - 1) + b"\nyy\n")
    first, second = log_lines.read_lines(tmp_path / "a")
    assert (first.too_long, first.number, second.data, second.number) == (length > 200, 1, b"yy", 2)


NO_LOGS: dict[str, tuple[Callable[[Path], object], str]] = {
    "not there": (lambda path: None, "a.log: found no such file, expected a log"),
    "a folder": (lambda path: path.mkdir(), "found a folder, expected a log file$"),
    "a pipe that never begins": (os.mkfifo, "a.log: found no regular file, expected a log"),
    "empty": (lambda path: path.touch(), "found an empty file, expected a log"),
}
for _data in (bytes(range(256)), b"\x00\x01\x02\n", b"\x89PNG\r\n\x1a\n"):
    NO_LOGS[repr(_data[:4])] = (
        lambda path, data=_data: path.write_bytes(data),
        "a.log:1: found (bytes that are not UTF-8|binary data)",
    )


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_header(path)
    return str(caught.value)


@pytest.mark.parametrize("name", NO_LOGS)
def test_what_is_no_log_at_all(tmp_path: Path, name: str) -> None:
    make, told = NO_LOGS[name]
    make(tmp_path / "a.log")
    found = refusal(tmp_path / "a.log")
    assert re.search(told, found)
    assert "\n" not in found


def test_devices_sockets_and_folders_with_a_log(write_log: WriteLog, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_log()
    assert f"found a folder, expected a log file; did you mean {path}" in refusal(path.parent)
    assert refusal(Path("/dev/zero")).startswith("/dev/zero: found no regular file, expected a log")
    monkeypatch.chdir(path.parent)  # a socket's path is short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("a.log")
        assert "a.log: found no regular file, expected a log" in refusal(Path("a.log"))
