"""Scans of CARMEN logs: where their beams point, what means that nothing was hit, and real logs."""

from __future__ import annotations

import gzip
import math
import os
from collections.abc import Callable
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from helpers.recordings import read
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.survey import open_survey
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose, Scan, TruthPose
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import Moment

WALL_M = 2.0  # ahead, across the way
MAX_M = 30.0


def to_the_wall(angles: F64, x: float, heading: float = 0.0) -> F64:
    """Return the ranges (B,) to an endless wall at x = WALL_M, MAX_M where the beam does not meet it."""
    with np.errstate(divide="ignore"):
        ranges = (WALL_M - x) / np.cos(angles + heading)
    return np.where((ranges > 0) & (ranges < MAX_M), ranges, MAX_M)


def flaser(beams: int, x: float, word: str = "FLASER", ahead: float = 0.0, heading: float = 0.0) -> str:
    """Write a scan in front of the wall, its first beam to the right, from `ahead` of the middle."""
    angles = np.radians({180: 1, 181: 1, 360: 0.5, 361: 0.5, 91: 2}[beams] * np.arange(beams) - 90)
    ranges = " ".join(f"{r:.4f}" for r in to_the_wall(angles, x + ahead, heading))
    return f"{word} {beams} {ranges} {x + ahead} 0 {heading} {x} 0 0 {10 * x:.1f} host {10 * x:.1f}"


def log(folder: Path, *lines: str) -> Path:
    (folder / "drive.log").write_text("\n".join(lines) + "\n")
    return folder / "drive.log"


def scans(path: Path) -> list[LaserScan]:
    return [record.scan for record in read(path)[0] if isinstance(record, Scan)]


@pytest.mark.parametrize("beams", [91, 180, 181, 360, 361])
@pytest.mark.parametrize("ahead", [0.0, 0.3])
def test_beams_span_half_a_turn_and_end_at_the_wall(beams: int, ahead: float, tmp_path: Path) -> None:
    """The count tells the steps, and the poses where the laser sits: all scans see one wall."""
    found = scans(log(tmp_path, *(flaser(beams, 0.2 * k, ahead=ahead) for k in range(5))))
    for k, scan in enumerate(found):
        assert scan.size == beams
        assert scan.max_m == pytest.approx(MAX_M)
        np.testing.assert_allclose(scan.mount, [ahead, 0, 0], atol=1e-9)
        assert scan.misses.any()
        np.testing.assert_allclose(scan.points()[:, 0] + 0.2 * k, WALL_M, atol=1e-3)


def test_of_two_lasers_the_front_one_is_read_and_a_rear_one_looks_back(tmp_path: Path) -> None:
    front, rear = flaser(181, 0.1), flaser(181, 0.1, "RLASER", heading=math.pi)
    found, warnings = read(log(tmp_path, front, rear, front, rear))
    assert sum(isinstance(record, Scan) for record in found) == 2
    assert "2 scans of other lasers are left out: FLASER is read" in warnings[0]
    for pose in (math.pi, 0.0):  # some writers give the robot's heading for that of the laser
        alone = rear.replace(f" {math.pi} ", f" {pose} ")
        for scan in scans(log(tmp_path, alone, alone)):
            assert abs(scan.mount[2]) == pytest.approx(math.pi)
            # all but ahead, where nothing is seen
            assert scan.points()[:, 0] == pytest.approx(WALL_M - 0.1, abs=1e-3)


def robotlaser(start: float, fov: float, step: float, ranges: str, reach: float = 80.0) -> str:
    count = len(ranges.split())
    laser = f"0 {start} {fov} {step} {reach} 0.01 0 {count} {ranges} 0"
    return f"ROBOTLASER1 {laser} 1.2 0 0 1 0 0 0 0 0.3 1 5.0 h 5.0"


def test_a_robotlaser_says_where_its_beams_point_and_how_far_they_reach(tmp_path: Path) -> None:
    lines = [robotlaser(-0.5, 1.0, 0.5, "1 2 3", 2.5), robotlaser(-0.5, 1.0, 0.0, "1 1 1")]
    first, second = scans(log(tmp_path, *lines))
    assert (first.start_rad, first.step_rad, first.max_m) == (-0.5, 0.5, 2.5)
    assert first.misses.tolist() == [False, False, True]
    np.testing.assert_allclose(first.mount, [0.2, 0, 0], atol=1e-9)
    assert second.step_rad == 0.5  # by field of view and count


