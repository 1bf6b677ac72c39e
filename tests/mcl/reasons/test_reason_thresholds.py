"""Each number of the reasons that are no rules, just under and just over it.

Numbers are literal: `python -m benchmarks.studies.mutants` changes each constant, and lists those that no
test notices. These may change unnoticed, for a reason:

* `DRAWS` of a surprise, `KEPT`, `SAMPLED`: how many draws or entries stand for all. More of them cost time,
  and move a figure by less than its own accuracy.
* `MOST_WAITING`, `MOST_PICTURES`: memory and time, hardly ever a result.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.lost_runs import healthy
from helpers.run_tables import run_table
from helpers.step_records import at, made, moment
from maurice_mcl.reasons import budget
from maurice_mcl.reasons.causes import Failure, stays_in_obstacles
from maurice_mcl.reasons.evidence import EvidenceFinder, surprise
from maurice_mcl.reasons.explanation import where_lost
from maurice_mcl.reasons.rivals import with_rivals
from maurice_mcl.reasons.second_opinion import (
    OPINION,
    OpinionReader,
    SecondFilter,
    SecondOpinion,
    Shares,
    recalibrated,
    sensed_ahead,
)
from maurice_mcl.reasons.surroundings import PlaceFit, Surroundings, light_fit
from maurice_mcl.reasons.suspicion import scan_doubts
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.batch import compared_once
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.lost_signal import BeliefNumbers
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import PROBABLY_LOST
from maurice_mcl.sensor.laser.fit import ScanFit
from maurice_mcl.values.map import Region

SIDES = [False, True]  # just under, just over

RIGHT = BeliefNumbers(-2.0, -7.0, -1.0, 1.0, 0.3, 0.3)


@pytest.fixture(scope="module")
def localizer() -> mcl.Localizer:
    return mcl.make_localizer(mcl.tiny_library(), particles=300).of_session(mcl.tiny_session())


@pytest.fixture(scope="module")
def dense(localizer) -> mcl.Localizer:
    return budget.with_dense_references(localizer)


def test_a_perfect_part(localizer, dense):
    assert f"{budget.MANY_PARTICLES:,} particles" == budget.SAMPLING
    assert (
        dense.library.size / 16 == len(np.unique(dense.library.poses[:, :2], axis=0)) == 221
    )  # 4 times as near
    denser = budget.with_dense_references(dense)  # a quarter as far apart would be 3,500
    assert 2300 < denser.library.size / 16 < 2700
    still, noise = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
    moved = budget.TrueMotion().move(still, np.zeros(2), np.array([1.0, 0.0, 0.5]), noise)[0]
    assert moved == pytest.approx([1.011, 0.011, 0.5 + np.radians(0.1) + 0.005], abs=1e-6)


def test_a_perfect_sensor_is_wide_by_half_a_spacing_and_never_sure_forever(localizer):
    moments = list(mcl.tiny_session().moments())[:1]
    comparisons = compared_once(localizer.sensor, moments)
    truth = localizer.library.poses[0]
    moments = [replace(moments[0], truth=truth - [off_m, off_m, 0.0]) for off_m in (0.0, 1.0)]
    found, away = budget.perfect_comparisons(localizer, moments, [*comparisons] * 2)
    assert away.log_likelihood.min() == -60.0
    beside, turned = found.log_likelihood[8], found.log_likelihood[1]  # 0.5 m and 45 degrees away
    assert (beside, turned) == (pytest.approx(-2.0), pytest.approx(-2.0))


def test_a_reason_is_0_05_nats():
    def lost(nats):
        mine = SimpleNamespace(nats=np.array([nats, 0.0]), sample=np.array([1.0, 0.0]), reference=np.zeros(2))
        return where_lost(mine, SimpleNamespace(nats=np.zeros(2)), 1)

    assert [lost(nats) is not None for nats in (0.049, 0.051)] == SIDES


@pytest.mark.parametrize(("parted", "named"), [(11, False), (10, True)])
def test_a_rival_is_elsewhere_at_more_than_half_of_five_steps(parted, named):
    here, there = np.ones((12, 3)), np.ones((12, 3))
    there[parted - 1 :, 0] = 4.0
    tables = {"a": run_table(12, poses=here), "b": run_table(12, poses=there, knows=np.full(12, 0.9))}
    doubt = Failure("unknown", 8, Episode(PROBABLY_LOST, 8, 12, noticed=8), truth_known=False)
    verdicts = with_rivals(
        {"a": RunVerdict(updates=12, failures=(doubt,)), "b": RunVerdict(updates=12)}, tables
    )
    assert ("rival" in verdicts["a"].failures[0].evidence) == named


def test_a_second_filter_has_200_to_2000_particles(localizer, dense):
    assert [len(SecondFilter.of(one).poses) for one in (localizer, dense)] == [200, 2000]


@pytest.mark.parametrize(
    ("radii", "turned", "near", "elsewhere"),
    [
        (1.32, 0, 1, 0),
        (1.35, 0, 0, 0),
        (1.98, 0, 0, 0),
        (2.02, 0, 0, 1),
        (0, 44, 1, 0),
        (0, 46, 0, 0),
        (0, 59, 0, 0),
        (0, 61, 0, 1),
    ],
)
def test_a_second_filter_agrees_within_4_3_of_a_radius_and_contradicts_beyond_2(
    localizer, radii, turned, near, elsewhere
):
    second, here = SecondFilter.of(localizer), np.array([0.5, 0.5, 0.0])
    pose = [*(here[:2] - localizer.library.origin), np.radians(turned)]
    second.poses = np.array([pose], np.float32)
    second.poses[0, 0] += radii * localizer.radii.right_m
    second.weights, second.entries = np.ones(1), np.zeros(1, np.int32)
    assert second.shares(here) == Shares(near, elsewhere)


def test_the_fitted_numbers_of_a_second_opinion():
    features = OpinionReader().features(RIGHT, Shares(0.5, 0.2))
    odds = sum(weight * features[name] for name, weight in OPINION.items())
    own = -0.57 + 0.56 * 5 + 0.53 * 5 + 0.13 * 1 + 0.39 * np.log(49) - (0.21 + 0.37) * np.log(0.3)
    assert odds == pytest.approx(own + 0.23 * np.log(0.5) + (0.39 + 0.28) * np.log(2.5))
    widened = 0.5 + 0.43 * 2.0 + 0.87 * np.log(4.0)
    assert recalibrated(2.0, 4.0) == pytest.approx(1 / (1 + np.exp(-widened)))
    assert [recalibrated(8.0, widening) <= 0.5 for widening in (99.0, 101.0)] == SIDES


def test_an_alarm_is_below_a_half_with_a_calibrated_likelihood_and_below_0_12_with_any(localizer):
    others = replace(localizer.sensor.parameters, blend="thesis", likelihood="linear")
    sensors = [localizer.sensor, replace(localizer.sensor, parameters=others)]
    opinions = [SecondOpinion.of(replace(localizer, sensor=sensor)) for sensor in sensors]
    assert [opinion.alarm_below for opinion in opinions] == [0.5, 0.12]


@pytest.mark.parametrize(("scans", "doubts"), [(2, ()), (3, ((5, 7),))])
def test_three_scans_in_a_row_that_do_not_fit_are_a_doubt(scans, doubts):
    off, sure = ScanFit(off=0.9), StepScore(None, None, True, None, None)
    updates = [
        healthy(k, score=sure, scan_here=off if 5 <= k < 5 + scans else ScanFit(0.0)) for k in range(1, 12)
    ]
    assert scan_doubts(updates) == doubts


class HalfWay:
    """A motion model with as much noise as a cloud that found itself has: 0.1 m, 0.1 m and 2 degrees."""

    def __init__(self, noise: float) -> None:
        self.noise = noise

    def move(self, poses, origin, motion, noise):
        sides = np.resize([1.0, -1.0], len(poses))[:, None]
        return (poses + self.noise * sides * [0.1, 0.1, np.radians(2)]).astype(np.float32)


def test_how_far_a_movement_is_from_the_model_by_the_accuracy_of_a_pose_and_a_cloud_that_found_itself():
    still, motions = np.zeros(3), np.zeros((1, 3))
    assert surprise(HalfWay(1.0), np.zeros(2), still, still, motions).growth == pytest.approx(1.5 * np.log(2))
    off = np.array([2 * 0.0254, 0.0, np.radians(4)])
    found = surprise(HalfWay(0.0), np.zeros(2), still, off, motions)
    assert (found.forward, found.turn) == (pytest.approx(2.0), pytest.approx(2.0))


def test_shares_of_a_second_opinion_count_from_a_hundredth():
    assert OpinionReader().features(RIGHT, Shares(0.0, 1.0))["near"] == pytest.approx(np.log(0.01))


class Towards(mcl.PoseSensor):
    """A pose sensor that puts every pose near the robot before all others by some nats."""

    name = "towards"

    def __init__(self, nats: float) -> None:
        self.nats = nats

    def read(self, frame):
        return frame.step

    def log_likelihood(self, reading, poses, origin, spread=None):
        near = np.hypot(*(poses[:, :2] + origin - [1.0, 0.75]).T) < 0.4
        return np.where(near & (np.cos(poses[:, 2]) > 0.4), 0.0, -self.nats).astype(np.float32)

    def propose(self, reading):
        return None


def test_pose_sensors_speak_for_an_estimate_with_half_of_their_nats(localizer):
    own = mcl.make_localizer(mcl.tiny_library(), particles=300, sensors=[Towards(3.0)])
    parameters = replace(own.sensor.parameters, widening=1.0)
    own = replace(own, sensor=replace(own.sensor, parameters=parameters)).of_session(mcl.tiny_session())
    _, record = next(mcl.run(own, mcl.tiny_session()))
    record = replace(record, estimate=replace(record.estimate, pose=np.array([1.0, 0.75, 0.0])))
    opinion = SecondOpinion.of(own)
    said, ahead = opinion.add(record), sensed_ahead(record, own)
    assert ahead == pytest.approx(3.0 * parameters.sharpness)
    more = np.log(said / (1 - said)) - opinion.raw
    assert more == pytest.approx(0.5 * ahead / 2)  # the running mean takes half of the first


@pytest.mark.parametrize(("moved_m", "repeated"), [(0.009, False), (0.011, True)])
def test_a_picture_is_repeated_where_the_robot_moved_by_a_centimeter(moved_m, repeated):
    finder = EvidenceFinder()
    for step in (1, 2):
        record = made(at(0, 0, 1), step=step, references=3)
        image = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
        frame = replace(record.frame, image=image, motions=np.array([[moved_m, 0.0, 0.0]]))
        record = replace(record, frame=frame)
        found = finder.see(moment(record), record, None)
    assert found.repeated == repeated


@pytest.mark.parametrize("cells", [0.95, 1.05])
def test_a_truth_is_in_an_obstacle_a_cell_deep(cells):
    library = mcl.tiny_library()
    sofa = Region("sofa", np.array([[0.5, 0.5], [0.9, 0.5], [0.9, 0.9], [0.5, 0.9]]))
    library = replace(library, arena=replace(library.arena, obstacles=(sofa,)))
    localizer = mcl.make_localizer(library, settings={"map.obstacles": "solid"})
    run = run_table(1, truths=np.array([[0.5 + cells / 36, 0.7, 0.0]]))
    assert bool(stays_in_obstacles(run, localizer)) == (cells > 1)


# What a library says of a place: references half a meter and 45 degrees apart.


@pytest.fixture(scope="module")
def surroundings(localizer) -> Surroundings:
    return Surroundings(localizer.sensor, localizer.radii.lost_m)


def test_a_reference_shows_the_view_within_1_1_spacings_and_46_degrees(surroundings):
    first = surroundings.sensor.library.poses[0]
    assert [0 in surroundings.near(first - np.array([off_m, 0, 0])) for off_m in (0.56, 0.54)] == SIDES
    assert [
        0 in surroundings.near(first + np.array([0, 0, np.radians(deg)])) for deg in (46.5, 45.5)
    ] == SIDES


def test_a_rival_place_scores_as_well_within_a_nat(surroundings):
    frame = next(mcl.tiny_session().moments()).frame
    comparison, poses = surroundings.sensor.see(frame), surroundings.sensor.library.poses
    truth, other = poses[0], 90

    def fit(likely_there):
        likely = np.full(len(poses), -50.0, np.float32)
        likely[[0, other]] = -1.0, likely_there
        return surroundings.fit(replace(comparison, log_likelihood=likely), truth, poses[50])

    alike = -1.0 - fit(-1.0).behind  # as likely as the true pose, which lies between references
    assert [fit(alike - less).rivals for less in (1.05, 0.95)] == [0, 1]


def lit(surroundings, factor):
    """How a picture of the first update is seen, brightened by a factor above black."""
    seen = next(mcl.tiny_session().moments())
    image = np.clip((seen.frame.image.astype(float) - 24) * factor + 24, 0, 255).astype(np.uint8)
    fit = PlaceFit(9.0, 0.0, 0.0, 1, 1, 0, (0.0, 0.0), "color", 0.0)
    return light_fit(surroundings, image, seen.truth, seen.truth, fit)


def test_a_light_is_corrected_from_a_tenth_on_and_black_has_a_least_level(surroundings):
    now = lit(surroundings, 1.0).ratio
    near = [lit(surroundings, np.exp(target - now)) for target in (0.08, 0.12)]
    assert [one.cost != 9.0 for one in near] == SIDES, [one.ratio for one in near]
    black, gray = (
        lit(surroundings, 0.0),
        surroundings.expected_levels(next(mcl.tiny_session().moments()).truth),
    )
    assert black.ratio == pytest.approx(np.log(3 * 2.0 / (gray - 24).sum()))
