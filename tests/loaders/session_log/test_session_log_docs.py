"""The documented format is the one that is read and written."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from maurice_loaders.files.maps import MOST_SPAN_M
from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.files.text import MOST, MOST_T_S
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.records import RECORD_KEYS
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import Camera, SessionInfo

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "session-log.md").read_text(encoding="utf-8")
SESSION, LASER, SURVEY = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
SCHEMA = json.loads((DOCS / "session-log.schema.json").read_text(encoding="utf-8"))


@pytest.fixture
def validator() -> Any:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    return jsonschema.Draft202012Validator(SCHEMA)


def lines_of(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def with_pictures(folder: Path, text: str, image: U8) -> Path:
    """Write an example down, and the pictures that it names."""
    (folder / "pictures").mkdir(exist_ok=True)
    for name in re.findall(r'"(pictures/[^"]+)"', text):
        (folder / name).write_bytes(encode_jpeg(image))
    (folder / "example.log").write_text(text, encoding="utf-8")
    return folder / "example.log"


def test_the_examples_read_as_the_page_says(tmp_path: Path, image: U8) -> None:
    log = open_session(with_pictures(tmp_path, SESSION, image))
    first, second = log.moments()
    assert [first.frame.time_s, second.frame.time_s] == [1.6, 4.0]
    assert [len(first.frame.motions), len(second.frame.motions)] == [1, 2]
    assert first.truth is not None
    assert second.truth is None
    assert second.events == ("lights off",)
    assert dict(second.frame.readings) == {"floor_left": 0.82, "floor_right": 0.11}
    assert log.info.survey == tmp_path / "survey.log"
    (tmp_path / "laser.log").write_text(LASER, encoding="utf-8")
    first, second = open_session(tmp_path / "laser.log").moments()
    np.testing.assert_allclose(second.frame.motions, [[0.3, 0, 0.1]])
    assert first.frame.scan is not None
    np.testing.assert_array_equal(first.frame.scan.hits, [True, True, False, False])
    np.testing.assert_array_equal(first.frame.scan.misses, [False, False, False, True])
    pictures = list(SurveyLog(with_pictures(tmp_path, SURVEY, image)).survey_pictures())
    assert [p.covered for p in pictures] == [True, False, False]


@pytest.mark.parametrize("text", [SESSION, LASER, SURVEY], ids=["session", "laser", "survey"])
def test_the_examples_obey_the_schema(validator: Any, text: str) -> None:
    for line in lines_of(text):
        assert validator.is_valid(line), line


def test_the_page_tells_every_key_and_the_bounds_and_no_option_that_there_is_not() -> None:
    for kind in ("header", "record", "camera", "map", "scan"):
        for key in SCHEMA["$defs"][kind]["properties"]:
            assert f'"{key}":' in SESSION + LASER + SURVEY, key
            assert re.search(rf"`{key}\b|\.{key}`", PAGE), key
    assert all(f"`{key}`" in PAGE for key in RECORD_KEYS)
    assert "at most 1e9 in size, `t` at most 4e9" in PAGE
    assert (MOST, MOST_T_S, MOST_SPAN_M) == (1e9, 4e9, 10_000)
    assert "--camera" not in PAGE


def test_what_the_writer_writes_obeys_the_schema(validator: Any, tmp_path: Path, image: U8) -> None:
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    info = SessionInfo(
        name="all of it",
        display_units="in",
        motion={"turn_gain": 0.73},
        cameras=(Camera("front", 16, 12, 0.8), Camera("rear")),
        start=np.zeros(3),
        survey=tmp_path / "survey.log",
        arena=Arena((0, 0, 1, 1), np.zeros((1, 4)), (Region("sofa", corner),)),
        notes=("one",),
    )
    with SessionWriter(tmp_path / "session.log", info) as writer:
        writer.odometry(0, [1, 0, 0], encoders_m=[1, 1, 1, 1])
        writer.truth(0, [1, 0, 0])
        writer.event(0, "floor wood")
        writer.odometry_pose(0, [1, 0, 0])
        writer.scan(0, LaserScan(np.array([1, np.nan, np.inf], np.float32), -1.0, 1.0, 0.0, 8.0))
        writer.image(1, image, camera="front")
        writer.image(2, image, covered=True)
    with SessionWriter(tmp_path / "survey.log", SessionInfo("least"), "survey") as writer:
        writer.image(1, image, pose=[1, 0, 0])
        writer.image(2, image, covered=True)
    for name in ("session.log", "survey.log"):
        for line in lines_of((tmp_path / name).read_text(encoding="utf-8")):
            validator.validate(line)


@pytest.mark.parametrize(
    "line",
    [
        {"t": 0},
        {"t": 0, "truth": [0, 0]},
        {"t": 0, "truth": [0, 0, 0], "event": "two at once"},
        {"event": "no time"},
        {"t": 0, "image": 5},
        {"t": 5e9, "event": "late"},
        {"t": 0, "truth": [0, 1e300, 0]},
        {"t": 0, "odometry": [-2e9, 0, 0]},
        {"format": "maurice-session-log", "version": 2, "kind": "session"},
        {"format": "maurice-session-log", "version": 1, "kind": "movie"},
        {"format": "maurice-session-log", "version": 1, "kind": "session", "start": [2e9, 0, 0]},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(validator: Any, line: dict[str, Any]) -> None:
    assert not validator.is_valid(line)
