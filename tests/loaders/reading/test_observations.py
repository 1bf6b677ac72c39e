"""What makes the moments: pictures, or scans where there are none; scans beside pictures, and their gate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.recordings import Given
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.observations import Observed
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import (
    PLACEHOLDER,
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Scan,
    TruthPose,
)
from maurice_loaders.reading.session import RecordedSession, drive_segments
from maurice_loaders.reading.transforms import FewerPictures, corrected, with_frames
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose, inverse, motion_between
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import Moment, SessionInfo

GRAY = np.full((2, 2, 3), 100, np.uint8)


def scan(t_s: float, mark: float = 1.0, **more: object) -> Scan:
    fields = {"start_rad": -1.0, "step_rad": 1.0, "min_m": 0.0, "max_m": 8.0} | more
    return Scan(t_s, LaserScan(np.array([mark, 2, np.inf], np.float32), **fields))  # type: ignore[arg-type]


def picture(t_s: float) -> Picture:
    return Picture(t_s, lambda: GRAY, f"at {t_s:g}")


def pose(t_s: float, x: float, heading: float = 0.0) -> OdometryPose:
    return OdometryPose(t_s, np.array([x, 0.0, heading]))


def forward(t_s: float, length_m: float, turn: float = 0.0) -> Motion:
    return Motion(t_s, np.array([length_m, 0.0, turn]))


def play(*records: Record, **options: object) -> tuple[list[Moment], RecordedSession]:
    session = RecordedSession(Given(records), Reading(**options))  # type: ignore[arg-type]
    moments = list(session.moments())
    assert session.overview()[0] == len(moments)
    glances = list(session.glances(ReadingNotes(session.options.keep_going)))
    assert [glance.frame.scan is None for glance in glances] == [m.frame.scan is None for m in moments]
    return moments, session


def marks(moments: list[Moment]) -> list[float | None]:
    return [None if m.frame.scan is None else float(m.frame.scan.ranges_m[0]) for m in moments]


def drive(steps: int, length_m: float, turn: float = 0.0) -> list[Record]:
    return [r for k in range(steps) for r in (forward(k, length_m if k else 0.0, turn), scan(k, k))]


def test_scans_make_the_moments_with_the_odometry_and_the_truth_of_their_time() -> None:
    records = [pose(0.0, 0.0), scan(0.05, 1), pose(0.1, 0.2), TruthPose(0.1, np.array([5.0, 0, 0]))]
    records += [Note(0.12, "lights off"), Readings(0.13, {"ir": 3.0}), scan(0.15, 2), pose(0.2, 1.2)]
    moments, session = play(*records, TruthPose(0.2, np.array([7.0, 0, 0])))
    assert session.observed == Observed(pictures=False, scans=True)
    assert marks(moments) == [1, 2]
    np.testing.assert_allclose([m.frame.motions[0, 0] for m in moments], [0.1, 0.6])
    assert moments[1].truth == pytest.approx([6, 0, 0])
    assert moments[1].events == ("lights off",)
    assert dict(moments[1].frame.readings) == {"ir": 3.0}
    assert {m.frame.picture for m in moments} == {PLACEHOLDER}
    assert all(m.frame.image.dtype == np.uint8 and m.frame.image.ndim == 3 for m in moments)
    assert session.count_pictures() == 0
    assert session.known_pictures(10) == []


@pytest.mark.parametrize(
    ("length_m", "turn", "options", "used"),
    [
        (0.1, 0.0, {}, [0, 3, 6]),
        (0.0, 0.11, {}, [0, 2, 4, 6]),
        (0.0, 0.0, {}, [0]),
        (0.1, 0.0, {"min_distance_m": 0.0}, range(8)),
        (0.1, 0.0, {"min_angle_rad": 0.0}, range(8)),
        (0.1, 0.0, {"min_distance_m": 0.45}, [0, 5]),
        (0.1, 0.3, {"min_distance_m": 1e3}, [0]),
    ],
)
def test_a_scan_is_used_after_so_much_movement_as_amcl_does(
    length_m: float, turn: float, options: dict[str, float], used: list[int]
) -> None:
    moments, _ = play(*drive(8, length_m, turn), **options)
    assert marks(moments) == list(used)
    ways = [float(m.frame.motions[:, 0].sum()) for m in moments]
    assert sum(ways) == pytest.approx(length_m * used[-1])


def test_every_picture_is_used_with_and_without_scans_between() -> None:
    moments, session = play(*(r for k in range(5) for r in (forward(k, 0.01), scan(k, k), picture(k))))
    assert marks(moments) == [0, 1, 2, 3, 4]
    assert session.observed == Observed(pictures=True, scans=True)
    assert [m.frame.picture for m in moments] == [f"at {k}" for k in range(5)]


def test_a_picture_has_the_scan_nearest_in_time_and_loses_no_motion() -> None:
    records = [
        scan(0.0, 1),
        forward(0.05, 0.1),
        picture(0.07),
        scan(0.08, 2),
        forward(0.1, 0.2),
        scan(0.2, 3),
    ]
    records += [
        Note(0.21, "bump"),
        picture(0.25),
        scan(0.34, 4),
        forward(0.4, 0.3),
        scan(0.5, 5),
        picture(0.61),
    ]
    moments, _ = play(*records)
    assert marks(moments) == [2, 3, None]  # the last is 0.11 s from any
    assert [m.frame.motions[:, 0].tolist() for m in moments] == [[0.1], [0.2], [0.3]]
    assert [m.events for m in moments] == [(), ("bump",), ()]
    assert marks(play(*records, max_dt_s=0.2)[0]) == [2, 3, 5]
    first, _ = play(picture(0.0), scan(0.04, 1), picture(3.0))
    assert marks(first) == [1, None]


poses = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3)).map(np.array)


@given(poses, poses, poses, st.booleans())
def test_a_scan_is_as_if_taken_at_the_picture(
    mount: F64, at_scan: F64, at_picture: F64, motions: bool
) -> None:
    """The laser stands where it stood, by poses and by motions."""
    seen = Scan(0.0, LaserScan(np.ones(3, np.float32), -1.0, 1.0, 0.0, 8.0, mount))
    if motions:
        between = motion_between(at_scan, at_picture)
        (moment,), _ = play(Motion(0.0, at_scan), seen, Motion(0.05, between), picture(0.05))
    else:
        (moment,), _ = play(OdometryPose(0.0, at_scan), seen, OdometryPose(0.05, at_picture), picture(0.05))
    assert moment.frame.scan is not None
    there = compose(at_picture, moment.frame.scan.mount)
    apart = motion_between(compose(at_scan, mount), there)
    np.testing.assert_allclose(apart[:2], 0, atol=1e-9)
    assert abs(np.angle(np.exp(1j * apart[2]))) < 1e-9


def test_what_has_no_odometry_is_left_out_and_said_in_its_own_words() -> None:
    moments, session = play(pose(0, 0), scan(0, 1), scan(5, 2), pose(9.9, 9), scan(10, 3))
    assert marks(moments) == [1, 3]
    assert "1 of 3 scans have no odometry within 0.1 s" in session.warnings[0]
    with pytest.raises(InputError, match=r"found no scan with odometry within 0.1 s: scans go from"):
        list(RecordedSession(Given([pose(0, 0), pose(1, 1), scan(1000), scan(1001)])).moments())
    _, session = play(scan(0), scan(1))
    assert "only has the scans to go by" in session.warnings[0]
    assert "picture" not in session.warnings[0]


def test_true_movements_of_a_drive_of_scans_are_between_its_used_scans() -> None:
    records = [
        r for k in range(7) for r in (pose(k, 0.1 * k), TruthPose(k, np.array([0.1 * k, 1, 0])), scan(k))
    ]
    segments = list(drive_segments(RecordedSession(Given(records))))
    np.testing.assert_allclose([s.before[0] for s in segments], [0, 0.3])
    np.testing.assert_allclose([s.motions[0][0] for s in segments], [0.3, 0.3])


def test_corrections_move_scans_with_pictures_and_turn_them_with_the_robot() -> None:
    right = corrected(Given([scan(1.0)]), Reading(picture_offset_s=0.5, camera_yaw_rad=np.pi / 2))
    (moved,) = right.records(ReadingNotes(False))
    assert isinstance(moved, Scan)
    assert moved.t_s == 1.5
    np.testing.assert_allclose(moved.scan.mount, compose(inverse(np.array([0, 0, np.pi / 2])), np.zeros(3)))


def test_readings_go_with_scans_where_there_are_both() -> None:
    records = [r for k in range(3) for r in (forward(k, 0.3), Readings(k, {"ir": k}), scan(k + 0.5, k))]
    session = RecordedSession(with_frames(Given(records)))
    assert [(m.frame.time_s, m.frame.readings["ir"]) for m in session.moments()] == [
        (0.5, 0),
        (1.5, 1),
        (2.5, 2),
    ]


WRONG = {
    "many beams": (
        LaserScan(np.zeros(10**6, np.float32), -1, 1e-6, 0, 8),
        "found 1000000 beams, expected 1 to",
    ),
    "no beam": (LaserScan(np.zeros(0, np.float32), -1, 1, 0, 8), "found 0 beams"),
    "one direction": (LaserScan(np.ones(3, np.float32), -1, 0, 0, 8), "steps other than 0"),
    "no direction": (LaserScan(np.ones(3, np.float32), np.nan, 1, 0, 8), "expected angles"),
    "degrees": (LaserScan(np.ones(3, np.float32), -90, 1, 0, 8), "found beams from -90 rad"),
    "no reach": (LaserScan(np.ones(3, np.float32), -1, 1, 8, 8), "found ranges from 8 to 8 m"),
    "endless": (LaserScan(np.ones(3, np.float32), -1, 1, 0, np.inf), "found ranges from 0 to inf m"),
    "no place": (LaserScan(np.ones(3, np.float32), -1, 1, 0, 8, np.array([0, np.nan, 0])), "found mount"),
    "far away": (LaserScan(np.ones(3, np.float32), -1, 1, 0, 8, np.array([1e12, 0, 0])), "found mount"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_scan_is_one_line_or_left_out(name: str, tmp_path: Path) -> None:
    wrong, told = WRONG[name]
    records = [scan(0.0, 1), Scan(1.0, wrong), scan(2.0, 3)]
    with pytest.raises(InputError, match="Scan at t 1: ") as refused:
        list(RecordedSession(Given(records)).moments())
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
    moments, session = play(*records, keep_going=True, min_distance_m=0.0)
    assert marks(moments) == [1, 3]
    assert session.problem_count == 1
    with (
        SessionWriter(tmp_path / "a.log", SessionInfo("a")) as log,
        pytest.raises(ValueError, match="expected"),
    ):
        log.scan(0, wrong)


def test_scans_of_a_log_come_back_whatever_their_number(tmp_path: Path) -> None:
    with SessionWriter(tmp_path / "a.log", SessionInfo("a")) as log:
        for record in drive(300, 0.1):
            if isinstance(record, Motion):
                log.odometry(record.t_s, record.motion)
            elif isinstance(record, Scan):
                log.scan(record.t_s, record.scan)
    assert marks(list(open_session(tmp_path / "a.log").moments())) == marks(play(*drive(300, 0.1))[0])


@given(st.integers(1, 30), st.integers(1, 12))
def test_of_every_so_many_pictures_the_first_is_there_and_all_else_stays(count, stride):
    records = [record for t in range(count) for record in (pose(t, 0.1 * t), picture(t))]
    kept = list(FewerPictures(Given(records), stride).records(ReadingNotes(keep_going=False)))
    assert [one.t_s for one in kept if isinstance(one, Picture)] == list(range(0, count, stride))
    assert [one for one in kept if isinstance(one, OdometryPose)] == records[::2]