@pytest.mark.parametrize(
    ("top", "below", "max_m", "missed"),
    [
        ([81.91] * 40, [12.0, 12.1], 81.91, 40),
        ([50.0] * 40, [49.8, 49.7, 49.9], 50.0, 40),
        ([32.759] * 3 + [32.767] * 40, [32.6], 32.759, 43),
        ([7.41] * 3, [7.3 + 0.01 * (k % 11) for k in range(100)], 81.92, 0),  # the far end of a room
        ([7.41], [7.3], 81.92, 0),
        ([math.inf] * 40, [12.0], 81.92, 40),
        ([math.nan, -1.0, 1e300], [12.0], 81.92, 1),
        ([], [90.0], 90.01, 0),
    ],
)
def test_the_reach_is_the_longest_range_where_it_repeats(
    top: list[float], below: list[float], max_m: float, missed: int, tmp_path: Path
) -> None:
    """A wall that is far, and seen as often as what is a little nearer, is no maximum."""
    ranges = [*top, *below, *([1.0] * 60)]
    text = " ".join(f"{r:g}" if r != 32.759 else "32.759" for r in ranges)
    (scan,) = scans(log(tmp_path, f"FLASER {len(ranges)} {text} 0 0 0 0 0 0 1 h 1", "ODOM 0 0 0 0 0 0 1 h 1"))
    assert scan.max_m == pytest.approx(max_m)
    assert scan.misses.sum() == missed
    assert scan.hits[len(top) :].all()


@pytest.mark.parametrize(
    ("broken", "told"),
    [
        ("FLASER 180 1 2 3 0 0 0 0 0 0 1 h 1", "ranges; was the line cut?"),
        ("FLASER 3 1 two 3 0 0 0 0 0 0 1 h 1", "found a range that is no number"),
        ("FLASER 0 0 0 0 0 0 0 1 h 1", "found 0 beams"),
        (f"FLASER 30000 {'1 ' * 30000} 0 0 0 0 0 0 1 h 1", "found 30000 beams, expected 1 to 20000"),
        ("FLASER 1000000 1 2 3 0 0 0 0 0 0 1 h 1", "for a count of readings"),
        (robotlaser(-90.0, 180.0, 1.0, "1 2 3"), "expected angles of at most a whole turn"),
        (robotlaser(-1.0, 2.0, 1.0, "1 2 3", -5.0), "found ranges from 0 to -5 m"),
        (robotlaser(math.nan, 2.0, 1.0, "1 2 3"), "found value 'nan', expected a finite number"),
    ],
)
def test_a_broken_scan_is_named_or_left_out_alone(broken: str, told: str, tmp_path: Path) -> None:
    good = [flaser(181, 0.5 * k) for k in range(3)]
    path = log(tmp_path, good[0], broken, *good[1:])
    with pytest.raises(InputError, match=r"drive\.log:2: ") as refused:
        list(open_session(path).moments())
    assert told in str(refused.value)
    assert len(str(refused.value)) < 400
    session = open_session(path, keep_going=True)
    assert len(list(session.moments())) == 3
    assert session.problem_count == 1


def repeating(corrected: int) -> list[str]:
    """Return lines as some correctors write them: odometry repeats the scans' poses, scans have no time."""
    lines = []
    for k in range(corrected):
        x = 0.3 * k
        ranges = " ".join(f"{r:.4f}" for r in to_the_wall(np.radians(np.arange(181) - 90), x))
        lines += [
            f"FLASER 181 {ranges} {x} 0 0 {x} 0 0 0 h 0",
            f"ODOM {x} 0 0 0 0 0 {k % 7}e-80 h {k % 7}e-80",
        ]
    return ["ODOM 0 0 0 0 0 0 0 h 0", *lines[:-2], "ODOM 9 9 0 0 0 0 1891 h 1891", *lines[-2:]]


