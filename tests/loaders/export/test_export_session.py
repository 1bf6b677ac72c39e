"""Any session as MCAP or a native log: what is read back is what the filter was given before."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader

from helpers.recordings import Given, assert_same_drive
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.export.session import Converted, convert_to_log, convert_to_mcap
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import (
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    TruthPose,
)
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import with_frames
from maurice_loaders.session_log.header import header_to_json
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import Camera, Frame, Moment, SessionInfo

pytest.importorskip("rosbags")


TRIANGLE = Region("sofa", np.array([[0.1, 0.2], [0.9, 0.2], [0.5, 1.7]]))
INFO = SessionInfo(
    "made",
    "in",
    "Maurice",
    {"model": "maurice", "turn_gain": 0.7302},
    (Camera("front", 4, 3, 0.785, 0.1, 0.25), Camera("rear")),
    np.array([0.1, 0.2, 1 / 3]),
    Path("survey.log"),
    Arena((0.0, -1.0, 3.0, 2.0), np.array([[0.0, 0.0, 1.0, 1.0]]), (TRIANGLE,)),
    ("an example",),
)


def painted(seed: int) -> U8:
    return np.random.default_rng(seed).integers(0, 256, (3, 4, 3), dtype=np.uint8)


NUMBER = st.floats(-1e3, 1e3)
POSE = st.tuples(NUMBER, NUMBER, st.floats(-3, 3)).map(np.array)
STEP_S = st.sampled_from([0.0, 0.0, 0.1, 0.25, 1.5])
BEGIN_S = st.sampled_from([0.0, 12.5, 1403636591.25])


@st.composite
def recordings(draw: st.DrawFn, odometry: type[Motion | OdometryPose]) -> Given:
    t_s, records = draw(BEGIN_S), []
    for number, kind in enumerate(draw(st.lists(st.sampled_from("oooptnr"), min_size=1, max_size=20))):
        t_s += draw(STEP_S)
        if kind == "o":
            records.append(odometry(t_s, draw(POSE)))
        elif kind == "t":
            records.append(TruthPose(t_s, draw(POSE)))
        elif kind == "r":
            values = st.dictionaries(st.sampled_from(["a", "b", "ir/é"]), NUMBER, min_size=1)
            records.append(Readings(t_s, draw(values)))
        elif kind == "n":
            records.append(Note(t_s, draw(st.sampled_from(["bump", "kidnapped", "lights off"]))))
        else:
            records.append(Picture(t_s, partial(painted, number), f"{number}"))
    return Given(records, INFO)


def finished(session: RecordedSession, file: Path, **options: object) -> Converted:
    (*_, done) = convert_to_mcap(session, file, **options)  # type: ignore[arg-type]  # passed on
    return done


def rounding_of(made: Given) -> float:
    """How far a pose may be off: 2 km in 0.1 s, and Unix times are no finer than 0.2 us."""
    return 1e-6 + 2e3 / 0.1 * float(np.spacing(made.held[0].t_s))


def assert_same_header(ours: SessionInfo, theirs: SessionInfo, folder: Path) -> None:
    assert header_to_json(theirs, "session", folder) == header_to_json(ours, "session", folder)


KEEP = settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])


@given(recordings(Motion))
@KEEP
def test_a_drive_of_motions_is_read_back_to_the_last_bit(tmp_path: Path, made: Given) -> None:
    session, file = RecordedSession(with_frames(made)), tmp_path / "a.mcap"
    done = finished(session, file, force=True)
    counted = (Picture, Motion, TruthPose, Note, Readings)
    kinds = [sum(isinstance(r, kind) for r in made.held) for kind in counted]
    assert [done.pictures, done.motions, done.truths, done.events, done.readings] == kinds
    if any(not isinstance(record, Note) for record in made.held):
        again = open_session(file)
        assert_same_drive(session, again, rounding_of(made), time=1e-6)
        assert_same_header(replace(INFO, survey=tmp_path / "survey.log"), again.info, tmp_path)


@given(recordings(OdometryPose))
@KEEP
def test_a_drive_of_poses_is_read_back(tmp_path: Path, made: Given) -> None:
    if not any(isinstance(record, OdometryPose) for record in made.held):
        return
    session, file = RecordedSession(with_frames(made), Reading(max_dt_s=1e6)), tmp_path / "a.mcap"
    finished(session, file, force=True)
    again, rounding = open_session(file, Reading(max_dt_s=1e6)), rounding_of(made)
    # what lies between poses is theirs by its time
    assert_same_drive(session, again, rounding, motion=rounding, time=1e-6)


def test_a_log_comes_back_from_mcap_as_it_was(small_session: Path, tmp_path: Path) -> None:
    finished(RecordedSession(open_recording(small_session)), tmp_path / "a.mcap")
    again = open_session(tmp_path / "a.mcap")
    list(convert_to_log(again, tmp_path / "back" / "b.log"))
    assert_same_drive(
        open_session(small_session), open_session(tmp_path / "back" / "b.log"), truth=1e-6, time=1e-6
    )
    assert_same_header(
        open_session(small_session).info, open_session(tmp_path / "back" / "b.log").info, tmp_path
    )


def test_several_motions_stay_apart_at_their_own_times(tmp_path: Path) -> None:
    motions = [np.array([0.1 * k, 0.0, 0.3]) for k in (1, 2, 3)]
    drive = [Motion(5.0 + k, motion) for k, motion in enumerate(motions)]
    made = Given((*drive, Picture(9.0, partial(painted, 1), "1")), INFO)
    finished(RecordedSession(made), tmp_path / "a.mcap")
    (moment,) = open_session(tmp_path / "a.mcap").moments()
    assert moment.frame.motions.tolist() == [motion.tolist() for motion in motions]
    assert moment.frame.time_s == 4.0
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        found = [(c.topic, t_ns) for c, t_ns, _ in reader.messages() if c.topic == "/odom"]
        latched = {c.topic for c in reader.connections if c.ext.offered_qos_profiles}
    assert [t_ns // 10**9 for _, t_ns in found] == [5, 5, 6, 7, 9]
    assert latched == {"/session/header", "/map", "/tf_static"}


def test_the_robot_stands_at_the_start_and_then_at_the_truth(tmp_path: Path) -> None:
    truth = np.array([2.0, 1.0, -0.5])
    held = (OdometryPose(0.0, np.array([9.0, 9.0, 1.0])), TruthPose(1.0, truth))
    finished(RecordedSession(Given(held, INFO)), tmp_path / "a.mcap")
    believed = Reading(odometry_topic="/tf:map.base_link", truth_topic="none")
    poses = [r.pose for r in open_recording(tmp_path / "a.mcap", believed).records(ReadingNotes(False))]
    assert poses[0] == pytest.approx(INFO.start)
    assert poses[-1] == pytest.approx(truth)


def test_only_pictures_that_make_an_update_are_written(tmp_path: Path) -> None:
    held: list[Record] = []
    for k in range(6):
        held += [Motion(k, np.array([0.1, 0, 0])), Picture(k, partial(painted, k), f"{k}")]
    session = RecordedSession(Given(held, INFO), Reading(min_distance_m=0.25))
    done = finished(session, tmp_path / "a.mcap")
    assert (done.pictures, done.motions) == (2, 6)
    assert_same_drive(session, open_session(tmp_path / "a.mcap"), truth=1e-6, time=1e-6)


def test_motions_give_way_to_an_odometry_that_is_asked_for(small_session: Path, tmp_path: Path) -> None:
    finished(RecordedSession(open_recording(small_session)), tmp_path / "a.mcap")
    asked = Reading(odometry_topic="/odom")
    drive: list[Moment] = list(open_session(tmp_path / "a.mcap", asked).moments())
    for one, other in zip(open_session(small_session).moments(), drive, strict=True):
        assert other.frame.motions == pytest.approx(one.frame.motions, abs=1e-9)


def test_nothing_to_write_and_a_damaged_session_leave_nothing(small_session: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(InputError, match="nothing to write"):
        finished(RecordedSession(Given((), INFO)), out / "a.mcap")
    with small_session.open("a") as log:
        log.write("{broken}\n")
    with pytest.raises(InputError, match="broken JSON"):
        finished(RecordedSession(open_recording(small_session)), out / "a.mcap")
    assert not list(out.iterdir())


NAMED = SessionInfo("made")


@dataclass(frozen=True)
class MadeDrive:
    """A session of moments that were put together here."""

    drive: tuple[Moment, ...]
    info: SessionInfo = NAMED

    def moments(self) -> Iterator[Moment]:
        return iter(self.drive)


UPDATE = st.tuples(
    st.floats(1.1, 5),  # seconds since the one before: too far apart for truth to be joined
    st.lists(POSE, max_size=3),
    st.none() | POSE,
    st.lists(st.sampled_from(["bump", "kidnapped", "lights off"]), max_size=2),
)


@st.composite
def drives(draw: st.DrawFn) -> MadeDrive:
    moments, t_s = [], 0.0
    for step, (gap_s, motions, truth, events) in enumerate(draw(st.lists(UPDATE, min_size=1, max_size=5)), 1):
        t_s += gap_s if step > 1 or motions or events or truth is not None else 0
        image = np.random.default_rng(step).integers(0, 256, (3, 4, 3), dtype=np.uint8)
        frame = Frame(step, t_s, np.array(motions, np.float64).reshape(-1, 3), image, f"{step}")
        moments.append(Moment(frame, truth, tuple(events)))
    return MadeDrive(tuple(moments))


def finished_log(going: Iterable[Converted]) -> Converted:
    return list(going)[-1]


@given(drives())
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_replays_as_the_session_it_was_made_from(tmp_path: Path, drive: MadeDrive) -> None:
    file = tmp_path / "a.log"
    finished_log(convert_to_log(drive, file, force=True))
    assert_same_drive(drive, open_session(file))


def test_a_native_log_stays_what_it_was(small_session: Path, tmp_path: Path) -> None:
    session = open_session(small_session)
    done = finished_log(convert_to_log(session, tmp_path / "copy" / "b.log", begin_s=1403636591.25))
    again = open_session(tmp_path / "copy" / "b.log")
    assert (done.pictures, done.motions, done.truths, done.events) == (14, 14, 14, 0)
    assert_same_drive(session, again)
    assert again.info.survey == session.info.survey
    assert again.info.arena is not None
    first = json.loads((tmp_path / "copy" / "b.log").read_text().splitlines()[1])
    assert first["t"] == 1403636591.25
    names = sorted(file.name for file in (tmp_path / "copy").iterdir())
    assert names == ["b-pictures", "b.log"]


def test_jpeg_is_written_when_asked_for_and_a_log_can_be_converted_onto_itself(
    small_session: Path, tmp_path: Path
) -> None:
    finished_log(convert_to_log(open_session(small_session), tmp_path / "b.log", kind="jpeg"))
    assert {file.suffix for file in (tmp_path / "b-pictures").iterdir()} == {".jpg"}
    assert next(iter(open_session(tmp_path / "b.log").moments())).frame.image.shape == (30, 40, 3)
    drive = list(open_session(small_session).moments())
    for _ in range(2):
        finished_log(convert_to_log(open_session(small_session), small_session, force=True))
    assert_same_drive(MadeDrive(tuple(drive)), open_session(small_session))


def test_a_broken_session_leaves_nothing_and_keeps_what_was_there(
    small_session: Path, tmp_path: Path
) -> None:
    finished_log(convert_to_log(open_session(small_session), tmp_path / "b.log"))
    before = (tmp_path / "b.log").read_bytes()
    with small_session.open("a") as log:
        log.write("{broken}\n")
    listed = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match="broken JSON"):
        finished_log(convert_to_log(open_session(small_session), tmp_path / "b.log", force=True))
    assert (tmp_path / "b.log").read_bytes() == before
    assert sorted(tmp_path.rglob("*")) == listed


def test_a_folder_for_nothing_is_not_left(small_session: Path, tmp_path: Path) -> None:
    picture = next(
        path for path in sorted(small_session.parent.rglob("*")) if path.suffix in (".jpg", ".png")
    )
    picture.write_bytes(b"broken")
    with pytest.raises(InputError):
        list(convert_to_log(open_session(small_session), tmp_path / "made" / "a.log"))
    assert not (tmp_path / "made").exists()
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError):
        list(convert_to_log(open_session(small_session), tmp_path / "there" / "a.log"))
    assert list((tmp_path / "there").iterdir()) == []


def test_somebody_elses_folder_of_pictures_is_not_removed(small_session: Path, tmp_path: Path) -> None:
    (tmp_path / "b-pictures").mkdir()
    (tmp_path / "b-pictures" / "holiday.jpg").write_bytes(b"")
    for force, said in ((False, "--force"), (True, "remove it yourself")):
        with pytest.raises(InputError, match=said):
            finished_log(convert_to_log(open_session(small_session), tmp_path / "b.log", force=force))
    assert not (tmp_path / "b.log").exists()
