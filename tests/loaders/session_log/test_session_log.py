"""The reader's contract: what comes out, lazily, again and again."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from helpers import expect_facts
from maurice_loaders.errors import InputError
from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.session import Frame, Moment, Session, SessionInfo

from ..conftest import WriteLog

Pixel = dict[str, Any]
CAMERAS = {"cameras": {"front": {}, "rear": {}}}


def moments(path: Path, **options: Any) -> list[Moment]:
    return list(open_session(path, **options).moments())


def test_a_whole_drive(write_log: WriteLog, pixel: Pixel) -> None:
    path = write_log(
        {"t": 100.0, "truth": [1, 2, 3]},
        {"t": 100.0, "image": pixel},
        {"t": 101.0, "odometry": [0.5, 0, 0], "encoders_m": [1, 2, 3, 4]},
        {"t": 101.5, "odometry": [0, 0, 1.5]},
        {"t": 101.5, "event": "lights off"},
        {"t": 102.0, "image": pixel, "covered": True},
        {"t": 102.0, "event": "floor wood"},
        {"t": 102.5, "image": pixel},
        {"t": 103.0, "image": pixel},
    )
    found = moments(path)
    assert [(m.frame.step, m.frame.time_s) for m in found] == [(1, 0), (2, 2.5), (3, 3)]
    assert [m.frame.motions.tolist() for m in found] == [[], [[0.5, 0, 0], [0, 0, 1.5]], []]
    assert found[0].frame.motions.shape == (0, 3)
    assert [m.events for m in found] == [(), ("lights off", "floor wood"), ()]
    assert [None if m.truth is None else m.truth.tolist() for m in found] == [[1, 2, 3], None, None]
    assert found[0].frame.image.tolist() == [[[10, 20, 30], [40, 50, 60]]]


def test_an_overview_opens_no_picture_and_a_frame_has_no_room_for_truth(write_log: WriteLog) -> None:
    drive = [{"t": 0, "image": "gone.jpg"}, {"t": 0, "image": "cap.jpg", "covered": True}]
    drive.append({"t": 0, "image": "left.jpg", "camera": "left"})
    drive.append({"t": 0, "image": "right.jpg", "camera": "right"})
    assert open_session(write_log(*drive)).overview() == (2, False)
    assert open_session(write_log(*drive, {"t": 1, "truth": [0, 0, 0]}), camera="right").overview() == (
        2,
        True,
    )
    assert set(Frame.__slots__) == {"step", "time_s", "motions", "image", "picture", "readings", "scan"}


def test_starts_again_on_every_call(write_log: WriteLog, pixel: Pixel) -> None:
    log: Session = open_session(write_log(*({"t": t, "image": pixel} for t in range(3))))
    one, other = log.moments(), log.moments()
    assert [next(one).frame.step, next(one).frame.step, next(other).frame.step] == [1, 2, 1]
    assert len(list(log.moments())) == 3


def test_reads_pictures_only_as_asked(write_log: WriteLog, tmp_path: Path, image: U8) -> None:
    path = write_log(*({"t": t, "image": f"{t}.jpg"} for t in range(1000)))
    (tmp_path / "0.jpg").write_bytes(encode_jpeg(image))
    (tmp_path / "1.jpg").write_bytes(encode_jpeg(image))
    reading = open_session(path).moments()
    assert [next(reading).frame.picture, next(reading).frame.picture] == ["0.jpg", "1.jpg"]
    with pytest.raises(InputError, match=r"session\.log:4: 2\.jpg: found no such picture"):
        next(reading)


def test_removing_truth_and_events_changes_no_frame(write_log: WriteLog, pixel: Pixel) -> None:
    records = [
        {"t": 0, "truth": [0, 0, 0]},
        {"t": 0, "odometry": [1, 0, 0]},
        {"t": 1, "image": pixel},
        {"t": 1, "event": "kidnapped"},
        {"t": 2, "image": pixel},
    ]
    without = [r for r in records if not {"truth", "event"} & r.keys()]
    frames = [m.frame for m in moments(write_log(*records))]
    bare = [m.frame for m in moments(write_log(*without, name="bare.log"))]
    assert len(frames) == len(bare) == 2
    for a, b in zip(frames, bare, strict=True):
        assert (a.step, a.time_s, a.picture) == (b.step, b.time_s, b.picture.replace("bare", "session"))
        assert np.array_equal(a.motions, b.motions)
        assert np.array_equal(a.image, b.image)


def test_keep_going_counts_all_keeps_some_and_carries_movements_on(write_log: WriteLog, pixel: Pixel) -> None:
    path = write_log(
        {"t": 0, "odometry": [1, 0, 0]},
        "{broken",
        {"t": 1, "image": "gone.jpg"},
        {"t": 2, "odometry": [2, 0, 0]},
        {"t": 1, "image": pixel},
        {"t": 3, "image": pixel},
    )
    log = open_session(path, keep_going=True)
    (moment,) = log.moments()
    assert moment.frame.step == 1
    assert moment.frame.motions[:, 0].tolist() == [1, 2]
    assert log.problem_count == 3
    assert [problem.line for problem in log.problems] == [3, 4, 6]
    list(log.moments())
    assert log.problem_count == 3  # of the last reading, not of both
    log = open_session(write_log(*["nonsense"] * 250), keep_going=True)
    assert list(log.moments()) == []
    assert (log.problem_count, len(log.problems)) == (250, 100)


@pytest.mark.parametrize("tail", ['{"t": 1, "ima', '{"t": 1', '{"t": 1, "event": "caf\xc3'])
def test_an_unfinished_last_line_is_a_warning(write_log: WriteLog, pixel: Pixel, tail: str) -> None:
    path = write_log({"t": 0, "image": pixel})
    path.write_bytes(path.read_bytes() + tail.encode("latin-1"))
    log = open_session(path)
    assert len(list(log.moments())) == 1
    expect_facts(log.warnings[0], f"{path}:3: ", "unfinished", "left out")
    assert log.problem_count == 0


def test_a_last_line_without_its_end_counts_when_it_is_whole(write_log: WriteLog, pixel: Pixel) -> None:
    for record in ({"t": 0, "image": pixel}, {"t": 0, "truth": [1, 2]}):
        path = write_log(record)
        path.write_bytes(path.read_bytes().rstrip(b"\n"))
        if "truth" in record:
            with pytest.raises(InputError, match=r"log:2: found truth .*, expected a list of 3 numbers"):
                moments(path)
        else:
            log = open_session(path)
            assert len(list(log.moments())) == 1
            assert not any("unfinished" in warning for warning in log.warnings)


def test_a_log_that_grows_is_read_on_the_next_call(tmp_path: Path, image: U8) -> None:
    with SessionWriter(tmp_path / "a.log", SessionInfo("a")) as writer:
        log = open_session(tmp_path / "a.log")
        writer.image(0, image)
        assert len(list(log.moments())) == 1
        writer.image(1, image)
        assert len(list(log.moments())) == 2


def test_unknown_keys_blank_lines_windows_ends_and_a_byte_order_mark(tmp_path: Path, pixel: Pixel) -> None:
    header = {"format": "maurice-session-log", "version": 1, "kind": "session", "color": "red"}
    lines = [header, "", {"t": 0, "image": pixel, "battery": 0.5}]
    text = "".join((json.dumps(line) if line else "") + "\r\n" for line in lines)
    path = tmp_path / "s.log"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert open_session(path).info.name == "s"
    assert len(moments(path)) == 1


def test_names_beyond_ascii(tmp_path: Path, image: U8) -> None:
    folder = tmp_path / "Büro Łódź 部屋"
    with SessionWriter(folder / "Fahrt ä.log", SessionInfo("Küche 台所")) as writer:
        writer.image(0, image, name="Bild ß 写真")
        writer.event(1, "floor Teppich 絨毯")
        writer.image(2, image)
    log = open_session(folder / "Fahrt ä.log")
    first, second = log.moments()
    assert log.info.name == "Küche 台所"
    assert first.frame.picture == "pictures/Bild ß 写真.jpg"
    assert second.events == ("floor Teppich 絨毯",)


@pytest.mark.parametrize(
    ("header", "camera", "times"),
    [
        (CAMERAS, None, [1, 3]),
        (CAMERAS, "front", [1, 3]),
        (CAMERAS, "rear", [0, 2, 3]),
        ({}, None, [0, 2, 3]),
    ],
)
def test_one_camera_is_read(
    write_log: WriteLog, pixel: Pixel, header: dict[str, Any], camera: str | None, times: list[float]
) -> None:
    names = ("rear", "front", "rear", None)
    records = [{"t": t, "image": pixel} | ({"camera": c} if c else {}) for t, c in enumerate(names)]
    log = open_session(write_log(*records, **header), camera=camera)
    assert [m.frame.time_s for m in log.moments()] == times
    assert "are left out" in log.warnings[0]
    with pytest.raises(InputError, match="found cameras front, rear, expected 'top' among them"):
        open_session(write_log(**CAMERAS), camera="top")


def test_surveys(survey: Path, write_log: WriteLog, pixel: Pixel) -> None:
    log = SurveyLog(survey)
    pictures = list(log.survey_pictures())
    assert [p.covered for p in pictures] == [True, True, *[False] * 5]
    assert [p.pose is None for p in pictures] == [True, True, *[False] * 5]
    assert pictures[2].path == survey.parent / "pictures/survey-00003.jpg"
    assert log.count_pictures() == 7
    with pytest.raises(InputError, match="found a survey log, expected a session log"):
        open_session(survey)
    with pytest.raises(InputError, match="found a session log, expected a survey log"):
        SurveyLog(write_log())
    inline = write_log({"t": 0, "image": pixel, "pose": [1, 2, 3]}, kind="survey")
    (picture,) = SurveyLog(inline).survey_pictures()
    assert picture.path is None
    assert picture.pose is not None


def of_base64(data: bytes) -> dict[str, str]:
    return {"base64": base64.b64encode(data).decode()}


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        ("no.jpg", r"log:2: no\.jpg: found no such picture"),
        (".", "log:2: .*found no such picture"),
        ("cut.jpg", r"log:2: cut\.jpg: found a cut JPEG"),
        ({"base64": "?!"}, "log:2: .*found broken base64"),
        (of_base64(b"no picture"), "log:2: .*expected JPEG, PNG, WebP or BMP"),
        ("a\0b", "log:2: .*(no such picture|cannot be read)"),
        ("a\nb.jpg", r"log:2: a b\.jpg: found no such picture"),
        ("depth.png", "16 bits a channel, expected 8"),
    ],
)
def test_broken_pictures(write_log: WriteLog, tmp_path: Path, image: U8, picture: object, told: str) -> None:
    (tmp_path / "cut.jpg").write_bytes(encode_jpeg(image)[:-40])
    cv2.imwrite(str(tmp_path / "depth.png"), np.zeros((4, 4), np.uint16))
    with pytest.raises(InputError, match=told):
        moments(write_log({"t": 0, "image": picture}))


HALF = {"motion": {"a": "\ud800"}}, {"motion": {"\ud800": 1}}


@pytest.mark.parametrize("header", [{"robot": HALF[0]}, {"robot": HALF[1]}, {"cameras": {"\ud800": {}}}])
def test_half_a_character_in_a_header_is_refused(write_log: WriteLog, header: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"session.log:1: found half a character in"):
        open_session(write_log(**header))
