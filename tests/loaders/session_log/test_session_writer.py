"""What is written is what is read; nothing is overwritten, nothing impossible is written."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.io.pictures import encode_jpeg
from maurice_loaders.session_log.reader import SessionLog
from maurice_loaders.session_log.records import (
    EventRecord,
    OdometryRecord,
    PictureRecord,
    TruthRecord,
    read_header,
    read_records,
)
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.arrays import U8
from maurice_mcl.session import SessionInfo

INFO = SessionInfo("drive")
finite = st.floats(-1e9, 1e9)
vector = st.lists(finite, min_size=3, max_size=3)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1)
records = st.one_of(
    st.tuples(st.just("odometry"), vector),
    st.tuples(st.just("truth"), vector),
    st.tuples(st.just("event"), texts),
    st.tuples(st.just("image"), st.booleans()),
)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(0, 3e8), records), max_size=12), texts)
def test_comes_back_exactly(tmp_path_factory: Any, steps: list[tuple[float, Any]], name: str) -> None:
    path = tmp_path_factory.mktemp("log") / "a.log"
    times = np.cumsum([step for step, _ in steps]).tolist()
    with SessionWriter(path, SessionInfo(name)) as writer:
        for t_s, (_, (kind, value)) in zip(times, steps, strict=True):
            if kind == "image":
                writer.image_path(t_s, "a.jpg", covered=value)
            else:
                getattr(writer, kind)(t_s, value)
    assert read_header(path)[0].name == name
    found: list[tuple[float, Any]] = []
    for record in read_records(path, "session", ReadingNotes(keep_going=False)):
        match record:
            case OdometryRecord():
                found.append((record.t_s, ("odometry", record.motion.tolist())))
            case TruthRecord():
                found.append((record.t_s, ("truth", record.pose.tolist())))
            case EventRecord():
                found.append((record.t_s, ("event", record.text)))
            case PictureRecord():
                found.append((record.t_s, ("image", record.covered)))
    assert found == [(t_s, value) for t_s, (_, value) in zip(times, steps, strict=True)]


def test_encoders_are_kept(tmp_path: Path) -> None:
    with SessionWriter(tmp_path / "a.log", INFO) as writer:
        writer.odometry(0, np.array([1.0, 2.0, 3.0]), encoders_m=(0.1, 0.2, 0.3, 0.4))
    (record,) = read_records(tmp_path / "a.log", "session", ReadingNotes(keep_going=False))
    assert isinstance(record, OdometryRecord)
    assert record.encoders_m is not None
    assert record.encoders_m.tolist() == [0.1, 0.2, 0.3, 0.4]


def test_pictures_are_numbered_and_read_back(tmp_path: Path, image: U8) -> None:
    with SessionWriter(tmp_path / "a.log", INFO) as writer:
        names = [writer.image(0, image), writer.image(1, image[:8]), writer.image(2, image, name="mine")]
    assert names == ["pictures/a-00001.jpg", "pictures/a-00002.jpg", "pictures/mine.jpg"]
    first, second, _ = SessionLog(tmp_path / "a.log").moments()
    jpeg = cv2.imdecode(np.frombuffer(encode_jpeg(image), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(first.frame.image, cv2.cvtColor(jpeg, cv2.COLOR_BGR2RGB))
    assert second.frame.image.shape == (8, 16, 3)


def test_two_logs_in_one_folder_do_not_share_pictures(tmp_path: Path, image: U8) -> None:
    for stem in ("session", "survey"):
        with SessionWriter(tmp_path / f"{stem}.log", INFO) as writer:
            writer.image(0, image)
    assert len(list((tmp_path / "pictures").iterdir())) == 2


def test_every_line_is_there_at_once(tmp_path: Path, image: U8) -> None:
    path = tmp_path / "a.log"
    with SessionWriter(path, INFO) as writer:
        for k in range(1, 4):
            writer.event(k, "hello")
            assert path.read_bytes().count(b"\n") == k + 1
            assert path.read_bytes().endswith(b"\n")


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
    assert len(list(SessionLog(path).moments())) == 1


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="found a file, expected a folder"):
        SessionWriter(tmp_path / "file" / "a.log", INFO)
    (tmp_path / "folder.log").mkdir()
    with pytest.raises(InputError, match=r"folder\.log: cannot be written"):
        SessionWriter(tmp_path / "folder.log", INFO, force=True)


class TestValuesThatNoLogMayHold:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        return tmp_path / "a.log"

    def test_are_refused_and_leave_the_log_whole(self, path: Path, image: U8) -> None:
        with SessionWriter(path, INFO) as writer:
            writer.event(5, "begin")
            with pytest.raises(ValueError, match="not before 5"):
                writer.event(4, "too early")
            with pytest.raises(ValueError, match="finite time"):
                writer.event(float("nan"), "never")
            with pytest.raises(ValueError, match="expected 3 finite numbers"):
                writer.truth(6, [0, float("inf"), 0])
            with pytest.raises(ValueError, match="expected 3 finite numbers"):
                writer.odometry(6, [0, 0])
            with pytest.raises(ValueError, match="expected 4 finite numbers"):
                writer.odometry(6, [0, 0, 0], encoders_m=[1, 2])
            with pytest.raises(ValueError, match="expected each a number up to 1e9 in size"):
                writer.odometry(6, [0, 0, -1e300])
            with pytest.raises(ValueError, match="expected a number up to 4e9 in size"):
                writer.event(1e10, "too late")
            with pytest.raises(ValueError, match="a pose goes with"):
                writer.image(6, image, pose=[0, 0, 0])
            writer.event(6, "end")
        assert len(path.read_text().splitlines()) == 3
        assert not (path.parent / "pictures").exists()

    def test_a_survey_wants_poses_unless_covered(self, path: Path, image: U8) -> None:
        with SessionWriter(path, INFO, "survey") as writer:
            with pytest.raises(ValueError, match="a pose goes with"):
                writer.image(0, image)
            with pytest.raises(ValueError, match="a pose goes with"):
                writer.image(0, image, covered=True, pose=[0, 0, 0])
            writer.image(0, image, covered=True)
            writer.image_path(1, "b.jpg", pose=[0, 0, 0])
        assert [json.loads(line).get("pose") for line in path.read_text().splitlines()[1:]] == [
            None,
            [0, 0, 0],
        ]

    def test_a_header_with_nan_touches_no_file(self, path: Path) -> None:
        with pytest.raises(ValueError, match="JSON compliant"):
            SessionWriter(path, SessionInfo("a", motion={"gain": float("nan")}))
        assert not path.exists()