def test_odometry_that_repeats_the_truth_is_told_and_can_be_made_anew(tmp_path: Path) -> None:
    path = log(tmp_path, *repeating(5))
    session = open_session(path)
    assert any("repeats its corrected poses" in text for text in session.remarks)
    assert any("no times" in text for text in session.remarks)
    moments = list(session.moments())
    assert [m.frame.time_s for m in moments] == [0, 1, 2, 3, 4]
    np.testing.assert_allclose([m.frame.motions[0, 0] for m in moments[1:]], 0.3)
    np.testing.assert_allclose([m.truth[0] for m in moments if m.truth is not None], [0, 0.3, 0.6, 0.9, 1.2])
    made = open_session(path, odometry_from_truth=True)
    assert not any("repeats its corrected poses" in text for text in made.remarks)
    ways = [float(m.frame.motions[0, 0]) for m in list(made.moments())[1:]]
    assert 0 < np.abs(np.array(ways) - 0.3).max() < 0.1
    with pytest.raises(InputError, match="found odometry that was measured"):
        open_session(log(tmp_path, *(flaser(181, 0.2 * k) for k in range(4))), odometry_from_truth=True)


# Real logs.

DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs" / "carmen"
real = pytest.mark.skipif(not DATA.is_dir(), reason="no recorded data here (MAURICE_DATA)")

REAL = {  # scans, used, meters by truth and by odometry, reach
    "intel": (910, 902, 490.53, 508.35, 81.83),
    "aces": (440, 439, 321.20, 325.22, 50.0),
    "freiburg-079": (4791, 1550, 422.90, 392.91, 81.91),
    "orebro": (237, 237, 221.40, 221.40, 32.759),
}
EACH = [pytest.param(name, marks=pytest.mark.slow if REAL[name][0] > 1000 else ()) for name in REAL]


def length(poses: list[F64]) -> float:
    return float(np.hypot(*np.diff([pose[:2] for pose in poses], axis=0).T).sum())


@real
@pytest.mark.parametrize("name", EACH)
def test_real_logs_by_their_counts_and_lengths(name: str) -> None:
    count, used, truth_m, odometry_m, max_m = REAL[name]
    path = DATA / f"{name}-corrected.log.gz"
    records = read(path)[0]
    found = [record.scan for record in records if isinstance(record, Scan)]
    assert len(found) == count
    assert {round(scan.max_m, 3) for scan in found} == {max_m}
    assert length([r.pose for r in records if isinstance(r, TruthPose)]) == pytest.approx(truth_m, abs=0.01)
    odometry = [r.pose for r in records if isinstance(r, OdometryPose)]
    assert length(odometry) == pytest.approx(odometry_m, abs=0.01)
    session = open_session(path)
    assert session.overview() == (used, True)
    assert session.warnings == () or "times fall a little" in session.warnings[0]


def apart(moments: list[Moment], points_of: Callable[[LaserScan], F64]) -> float:
    """Return the mean distance, at most 0.5 m, from points of a scan to the nearest of the scan before."""
    clouds = []
    for moment in moments:
        assert moment.frame.scan is not None
        assert moment.truth is not None
        x, y, heading = moment.truth
        cos, sin = math.cos(heading), math.sin(heading)
        clouds.append(points_of(moment.frame.scan) @ np.array([[cos, sin], [-sin, cos]]) + [x, y])
    near = [cKDTree(before).query(now)[0] for before, now in pairwise(clouds) if min(len(before), len(now))]
    return float(np.minimum(np.concatenate(near), 0.5).mean())


@real
@pytest.mark.parametrize("name", EACH)
def test_real_scans_line_up_at_the_true_poses_and_mirrored_or_turned_do_not(name: str) -> None:
    moments = list(islice(open_session(DATA / f"{name}-corrected.log.gz").moments(), 250))
    right = apart(moments, LaserScan.points)
    assert right < 0.15
    assert apart(moments, lambda scan: scan.points() * [1, -1]) > 1.8 * right
    cos, sin = math.cos(0.2), math.sin(0.2)
    assert apart(moments, lambda scan: scan.points() @ np.array([[cos, sin], [-sin, cos]])) > 1.15 * right


