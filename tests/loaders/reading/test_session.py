"""Pairing pictures with odometry and truth by time, gating, and the same drive as a native log."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers import expect_facts
from helpers.recordings import Given
from maurice_loaders.doctor.inspection import inspect_file
from maurice_loaders.errors import InputError, PictureError, ReadingNotes
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Motion, Note, OdometryPose, Picture, Record, TruthPose
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import Placeholders
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.geometry import compose, motion_between
from maurice_mcl.values.session import Camera, Moment, SessionInfo

GRAY = np.full((2, 2, 3), 100, np.uint8)


def picture(t_s: float, image: U8 = GRAY) -> Picture:
    return Picture(t_s, lambda: image, f"at {t_s:g}")


def broken(t_s: float) -> Picture:
    def read() -> U8:
        raise PictureError("found a cut picture")

    return Picture(t_s, read, f"at {t_s:g}")


def odometry(t_s: float, x: float, heading: float = 0.0) -> OdometryPose:
    return OdometryPose(t_s, np.array([x, 0.0, heading]))


def truth(t_s: float, x: float) -> TruthPose:
    return TruthPose(t_s, np.array([x, 1.0, 0.0]))


def forward(length_m: float, t_s: float, turn: float = 0.0) -> Motion:
    return Motion(t_s, np.array([length_m, 0.0, turn]))


def play(*records: Record, options: Reading | None = None) -> tuple[list[Moment], RecordedSession]:
    session = RecordedSession(Given(records), options)
    moments = list(session.moments())
    assert session.overview()[0] >= len(moments)
    return moments, session


def test_odometry_is_interpolated_at_the_picture_and_headings_the_short_way() -> None:
    found, _ = play(odometry(0.0, 0.0), picture(0.02), odometry(0.1, 1.0), picture(0.15), odometry(0.2, 3.0))
    np.testing.assert_allclose([m.frame.motions[0, 0] for m in found], [0.2, 1.8])
    assert [m.frame.time_s for m in found] == pytest.approx([0.02, 0.15])
    found, _ = play(odometry(0, 0, 3.1), odometry(0.1, 0, 3.1), picture(0.15), odometry(0.2, 0, -3.1))
    assert found[0].frame.motions[0, 2] == pytest.approx((2 * np.pi - 6.2) / 2)
    found, _ = play(odometry(0.0, 0.0), picture(0.4), odometry(0.8, 5.0))  # slow odometry
    assert found[0].frame.motions[0, 0] == pytest.approx(2.5)
    found, _ = play(odometry(0.0, 0.0), picture(0.05), odometry(2.0, 5.0), picture(2.08))
    assert [len(m.frame.motions) for m in found] == [0, 1]  # the first is where odometry began
    np.testing.assert_allclose(found[1].frame.motions[0], [5.0, 0, 0])


def test_a_field_of_view_that_is_stated_is_that_of_the_camera_that_is_read() -> None:
    def cameras(info: SessionInfo, **options: Any) -> dict[str, float | None]:
        given = replace(Given([]), info=info)
        return {
            one.name: one.horizontal_fov_rad
            for one in RecordedSession(given, Reading(**options)).info.cameras
        }

    none, two = (
        SessionInfo("drive"),
        SessionInfo("drive", cameras=(Camera("left"), Camera("right", 640, 480, 0.8))),
    )
    assert cameras(none) == {}
    assert cameras(none, camera_fov_rad=1.0) == {"camera": 1.0}
    assert cameras(two, camera_fov_rad=1.0) == {"left": 1.0, "right": 0.8}
    assert cameras(two, camera_fov_rad=1.0, camera="right") == {"left": None, "right": 1.0}
    with pytest.raises(InputError, match="field of view of 180 degrees, expected 1 to 170"):
        cameras(none, camera_fov_rad=np.pi)


def test_a_picture_without_odometry_is_left_out_and_its_way_is_not_lost() -> None:
    before, after = (
        [odometry(0, 0), picture(0), odometry(0.1, 1)],
        [odometry(9.9, 7), picture(10), odometry(10.1, 9)],
    )
    found, session = play(*before, picture(5), *after)
    assert [m.frame.picture for m in found] == ["at 0", "at 10"]
    np.testing.assert_allclose(found[1].frame.motions, [[8.0, 0, 0]])
    assert "1 of 3 pictures have no odometry within 0.1 s" in session.warnings[0]


def test_clocks_that_never_meet_are_an_error_that_says_how_far_apart_they_are() -> None:
    session = RecordedSession(Given([odometry(0, 0), odometry(1, 1), picture(1000), picture(1001)]))
    for reading in (lambda: list(session.moments()), session.overview):
        with pytest.raises(InputError, match=r"1000\.000 s apart.*odometry_offset_s"):
            reading()


def test_without_odometry_there_is_a_word_of_it_and_motions_stay_apart() -> None:
    found, session = play(picture(0), picture(1))
    assert [m.frame.motions.shape for m in found] == [(0, 3), (0, 3)]
    assert "no odometry" in session.warnings[0]
    found, _ = play(forward(1, 0), forward(2, 0.5), picture(1), picture(2), forward(3, 3), picture(4))
    assert [m.frame.motions[:, 0].tolist() for m in found] == [[1, 2], [], [3]]


def test_nothing_counts_pictures_where_there_are_none() -> None:
    truth = [TruthPose(0.1 * k, np.array([0.1 * k, 0.0, 0.0])) for k in range(30)]

    def told(records: list[Record]) -> str:
        session = RecordedSession(Placeholders(Given(records)))
        assert len(list(session.moments()))
        return " ".join(session.warnings)

    assert told([*truth]).startswith("found no odometry: only the true poses are there; ")
    sparse = told([truth[0], OdometryPose(0.0, np.zeros(3)), *truth[1:]])
    expect_facts(sparse, "of 10 moments", "no odometry within 0.1 s", "left out")
    assert "picture" not in sparse
    with pytest.raises(InputError, match=r"found no moment with odometry within 0\.1 s: moments go from"):
        told([*truth, OdometryPose(99.0, np.zeros(3))])


def test_the_way_to_a_broken_picture_belongs_to_the_next() -> None:
    records = [odometry(0, 0), picture(0), forward(1, 0.5), odometry(1, 2), broken(1)]
    records += [odometry(2, 5), picture(2)]
    with pytest.raises(InputError, match="at 1: found a cut picture"):
        list(RecordedSession(Given(records)).moments())
    found, session = play(*records, options=Reading(keep_going=True))
    np.testing.assert_allclose(found[1].frame.motions, [[1, 0, 0], [5, 0, 0]])
    assert session.problem_count == 1
    assert [m.frame.step for m in found] == [1, 2]


def test_truth_is_interpolated_across_a_second_no_further_and_across_no_kidnapping() -> None:
    found, _ = play(
        truth(0, 0), picture(0.5), truth(1, 2), picture(1.5), truth(2.5, 3), picture(2.5), picture(9)
    )
    assert [None if m.truth is None else m.truth[0] for m in found] == [1, None, 3, None]
    found, _ = play(truth(0, 0), picture(0.2), Note(0.5, "kidnapped"), picture(0.7), truth(1, 9))
    assert [m.truth for m in found] == [None, None]
    assert [m.events for m in found] == [(), ("kidnapped",)]


@pytest.mark.parametrize(
    ("text", "carried"),
    [
        ("kidnapped", True),
        ("Kidnapped by a visitor", True),
        ("  KIDNAPPED: to the kitchen", True),
        ("kidnapped_again", True),
        ("kidnappedness", False),
        ("not kidnapped", False),
        ("?!", False),
    ],
)
def test_a_kidnapping_is_the_same_for_every_reader(tmp_path: Path, text: str, carried: bool) -> None:
    path = tmp_path / "session.log"
    with SessionWriter(path, SessionInfo("drive")) as log:
        log.truth(0.0, np.array([0.0, 1, 0]))
        log.image(0.2, GRAY)
        log.event(0.5, text)
        log.image(0.7, GRAY)
        log.truth(1.0, np.array([9.0, 1, 0]))
    played, _ = play(truth(0, 0), picture(0.2), Note(0.5, text), picture(0.7), truth(1, 9))
    for moments in (played, list(open_session(path).moments())):
        assert [moment.truth is None for moment in moments] == [carried, carried]
        assert [moment.kidnapped for moment in moments] == [False, carried]
    assert inspect_file(path, Reading()).distance_truth_m == pytest.approx(0 if carried else 9)


def test_times_that_fall_and_numbers_that_are_none_are_problems() -> None:
    for bad in (picture(-1), truth(5, float("nan")), forward(1e12, 5), picture(float("inf"))):
        with pytest.raises(InputError, match="at t"):
            list(RecordedSession(Given([picture(0), bad])).moments())
        found, session = play(picture(0), bad, picture(6), options=Reading(keep_going=True))
        assert len(found) == 2
        assert session.problem_count >= 1


def play_gated(distance_m: float, angle_rad: float, *records: Record) -> list[str]:
    found, _ = play(*records, options=Reading(min_distance_m=distance_m, min_angle_rad=angle_rad))
    return [m.frame.picture for m in found]


def test_gating_by_distance_angle_or_either() -> None:
    drive = [picture(0)]
    for t in range(1, 7):
        drive += [forward(0.3, t, 0.2 if t > 3 else 0.0), picture(t)]
    assert len(play_gated(0, 0, *drive)) == 7
    assert play_gated(0.5, 0, *drive) == ["at 0", "at 2", "at 4", "at 6"]
    assert play_gated(0, 0.35, *drive) == ["at 0", "at 5"]
    assert play_gated(0.8, 0.35, *drive) == ["at 0", "at 3", "at 5"]


def test_gating_counts_the_way_as_the_crow_flies_and_turns_beyond_half_a_turn() -> None:
    back_and_forth = [r for t in range(9) for r in (forward(0.3 if t % 2 else -0.3, t), picture(t))]
    assert play_gated(0.5, 0, *back_and_forth) == ["at 0"]
    around = [r for t in range(9) for r in (forward(0.0, t, 1.0), picture(t))]
    assert play_gated(0, 7.0, *around) == ["at 0", "at 7"]


def test_a_native_log_with_gating_is_gated_and_a_used_picture_has_all_motions(tmp_path: Path) -> None:
    drive = (picture(0), forward(0.3, 1), picture(1), forward(0.3, 2), picture(2))
    found, _ = play(*drive, options=Reading(min_distance_m=0.5))
    assert found[1].frame.motions[:, 0].tolist() == [0.3, 0.3]
    with SessionWriter(tmp_path / "drive.log", SessionInfo("drive")) as log:
        for t_s in range(5):
            log.odometry(t_s, (0.3, 0, 0))
            log.image(t_s, GRAY)
    gated = open_session(tmp_path / "drive.log", Reading(min_distance_m=0.5))
    assert gated.overview()[0] == 3


angles = st.floats(-3, 3)
lengths = st.floats(-100, 100)
poses = st.tuples(lengths, lengths, angles).map(np.array)


@given(poses, poses)
def test_a_motion_leads_from_one_pose_to_the_other(before: np.ndarray, after: np.ndarray) -> None:
    np.testing.assert_allclose(compose(before, motion_between(before, after)), after, atol=1e-9)


record = st.one_of(
    st.tuples(st.just("odometry"), st.tuples(lengths, lengths, angles)),
    st.tuples(st.just("truth"), st.tuples(lengths, lengths, angles)),
    st.tuples(st.just("image"), st.integers(0, 255)),
    st.tuples(st.just("event"), st.sampled_from(["kidnapped", "lights off", "slip"])),
)


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(0, 0.8), record), max_size=25))
def test_a_log_gives_back_all_that_was_written(steps: list[tuple[float, tuple[str, object]]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path, t_s, written, pending = Path(folder) / "drive.log", 0.0, [], []
        with SessionWriter(path, SessionInfo("drive")) as log:
            for wait_s, (kind, value) in steps:
                t_s += wait_s
                picture = np.full((4, 4, 3), value, np.uint8) if kind == "image" else value
                getattr(log, kind)(t_s, picture)
                pending.append((kind, value))
                written, pending = ([*written, pending], []) if kind == "image" else (written, pending)
        records = list(open_recording(path).records(ReadingNotes(keep_going=False)))
        assert len(records) == len(steps)
        moments = list(open_session(path).moments())
        for moment, before in zip(moments, written, strict=True):
            assert moment.frame.motions.tolist() == [list(v) for kind, v in before if kind == "odometry"]
            assert moment.events == tuple(v for kind, v in before if kind == "event")
        assert open_session(path).overview()[0] == len(moments)
