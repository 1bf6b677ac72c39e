"""A session as a native log: what a replay of it sees."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.export.session import Converted, convert_to_log
from maurice_loaders.session_log.reader import SessionLog
from maurice_mcl.session import Frame, Moment, Session, SessionInfo

MADE = SessionInfo("made")


@dataclass(frozen=True)
class Made:
    """A session of moments that were put together here."""

    drive: tuple[Moment, ...]
    info: SessionInfo = MADE

    def moments(self) -> Iterator[Moment]:
        return iter(self.drive)


NUMBER = st.floats(-1e3, 1e3)
POSE = st.tuples(NUMBER, NUMBER, st.floats(-3, 3)).map(np.array)
UPDATE = st.tuples(
    st.floats(1.1, 5),  # seconds since the one before: too far apart for truth to be joined
    st.lists(POSE, max_size=3),
    st.none() | POSE,
    st.lists(st.sampled_from(["bump", "kidnapped", "lights off"]), max_size=2),
)


@st.composite
def drives(draw: st.DrawFn) -> Made:
    moments, t_s = [], 0.0
    for step, (gap_s, motions, truth, events) in enumerate(draw(st.lists(UPDATE, min_size=1, max_size=5)), 1):
        t_s += gap_s if step > 1 or motions or events or truth is not None else 0
        image = np.random.default_rng(step).integers(0, 256, (3, 4, 3), dtype=np.uint8)
        frame = Frame(step, t_s, np.array(motions, np.float64).reshape(-1, 3), image, f"{step}")
        moments.append(Moment(frame, truth, tuple(events)))
    return Made(tuple(moments))


def finished(going: Iterable[Converted]) -> Converted:
    return list(going)[-1]


def assert_same(ours: Session, theirs: Session) -> None:
    for one, other in zip(ours.moments(), theirs.moments(), strict=True):
        assert one.frame.step == other.frame.step
        assert one.frame.time_s == other.frame.time_s
        assert one.frame.motions.tolist() == other.frame.motions.tolist()
        assert one.frame.image.tolist() == other.frame.image.tolist()
        assert one.events == other.events
        assert (one.truth is None) == (other.truth is None)
        if one.truth is not None and other.truth is not None:
            assert one.truth.tolist() == other.truth.tolist()


@given(drives())
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_replays_as_the_session_it_was_made_from(tmp_path: Path, drive: Made) -> None:
    file = tmp_path / "a.log"
    finished(convert_to_log(drive, file, force=True))
    assert_same(drive, SessionLog(file))


def test_a_native_log_stays_what_it_was(small_session: Path, tmp_path: Path) -> None:
    session = SessionLog(small_session)
    done = finished(convert_to_log(session, tmp_path / "copy" / "b.log", t_offset_s=1403636591.25))
    again = SessionLog(tmp_path / "copy" / "b.log")
    assert (done.pictures, done.motions, done.truths, done.events) == (14, 14, 14, 0)
    assert_same(session, again)
    assert again.info.survey == session.info.survey
    assert again.info.arena is not None
    first = json.loads((tmp_path / "copy" / "b.log").read_text().splitlines()[1])
    assert first["t"] == 1403636591.25
    names = sorted(file.name for file in (tmp_path / "copy").iterdir())
    assert names == ["b-pictures", "b.log"]


def test_jpeg_is_written_when_asked_for(small_session: Path, tmp_path: Path) -> None:
    finished(convert_to_log(SessionLog(small_session), tmp_path / "b.log", kind="jpeg"))
    assert {file.suffix for file in (tmp_path / "b-pictures").iterdir()} == {".jpg"}
    assert next(iter(SessionLog(tmp_path / "b.log").moments())).frame.image.shape == (30, 40, 3)


def test_a_log_can_be_converted_onto_itself(small_session: Path, tmp_path: Path) -> None:
    drive = list(SessionLog(small_session).moments())
    for _ in range(2):
        finished(convert_to_log(SessionLog(small_session), small_session, force=True))
    assert_same(Made(tuple(drive)), SessionLog(small_session))


def test_a_broken_session_leaves_nothing_and_keeps_what_was_there(
    small_session: Path, tmp_path: Path
) -> None:
    finished(convert_to_log(SessionLog(small_session), tmp_path / "b.log"))
    before = (tmp_path / "b.log").read_bytes()
    with small_session.open("a") as log:
        log.write("{broken}\n")
    listed = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match="broken JSON"):
        finished(convert_to_log(SessionLog(small_session), tmp_path / "b.log", force=True))
    assert (tmp_path / "b.log").read_bytes() == before
    assert sorted(tmp_path.rglob("*")) == listed


def test_a_folder_for_nothing_is_not_left(small_session: Path, tmp_path: Path) -> None:
    picture = next(
        path for path in sorted(small_session.parent.rglob("*")) if path.suffix in (".jpg", ".png")
    )
    picture.write_bytes(b"broken")
    with pytest.raises(InputError):
        list(convert_to_log(SessionLog(small_session), tmp_path / "made" / "a.log"))
    assert not (tmp_path / "made").exists()
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError):
        list(convert_to_log(SessionLog(small_session), tmp_path / "there" / "a.log"))
    assert list((tmp_path / "there").iterdir()) == []


def test_somebody_elses_folder_of_pictures_is_not_removed(small_session: Path, tmp_path: Path) -> None:
    (tmp_path / "b-pictures").mkdir()
    (tmp_path / "b-pictures" / "holiday.jpg").write_bytes(b"")
    for force, said in ((False, "--force"), (True, "remove it yourself")):
        with pytest.raises(InputError, match=said):
            finished(convert_to_log(SessionLog(small_session), tmp_path / "b.log", force=force))
    assert not (tmp_path / "b.log").exists()


def test_a_session_without_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no picture"):
        finished(convert_to_log(Made(()), tmp_path / "a.log"))
    assert not list(tmp_path.iterdir())
