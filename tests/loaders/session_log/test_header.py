"""The header keeps everything, and says what is wrong with a bad one."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.session_log.header import header_from_json, header_to_json
from maurice_loaders.session_log.records import read_header
from maurice_mcl.map import Arena, Region
from maurice_mcl.session import Camera, SessionInfo

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


def test_a_relative_survey_is_taken_to_stand_beside_the_log(tmp_path: Path) -> None:
    assert header_to_json(SessionInfo("a", survey=Path("s.log")), "session", tmp_path)["survey"] == "s.log"


def test_the_least_header(tmp_path: Path) -> None:
    found = {"format": "maurice-session-log", "version": 1, "kind": "session"}
    info, kind = header_from_json(found, tmp_path / "drive.log")
    assert (info.name, info.display_units, info.motion, info.arena, kind) == (
        "drive",
        "m",
        None,
        None,
        "session",
    )


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
    "survey with a zero": ({"survey": "a\0b"}, "found survey 'a.x00b', expected the path of a log"),
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
