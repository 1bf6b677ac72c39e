"""Odometry that is wrong in one way is told from odometry that is merely noisy."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from maurice_loaders.doctor.findings import (
    RecordedDrive,
    RecordedOdometry,
    RecordedTruth,
    motions_of,
)
from maurice_loaders.doctor.odometry import (
    Interpretation,
    agreement,
    compared_with_truth,
    interpretations,
    motions_by,
    segments_of,
)
from maurice_loaders.doctor.pictures import ComparedPictures, best_yaw, places_seen, seen_with_truth
from maurice_loaders.doctor.plausibility import (
    aside_share,
    clocks_apart,
    coarse_times,
    odometry_doubts,
    same_moments,
    time_unit,
    truth_apart,
)
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import motions_between, rotated
from maurice_mcl.values.map import Arena

RATE_HZ = 10.0


def dense_drive(
    seconds: float = 120.0, noise: float = 0.02, seed: int = 0, *, poses: bool = True
) -> RecordedDrive:
    """Drive curves at 10 Hz, odometry and truth alike but for noise and another frame."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE_HZ)
    t_s = np.arange(count) / RATE_HZ
    speed = 0.3 + 0.2 * np.sin(0.13 * t_s)
    rate = 0.6 * np.sin(0.35 * t_s) + 0.4 * np.sin(0.11 * t_s + 1)
    truth = integrated(np.column_stack([speed, 0 * speed, rate]) / RATE_HZ)
    factor = 1 + noise * rng.standard_normal((count, 2))
    measured = np.column_stack([speed * factor[:, 0], 0 * speed, rate * factor[:, 1]]) / RATE_HZ
    values = integrated(measured) if poses else measured
    track = RecordedTruth(t_s, truth + np.array([3.0, 2.0, 0.0]), np.zeros(count, np.int32))
    return RecordedDrive(RecordedOdometry(t_s, values, poses), track, t_s[::5])


def integrated(motions: F64) -> F64:
    heading = np.cumsum(motions[:, 2])
    before = heading - motions[:, 2]
    x = np.cumsum(motions[:, 0] * np.cos(before) - motions[:, 1] * np.sin(before))
    y = np.cumsum(motions[:, 0] * np.sin(before) + motions[:, 1] * np.cos(before))
    return np.column_stack([x, y, heading])


def with_values(drive: RecordedDrive, values: F64) -> RecordedDrive:
    return replace(drive, odometry=replace(drive.odometry, values=values))


def codes(drive: RecordedDrive) -> list[str]:
    return [one.code for one in compared_with_truth(drive)]


@pytest.mark.parametrize("poses", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noisy_odometry_is_healthy(poses, seed):
    drive = dense_drive(noise=0.1, seed=seed, poses=poses)
    assert codes(drive) == []
    assert odometry_doubts(drive) == []
    assert time_unit(drive) == (1.0, [])
    assert clocks_apart(drive) == truth_apart(drive) == []


def test_stamps_that_come_in_pairs_make_no_robot_too_fast() -> None:
    drive = dense_drive(poses=True)
    t_s = drive.odometry.t_s.copy()
    t_s[1::2] = t_s[::2] + 0.001
    paired = replace(drive, odometry=replace(drive.odometry, t_s=t_s))
    assert odometry_doubts(paired) == []
    assert time_unit(paired) == (1.0, [])


@pytest.mark.parametrize(
    ("code", "factors"),
    [
        ("turn-clockwise", (1, 1, -1)),
        ("turn-degrees", (1, 1, 180 / np.pi)),
        ("turn-clockwise-degrees", (1, 1, -180 / np.pi)),
        ("scale", (1000, 1000, 1)),
        ("turn-gain", (1, 1, 1.6)),
    ],
)
def test_motions_of_other_units_and_signs(code, factors):
    drive = dense_drive(poses=False)
    assert codes(with_values(drive, drive.odometry.values * factors)) == [code]


@pytest.mark.parametrize(
    ("code", "factors"),
    [("turn-clockwise", (1, 1, -1)), ("turn-degrees", (1, 1, 180 / np.pi)), ("scale", (100, 100, 1))],
)
def test_poses_of_other_units_and_signs(code, factors):
    drive = dense_drive()
    assert codes(with_values(drive, drive.odometry.values * factors)) == [code]


def test_frames_and_other_drives_are_told_apart():
    drive = dense_drive(poses=False)
    motions = drive.odometry.values
    poses = integrated(motions)
    assert codes(with_values(drive, poses)) == ["frame-absolute"]
    steps = np.diff(poses, axis=0, prepend=np.zeros((1, 3)))
    assert codes(with_values(drive, steps)) == ["frame-world"]
    assert codes(with_values(drive, motions[:, [1, 0, 2]])) == ["frame-swapped"]
    assert codes(with_values(drive, motions * [-1, -1, 1])) == ["frame-backward"]
    drive = dense_drive(poses=False)
    other = np.random.default_rng(3).normal(0, [0.1, 0.1, 0.3], drive.odometry.values.shape)
    assert codes(with_values(drive, other)) == ["disagreement"]
    drive = dense_drive(seconds=2)
    assert codes(with_values(drive, drive.odometry.values * [1, 1, -1])) == []
    empty = RecordedTruth(np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int32))
    assert codes(replace(drive, truth=empty)) == []