@real
def test_orebro_says_that_its_odometry_is_the_truth_and_makes_another() -> None:
    session = open_session(DATA / "orebro-corrected.log.gz")
    assert any("repeats its corrected poses" in text for text in session.remarks)
    made = open_session(DATA / "orebro-corrected.log.gz", odometry_from_truth=True)
    assert made.overview() == (237, True)
    steps = [
        (a.frame.motions, b.frame.motions) for a, b in zip(session.moments(), made.moments(), strict=True)
    ]
    errors = [np.hypot(*(b - a)[0, :2]) / max(float(np.hypot(*a[0, :2])), 0.1) for a, b in steps[1:]]
    assert 0.02 < float(np.mean(errors)) < 0.2


@real
def test_a_packed_and_an_unpacked_log_are_one(tmp_path: Path) -> None:
    packed = DATA / "aces-corrected.log.gz"
    (tmp_path / "aces.log").write_bytes(gzip.decompress(packed.read_bytes()))
    ours, theirs = (scans(path) for path in (packed, tmp_path / "aces.log"))
    assert all(np.array_equal(a.ranges_m, b.ranges_m) for a, b in zip(ours, theirs, strict=True))


def test_scans_of_a_corrected_log_are_at_the_truth(tmp_path: Path) -> None:
    """The correction moves the laser's pose and the robot's apart; where the laser sat is lost."""
    lines = [
        flaser(181, 0.2 * k).replace(f" {0.2 * k} 0 0.0 ", f" {0.2 * k + 0.1 * k} 0 0 ", 1) for k in range(5)
    ]
    for moment in open_session(log(tmp_path, *lines), min_distance_m=0.0).moments():
        assert moment.frame.scan is not None
        assert not moment.frame.scan.mount.any()
        assert moment.truth is not None
        assert compose(moment.truth, moment.frame.scan.mount)[0] == pytest.approx(
            1.5 * 0.1 * moment.frame.time_s
        )


@pytest.mark.parametrize("ahead", [0.0, 0.25])
def test_where_the_laser_of_a_corrected_log_sits_is_where_the_truth_is_of(
    ahead: float, tmp_path: Path
) -> None:
    """With the truth moved back to the wheels' middle the scans still end at the wall."""
    turned = [
        flaser(181, 0.2 * k, heading=0.3 * k).replace(f" {0.2 * k} 0 0 ", " 0 0 0 ", 1) for k in range(4)
    ]
    session = open_session(log(tmp_path, *turned), min_distance_m=0.0, truth_ahead_m=ahead)
    for k, moment in enumerate(session.moments()):
        assert moment.truth is not None
        assert moment.frame.scan is not None
        np.testing.assert_allclose(moment.frame.scan.mount, [ahead, 0, 0])
        laser = compose(moment.truth, moment.frame.scan.mount)
        np.testing.assert_allclose(laser, [0.2 * k, 0, 0.3 * k], atol=1e-9)
        assert (moment.truth[0] == pytest.approx(0.2 * k)) == (ahead == 0)


def test_no_library_is_made_of_scans(tmp_path: Path) -> None:
    path = log(tmp_path, *(flaser(181, 0.3 * k) for k in range(3)))
    with pytest.raises(InputError, match="found scans of a laser and no picture"):
        open_survey(path, Reading())


@pytest.mark.parametrize(
    ("times", "told"),
    [
        (
            ["-0.4", "-0.9", *["4.29497e+09"] * 10],
            "the scans have no times and are taken to be a second apart",
        ),
        (["9.76053e+08"] * 12, "the scans share 1 times, which have too few digits"),
        ([f"{976052850 + k}.5" for k in range(12)], ""),
    ],
)
def test_scans_whose_times_say_nothing_are_read_in_the_order_of_the_lines(
    times: list[str], told: str, tmp_path: Path
) -> None:
    """A time below zero without its sign is close to 2^32; six digits are alike for a whole drive."""
    lines = [flaser(181, 0.1 * k).rsplit(" ", 3)[0] + f" {t} host {t}" for k, t in enumerate(times)]
    session = open_session(log(tmp_path, *lines))
    assert session.overview()[0] == len(times) // 3 + (len(times) % 3 > 0)  # one every 0.25 m
    assert any(told in note for note in session.info.notes) if told else len(session.info.notes) == 0
    found = [moment.frame.time_s for moment in session.moments()]
    assert found == sorted(set(found))
