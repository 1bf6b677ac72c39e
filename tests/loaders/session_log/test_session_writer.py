"""What is written is what is read; nothing is overwritten, nothing impossible is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.recording import Motion, Note, OdometryPose, Picture, Record, Scan, TruthPose
from maurice_loaders.session_log.records import LineReader, read_header
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import SessionInfo

INFO = SessionInfo("drive")
finite = st.floats(-1e9, 1e9)
vector = st.lists(finite, min_size=3, max_size=3)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1)
ranges = st.lists(st.floats(-1e9, 1e9, width=32) | st.sampled_from([np.nan, np.inf]), min_size=1, max_size=9)
angles = st.floats(-6, 6)
scans = st.tuples(ranges, angles, angles.filter(bool), st.floats(0, 1), st.floats(2, 100), vector)
records = st.one_of(
    st.tuples(st.just("odometry"), vector),
    st.tuples(st.just("truth"), vector),
    st.tuples(st.just("event"), texts),
    st.tuples(st.just("image"), st.booleans()),
    st.tuples(st.just("odometry_pose"), vector),
    st.tuples(st.just("scan"), scans),
)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(0, 3e8), records), max_size=12), texts)
def test_comes_back_exactly(tmp_path_factory: Any, steps: list[tuple[float, Any]], name: str) -> None:
    path = tmp_path_factory.mktemp("log") / "a.log"
    times = np.cumsum([step for step, _ in steps]).tolist()
    with SessionWriter(path, SessionInfo(name)) as writer:
        for t_s, (_, (kind, value)) in zip(times, steps, strict=True):
            if kind == "scan":
                writer.scan(t_s, LaserScan(np.array(value[0], np.float32), *value[1:5], np.array(value[5])))
            elif kind == "image":
                writer.image_path(t_s, "a.jpg", covered=value)
            else:
                getattr(writer, kind)(t_s, value)
    assert read_header(path)[0].name == name
    found = [(r.t_s, content(r)) for r in LineReader(path).records(ReadingNotes(keep_going=False))]
    assert repr(found) == repr([(t_s, value) for t_s, (_, value) in zip(times, steps, strict=True)])


def content(record: Record) -> tuple[str, object]:
    match record:
        case Motion():
            return "odometry", record.motion.tolist()
        case OdometryPose():
            return "odometry_pose", record.pose.tolist()
        case Scan(scan=scan):
            assert scan.ranges_m.dtype == np.float32
            values = (scan.start_rad, scan.step_rad, scan.min_m, scan.max_m, scan.mount.tolist())
            return "scan", (scan.ranges_m.tolist(), *values)
        case TruthPose():
            return "truth", record.pose.tolist()
        case Note():
            return "event", record.text
        case Picture():
            return "image", record.covered


def test_encoders_are_kept_and_every_line_is_there_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with SessionWriter(path, INFO) as writer:
        for k in range(1, 4):
            writer.odometry(k, np.array([1.0, 2.0, 3.0]), encoders_m=(0.1, 0.2, 0.3, 0.4))
            assert path.read_bytes().count(b"\n") == k + 1
            assert path.read_bytes().endswith(b"\n")
    for record in LineReader(path).records(ReadingNotes(keep_going=False)):
        assert isinstance(record, Motion)
        assert record.encoders_m is not None
        assert record.encoders_m.tolist() == [0.1, 0.2, 0.3, 0.4]


def test_pictures_are_numbered_and_read_back(tmp_path: Path, image: U8) -> None:
    with SessionWriter(tmp_path / "a.log", INFO) as writer:
        names = [writer.image(0, image), writer.image(1, image[:8]), writer.image(2, image, name="mine")]
    assert names == ["pictures/a-00001.jpg", "pictures/a-00002.jpg", "pictures/mine.jpg"]
    with SessionWriter(tmp_path / "other.log", INFO) as writer:
        assert writer.image(0, image) == "pictures/other-00001.jpg"  # logs in one folder share no pictures
    first, second, _ = open_session(tmp_path / "a.log").moments()
    jpeg = cv2.imdecode(np.frombuffer(encode_jpeg(image), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(first.frame.image, cv2.cvtColor(jpeg, cv2.COLOR_BGR2RGB))
    assert second.frame.image.shape == (8, 16, 3)


def test_nothing_is_overwritten_unasked(tmp_path: Path, image: U8) -> None:
    path = tmp_path / "a.log"
    with SessionWriter(path, INFO) as writer:
        writer.image(0, image)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"a\.log: found a log already; .*--force"):
        SessionWriter(path, INFO)
    assert path.read_bytes() == before
    path.unlink()
    with SessionWriter(path, INFO) as writer, pytest.raises(InputError, match="found a picture already"):
        writer.image(0, image)
    with SessionWriter(path, INFO, force=True) as writer:
        writer.image(0, image)
    assert len(list(open_session(path).moments())) == 1


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="found a file, expected a folder"):
        SessionWriter(tmp_path / "file" / "a.log", INFO)
    (tmp_path / "folder.log").mkdir()
    with pytest.raises(InputError, match=r"folder\.log: found a folder"):
        SessionWriter(tmp_path / "folder.log", INFO, force=True)


IMPOSSIBLE: list[tuple[str, tuple[Any, ...], dict[str, Any], str]] = [
    ("event", (4, "too early"), {}, "not before 5"),
    ("event", (float("nan"), "never"), {}, "finite time"),
    ("truth", (6, [0, float("inf"), 0]), {}, "expected 3 finite numbers"),
    ("odometry", (6, [0, 0]), {}, "expected 3 finite numbers"),
    ("odometry", (6, [0, 0, 0]), {"encoders_m": [1, 2]}, "expected 4 finite numbers"),
    ("odometry", (6, [0, 0, -1e300]), {}, "expected each a number up to 1e9 in size"),
    ("event", (1e10, "too late"), {}, "expected a number up to 4e9 in size"),
    ("image", (6, np.zeros((2, 2, 3), np.uint8)), {"pose": [0, 0, 0]}, "a pose goes with"),
]


def test_values_that_no_log_may_hold_are_refused_and_leave_the_log_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with SessionWriter(path, INFO) as writer:
        writer.event(5, "begin")
        for kind, values, options, told in IMPOSSIBLE:
            with pytest.raises(ValueError, match=told):
                getattr(writer, kind)(*values, **options)
        writer.event(6, "end")
    assert len(path.read_text().splitlines()) == 3
    assert not (tmp_path / "pictures").exists()
    with pytest.raises(ValueError, match="JSON compliant"):
        SessionWriter(tmp_path / "b.log", SessionInfo("a", motion={"gain": float("nan")}))
    assert not (tmp_path / "b.log").exists()


def test_a_survey_wants_poses_unless_covered(tmp_path: Path, image: U8) -> None:
    path = tmp_path / "a.log"
    with SessionWriter(path, INFO, "survey") as writer:
        for options in ({}, {"covered": True, "pose": [0, 0, 0]}):
            with pytest.raises(ValueError, match="a pose goes with"):
                writer.image(0, image, **options)
        writer.image(0, image, covered=True)
        writer.image_path(1, "b.jpg", pose=[0, 0, 0])
    poses = [json.loads(line).get("pose") for line in path.read_text().splitlines()[1:]]
    assert poses == [None, [0, 0, 0]]