@pytest.mark.parametrize("late_s", [-1.2, 0.6, 1.5])
def test_a_late_clock_is_measured(late_s):
    drive = dense_drive()
    odometry = replace(drive.odometry, t_s=drive.odometry.t_s + late_s)
    found = compared_with_truth(replace(drive, odometry=odometry))
    assert [one.code for one in found] == ["odometry-delay"]
    assert found[0].numbers["delay_s"] == pytest.approx(late_s, abs=0.2)
    assert found[0].options == {"odometry_offset_s": -found[0].numbers["delay_s"]}


@pytest.mark.parametrize(
    ("ahead_m", "left_m", "poses"), [(0.19, 0, False), (0.05, 0, True), (-0.4, 0.25, False), (0, -0.6, True)]
)
def test_a_place_on_the_robot_that_truth_is_of_is_found_and_taken_out(ahead_m, left_m, poses):
    drive = dense_drive(noise=0.05, poses=poses)
    x, y = rotated(*np.full((2, drive.truth.size), [[ahead_m], [left_m]]), drive.truth.poses[:, 2])
    of_mast = drive.truth.poses + np.column_stack([x, y, 0 * x])
    [found] = compared_with_truth(replace(drive, truth=replace(drive.truth, poses=of_mast)))
    assert found.code == "truth-mast"
    assert found.numbers["ahead_m"] == pytest.approx(ahead_m, abs=0.02)
    assert found.numbers["left_m"] == pytest.approx(left_m, abs=0.02)
    x, y = rotated(
        *np.full((2, len(x)), [[found.numbers["ahead_m"]], [found.numbers["left_m"]]]), of_mast[:, 2]
    )
    back = replace(drive.truth, poses=of_mast - np.column_stack([x, y, 0 * x]))
    assert compared_with_truth(replace(drive, truth=back)) == []


@pytest.mark.parametrize("rate_hz", [1.0, 5.0])
def test_records_far_apart_do_not_look_like_another_place_on_the_robot(rate_hz):
    """Motions are in the frame at their start, however far the robot turns in each."""
    t_s = np.arange(0, 240, 1 / rate_hz)
    heading = 0.6 * t_s
    poses = np.column_stack([2 * np.sin(heading), -2 * np.cos(heading), heading])
    poses[:, :2] *= 0.25  # 0.5 m across, which it turns about
    track = RecordedTruth(t_s, poses, np.zeros(len(t_s), np.int32))
    for values, is_poses in ((poses, True), (motions_between(poses), False)):
        drive = RecordedDrive(RecordedOdometry(t_s, values, is_poses), track, t_s)
        assert compared_with_truth(drive) == []


def test_legs_are_not_cut_across_a_kidnapping():
    poses = np.array([[0, 0, 0], [0.2, 0, 0], [5, 5, 1], [5.2, 5, 1], [5.4, 5, 1.0]])
    track = RecordedTruth(np.arange(5.0), poses, np.array([0, 0, 1, 1, 1], np.int32))
    legs = segments_of(track)
    assert legs.begin_s.tolist() == [0, 2, 3]
    assert np.abs(legs.moved[:, :2]).max() < 0.25


