"""Every way in which a line can be wrong, by name and with its number."""

import os
import socket
from pathlib import Path
from typing import Any

import pytest

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.session_log import records as log_lines
from maurice_loaders.session_log.records import Record, read_header, read_records

from ..conftest import WriteLog


def read(path: Path, *, keep_going: bool = False) -> list[Record]:
    _, kind = read_header(path)
    return list(read_records(path, kind, ReadingNotes(keep_going)))


GOOD = {"t": 5, "event": "fine"}
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
    "nothing known": ({"t": 6, "lidar": []}, "found none, expected exactly one of odometry, image"),
    "two at once": ({"t": 6, "truth": [0, 0, 0], "event": "a"}, "found truth and event, expected exactly"),
    "odometry too short": ({"t": 6, "odometry": [1, 2]}, "expected a list of 3 numbers"),
    "odometry in words": ({"t": 6, "odometry": [1, "2", 3]}, "found odometry '2', expected a finite"),
    "odometry as an object": ({"t": 6, "odometry": {"x": 1}}, "expected a list of 3 numbers"),
    "three encoders": ({"t": 6, "odometry": [1, 2, 3], "encoders_m": [1, 2, 3]}, "expected a list of 4"),
    "truth too long": ({"t": 6, "truth": [1, 2, 3, 4]}, "expected a list of 3 numbers"),
    "truth unknown": ({"t": 6, "truth": None}, "found truth nothing, expected a list"),
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
def test_a_broken_line_is_named_by_file_and_line(write_log: WriteLog, name: str) -> None:
    line, message = BROKEN[name]
    path = write_log(GOOD, line, {"t": 7, "event": "after"})
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}:3: found ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).removeprefix(str(path))) < 250


@pytest.mark.parametrize("name", BROKEN)
def test_keeping_going_skips_that_line_alone(write_log: WriteLog, name: str) -> None:
    path = write_log(GOOD, BROKEN[name][0], {"t": 7, "event": "after"})
    assert [record.t_s for record in read(path, keep_going=True)] == [5, 7]


def test_a_survey_wants_poses(write_log: WriteLog) -> None:
    path = write_log({"t": 0, "image": "a.jpg"}, kind="survey")
    with pytest.raises(InputError, match="log:2: found a picture without its pose"):
        read(path)


def test_a_survey_wants_poses_within_the_bound(write_log: WriteLog) -> None:
    path = write_log({"t": 0, "image": "a.jpg", "pose": [0, 1e300, 0]}, kind="survey")
    with pytest.raises(InputError, match=r"log:2: found pose 1e\+300, expected a number up to 1e9 in size"):
        read(path)


def test_the_largest_numbers_and_unix_time_are_read(write_log: WriteLog) -> None:
    path = write_log({"t": -4e9, "truth": [1e9, -1e9, 0]}, {"t": 1.8e9, "odometry": [-1e9, 1e9, 1e9]})
    assert [record.t_s for record in read(path)] == [-4e9, 1.8e9]


def test_a_covered_picture_needs_none(write_log: WriteLog) -> None:
    assert len(read(write_log({"t": 0, "image": "a.jpg", "covered": True}, kind="survey"))) == 1


def test_bytes_that_are_not_utf8(write_log: WriteLog) -> None:
    path = write_log(GOOD)
    path.write_bytes(path.read_bytes() + b'{"t": 6, "event": "\xff"}\n')
    with pytest.raises(InputError, match="log:3: found bytes that are not UTF-8 at column 20"):
        read(path)


def test_a_line_that_is_too_long(write_log: WriteLog, monkeypatch: pytest.MonkeyPatch) -> None:
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


class TestNoLogAtAll:
    def expect(self, path: Path, message: str) -> None:
        with pytest.raises(InputError, match=message) as caught:
            read_header(path)
        assert "\n" not in str(caught.value)

    def test_not_there(self, tmp_path: Path) -> None:
        self.expect(tmp_path / "no.log", "no.log: found no such file, expected a log")

    def test_a_folder(self, tmp_path: Path) -> None:
        self.expect(tmp_path, "found a folder, expected a log file$")

    def test_a_folder_with_a_log(self, write_log: WriteLog) -> None:
        path = write_log()
        self.expect(path.parent, f"found a folder, expected a log file; did you mean {path}")

    def test_a_device_that_never_ends(self) -> None:
        self.expect(Path("/dev/zero"), "^/dev/zero: found no regular file, expected a log")

    def test_a_pipe_that_never_begins(self, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "a.log")
        self.expect(tmp_path / "a.log", "a.log: found no regular file, expected a log")

    def test_a_socket(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)  # a socket's path is short
        with socket.socket(socket.AF_UNIX) as listening:
            listening.bind("a.log")
            self.expect(Path("a.log"), "a.log: found no regular file, expected a log")

    def test_empty(self, tmp_path: Path) -> None:
        (tmp_path / "a.log").touch()
        self.expect(tmp_path / "a.log", "found an empty file, expected a log")

    @pytest.mark.parametrize("data", [bytes(range(256)), b"\x00\x01\x02\n", b"\x89PNG\r\n\x1a\n"])
    def test_binary(self, tmp_path: Path, data: bytes) -> None:
        (tmp_path / "a.log").write_bytes(data)
        self.expect(tmp_path / "a.log", "a.log:1: found (bytes that are not UTF-8|binary data)")
