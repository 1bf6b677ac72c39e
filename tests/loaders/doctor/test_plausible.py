"""Numbers that cannot be are found by themselves: jumps of odometry, times, poses, ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_loaders.doctor.findings import RecordedDrive, RecordedOdometry, RecordedScans, RecordedTruth
from maurice_loaders.doctor.plausibility import implausible
from maurice_mcl.values import F64, LaserScan, path_of
from maurice_viz.text.findings import brief, describe

NO_TRUTH = RecordedTruth(np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int32))
NO_SCANS = RecordedScans(np.zeros(0), ())


def path(seconds: float = 30.0) -> tuple[F64, F64]:
    """Return times (K,) and poses (K, 3) of a robot that drives and turns at 20 Hz, up to 0.5 m/s."""
    t_s = 100.0 + np.arange(0.0, seconds, 0.05)
    speed = 0.25 + 0.25 * np.sin(t_s)
    motions = np.column_stack([0.05 * speed, np.zeros(len(t_s)), 0.02 * np.cos(t_s / 3)])
    motions[0] = [2.0, 1.0, 0.3]
    return t_s, path_of(motions)


def drive(t_s: F64, poses: F64) -> RecordedDrive:
    return RecordedDrive(RecordedOdometry(t_s, poses, poses=True), NO_TRUTH, np.zeros(0))


def codes(found: RecordedDrive, scans: RecordedScans = NO_SCANS) -> list[str]:
    return [finding.code for finding in implausible(found, scans)]


def test_a_healthy_drive_has_nothing_implausible() -> None:
    t_s, poses = path()
    assert codes(drive(t_s, poses)) == []
    gap = (t_s < 110.0) | (t_s > 118.0)
    assert codes(drive(t_s[gap], poses[gap])) == []  # a gap is no jump
    pairs = t_s.copy()
    pairs[1::2] = pairs[::2] + 1e-6
    assert codes(drive(pairs, poses)) == []  # nor are stamps that come in pairs


def test_odometry_that_begins_again_is_named_with_its_time() -> None:
    t_s, poses = path()
    poses[300:] = path()[1][:300] - path()[1][0]
    (finding,) = implausible(drive(t_s, poses), NO_SCANS)
    assert finding.code == "odometry-jump"
    assert finding.numbers["at_s"] == pytest.approx(15.0)
    assert finding.numbers["within_s"] == pytest.approx(0.05)
    assert finding.numbers["jump_m"] == pytest.approx(np.hypot(*poses[299, :2]), abs=0.05)
    assert "back to zero" in describe(finding)
    assert brief(finding).endswith("fix: --reading odometry_are=jumping")


def test_jumps_are_counted_and_one_of_a_heading_is_found_too() -> None:
    t_s, poses = path()
    poses[200:, 0] += 5.0
    poses[400:, 0] -= 40.0
    (finding,) = implausible(drive(t_s, poses), NO_SCANS)
    assert finding.details["jumps"] == 2
    assert finding.numbers["jump_m"] == pytest.approx(40.0, abs=0.1)
    assert describe(finding).endswith("at 20.0 s of the drive, its longest jump of 2")
    t_s, poses = path()
    poses[200:, 2] += 2.0
    (finding,) = implausible(drive(t_s, poses), NO_SCANS)
    assert finding.numbers["turn_deg"] == pytest.approx(np.degrees(2.0), abs=2.0)


RNG = np.random.default_rng(5)
MAX_M = 30.0


def scanned(number: int = 120, beams: int = 90) -> list[F64]:
    """Return the ranges of scans in a hall of some size that a robot drives through; a tenth hits nothing."""
    drawn = []
    for k in range(number):
        ranges = RNG.uniform(1.0, 12.0 + 0.05 * k, beams)
        ranges[RNG.random(beams) < 0.1] = np.inf
        drawn.append(ranges)
    return drawn


def recorded(drawn: list[F64]) -> RecordedScans:
    made = (LaserScan(ranges.astype(np.float32), -1.5, 0.03, 0.1, MAX_M) for ranges in drawn)
    return RecordedScans(100.0 + 0.2 * np.arange(len(drawn)), tuple(made))


@pytest.mark.parametrize(
    ("low_m", "high_m", "limit_m"), [(29.96, 29.96, 29.96), (29.9, 29.999, 29.9), (29.7, 29.95, 29.7)]
)
def test_beams_that_hit_nothing_are_found_by_their_range_with_noise_too(
    low_m: float, high_m: float, limit_m: float
) -> None:
    drawn = scanned()
    for ranges in drawn:
        nothing = np.isinf(ranges)
        ranges[nothing] = RNG.uniform(low_m, high_m, nothing.sum())
    (finding,) = implausible(drive(*path()), recorded(drawn))
    assert finding.code == "max-range"
    assert finding.numbers["range_m"] == pytest.approx(limit_m, abs=0.02)
    assert finding.numbers["range_m"] <= np.float32(low_m) + 0.02
    assert f"laser_max_range={finding.numbers['range_m']:.5g}" in brief(finding)


def test_walls_at_the_end_of_the_reach_are_no_pile() -> None:
    assert codes(drive(*path()), recorded(scanned())) == []
    far = [np.minimum(ranges * 1.6, RNG.uniform(20.0, 29.9)) for ranges in scanned()]
    assert codes(drive(*path()), recorded(far)) == []


def test_scans_in_a_row_that_hit_nothing_are_counted_with_their_time() -> None:
    drawn = scanned()
    for ranges in drawn[20:60]:
        ranges[:] = 0.0
    (finding,) = implausible(drive(*path()), recorded(drawn))
    assert finding.code == "scans-empty"
    assert describe(finding) == "40 scans in a row hit nothing, from 4.0 to 11.8 s of the drive"
    for ranges in drawn[25:60:5]:
        ranges[:] = 2.0
    assert codes(drive(*path()), recorded(drawn)) == []


def test_motions_jump_as_poses_do() -> None:
    t_s, _ = path()
    motions = np.tile([0.02, 0.0, 0.01], (len(t_s), 1))
    steady = drive(t_s, motions)
    steady = replace(steady, odometry=replace(steady.odometry, poses=False))
    assert codes(steady) == []
    motions[77, 0] = 6553.6  # a counter that overflowed
    assert codes(steady) == ["odometry-jump"]