def test_interpretations_undo_what_was_done():
    motions = dense_drive(seconds=20, poses=False).odometry.values
    t_s = np.arange(len(motions)) * 0.1
    poses = np.concatenate([np.zeros((1, 3)), integrated(motions)])
    absolute = RecordedOdometry(np.append(t_s, 99), poses, poses=False)
    assert np.allclose(motions_by(absolute, Interpretation("", "absolute"))[1:], motions)
    assert np.allclose(motions_between(poses)[1:], motions)
    steps = RecordedOdometry(t_s, np.diff(poses, axis=0), poses=False)
    assert np.allclose(motions_by(steps, Interpretation("", "world")), motions)
    degrees = RecordedOdometry(t_s, motions * [1, 1, 180 / np.pi], poses=False)
    assert np.allclose(motions_by(degrees, Interpretation("degrees")), motions)
    assert np.allclose(motions_of(degrees)[:, :2], motions[:, :2])


def test_agreement_of_a_perfect_drive_is_perfect():
    drive = dense_drive(noise=0.0)
    legs = segments_of(drive.truth)
    best = agreement(drive.odometry, legs, interpretations(drive.odometry)[0])
    assert best.unexplained < 1e-3
    assert best.scale == pytest.approx(1, abs=0.01)
    assert best.gain == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9])
def test_times_of_other_units(unit):
    factor, found = time_unit(dense_drive().slowed(unit))
    assert factor == pytest.approx(1 / unit)
    assert [one.code for one in found] == ["time-unit"]


@pytest.mark.parametrize("digits", [0.1, 1.0, 1000.0])
def test_times_of_too_few_digits(digits):
    """Stamps written with six digits are alike for many records; those of a clock are not."""
    drive = dense_drive()
    offset_s = 976_052_857.0
    odometry = replace(drive.odometry, t_s=np.round((drive.odometry.t_s + offset_s) / digits) * digits)
    truth = replace(drive.truth, t_s=drive.truth.t_s + offset_s)
    found = coarse_times(replace(drive, odometry=odometry, truth=truth))
    steps_s = {0.1: [], 1.0: [1.0], 1000.0: [0.0]}[digits]  # of two minutes, 1000 s leave one time
    assert [one.numbers["step_s"] for one in found] == steps_s
    assert all(one.details["name"] == "odometry" for one in found)
    standing = RecordedOdometry(np.repeat(np.arange(20.0), 10), np.zeros((200, 3)), poses=True)
    assert coarse_times(replace(drive, odometry=standing)) == []


def test_odometry_is_judged_by_itself():
    drive = dense_drive(poses=False)
    motions = drive.odometry.values
    steps = np.diff(integrated(motions), axis=0, prepend=np.zeros((1, 3)))
    wrong = {
        "frame-swapped": motions[:, [1, 0, 2]],
        "frame-world": steps,
        "turn-degrees": motions * [1, 1, 180 / np.pi],
        "scale": motions * [1000, 1000, 1],
    }
    for code, values in wrong.items():
        assert [one.code for one in odometry_doubts(with_values(drive, values))] == [code]
    assert aside_share(drive.odometry, Interpretation()) == 0
    drive = dense_drive()
    for code, factor in (("turn-clockwise", -1), ("turn-degrees", 180 / np.pi)):
        found = odometry_doubts(with_values(drive, drive.odometry.values * [1, 1, factor]))
        assert [one.code for one in found] == [code]
    # A drone that flies sideways along x: read as degrees, its headings would be next to none
    t_s = np.arange(200) / RATE_HZ
    values = np.column_stack([0.3 * t_s, 0.02 * np.sin(t_s), np.full(200, -np.pi / 2)])
    drive = dense_drive(20.0)
    still = RecordedDrive(RecordedOdometry(t_s, values, poses=True), drive.truth, drive.picture_t_s)
    assert "turn-degrees" not in [one.code for one in odometry_doubts(still)]


def test_clocks_and_times_with_an_offset():
    drive = dense_drive()
    found = clocks_apart(replace(drive, picture_t_s=drive.picture_t_s + 1e9))
    assert [one.code for one in found] == ["odometry-clock", "truth-clock"]
    assert found[0].options == {"odometry_offset_s": 1e9}
    rng = np.random.default_rng(5)
    t_s = np.cumsum(rng.uniform(1, 5, 30))
    assert same_moments(t_s + 77.5, t_s) == pytest.approx(77.5)
    dense = np.sort(np.concatenate([t_s, np.arange(0, 100, 0.2)]))
    assert same_moments(t_s - 3.25, dense) == pytest.approx(-3.25)
    assert same_moments(dense + 3.25, t_s) == pytest.approx(3.25)
    assert same_moments(t_s, t_s + rng.uniform(0, 1, 30)) is None
    even = np.arange(50.0)
    assert same_moments(even, even + 1000) is None  # any whole second will do
    assert same_moments(t_s[:4], t_s) is None


def test_a_delay_of_any_length_that_movement_tells():
    drive = dense_drive()
    odometry = replace(drive.odometry, t_s=drive.odometry.t_s + 12.3)
    (found,) = compared_with_truth(replace(drive, odometry=odometry), movement_s=12.3)
    assert found.code == "odometry-delay"
    assert found.options["odometry_offset_s"] == pytest.approx(-12.3, abs=0.2)
    assert codes(replace(drive, odometry=odometry)) == ["disagreement"]
    apart = replace(drive, truth=replace(drive.truth, t_s=drive.truth.t_s - 5000.0))
    (clock,) = clocks_apart(apart, movement_s=5000.1)
    assert clock.options == {"truth_offset_s": 5000.1}


def test_forward_and_millimeters_are_told():
    drive = dense_drive(poses=False)
    drifting = drive.odometry.values * 1.0
    drifting[:, 2] += 0.15 * drifting[:, 0]
    x, y = rotated(drifting[:, 0], drifting[:, 1], np.radians(40))
    (found,) = compared_with_truth(with_values(drive, np.column_stack([x, y, drive.odometry.values[:, 2]])))
    assert found.options == {"odometry_forward_rad": pytest.approx(np.radians(40))}
    drive = dense_drive()
    truth = replace(drive.truth, poses=drive.truth.poses * [1000, 1000, 1])
    (found,) = compared_with_truth(replace(drive, truth=truth))
    assert found.options == {"truth_scale": 0.001}


def looks_and_track(places, pictures=45, seed=0):
    """Compare pictures on some spots with a sensor that finds every spot turned by its own angle."""
    rng = np.random.default_rng(seed)
    spot = np.arange(pictures) * places // pictures
    poses = np.column_stack([spot * 1.0, 0.0 * spot, rng.uniform(-3, 3, pictures)])
    turned = np.radians(-65) + rng.normal(0, 0.1, places)

    class Sensor:
        def at(self, number, local):
            apart = local[:, 2] - poses[number, 2] - turned[spot[number]]
            heading = 4 * np.cos(apart) + rng.normal(0, 0.3)
            return SimpleNamespace(log_likelihood=heading)

    library = SimpleNamespace(origin=np.zeros(2), arena=Arena((0, 0, 50, 10), np.zeros((0, 4))))
    t_s = np.arange(pictures) * 2.0
    looks = ComparedPictures(t_s, range(pictures), SimpleNamespace(sensor=Sensor(), library=library))
    return looks, RecordedTruth(t_s, poses, np.zeros(pictures, np.int32))


def test_a_camera_is_not_judged_by_few_places_and_errors_are_by_place():
    looks, track = looks_and_track(3)
    assert len(set(places_seen(looks, track).tolist())) == 3
    assert best_yaw(looks, track) is None
    assert seen_with_truth(looks, track) == []
    found = best_yaw(*looks_and_track(15))
    assert np.degrees(found.value) == pytest.approx(-65, abs=10)
    assert found.sigmas > 2.5


@pytest.mark.parametrize("scatter_deg", [5, 20, 70])
def test_the_interval_of_a_camera_s_direction_holds_it(scatter_deg):
    """However far places disagree: the true direction is within, or nothing is found."""
    within = []
    for seed in range(12):
        looks, track = looks_and_track(15, seed=seed)
        rng = np.random.default_rng(100 + seed)
        turned = np.radians(-30) + rng.normal(0, np.radians(scatter_deg), 15)
        spot = np.arange(45) * 15 // 45

        class Sensor:
            def at(self, number, local, turned=turned, spot=spot, track=track):
                apart = local[:, 2] - track.poses[number, 2] - turned[spot[number]]
                return SimpleNamespace(log_likelihood=4 * np.cos(apart))

        of = SimpleNamespace(sensor=Sensor(), library=looks.localizer.library)
        found = best_yaw(replace(looks, localizer=of), track)
        within.append(np.degrees(found.low) - 2.5 <= -30 <= np.degrees(found.high) + 2.5)
        for one in seen_with_truth(replace(looks, localizer=of), track):
            assert one.numbers["low_deg"] <= one.numbers["yaw_deg"] <= one.numbers["high_deg"] < 0
            assert one.numbers["high_deg"] - one.numbers["low_deg"] <= 80
    assert np.mean(within) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(within))
