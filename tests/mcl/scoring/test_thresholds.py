"""Each number of the scores, and of the reasons that are no rules, just under and just over it.

Numbers are literal: `python -m benchmarks.studies.mutants` changes each constant, and lists those that no
test notices. These may change unnoticed, for a reason:

* `DRAWS` of the bootstrap and of a surprise, `KEPT`, `SAMPLED`: how many draws or entries stand for all. More
  of them cost time, and move a figure by less than its own accuracy.
* `FIRST_ROOM`, `MOST_WAITING`, `MOST_PICTURES`, `SINGLE_MODE_SHARE`: memory and time, hardly ever a result.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.lost_runs import healthy
from helpers.run_tables import run_table
from helpers.step_records import Cloud, at, made, moment
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
from maurice_mcl.scoring.comparison import ErrorDifference, OdometryAlone, block_length, mean_interval
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.scoring.lost_signal import BeliefNumbers, LostSignal, probability_by
from maurice_mcl.scoring.metrics import StepScore, relative_error, score_table, successes
from maurice_mcl.scoring.modes import Ancestry, ModeTracker, picture_gain
from maurice_mcl.scoring.rival_places import RivalPlace, RivalPlaces
from maurice_mcl.scoring.table import LOST, PROBABLY_LOST, SEARCHING, TableRows
from maurice_mcl.sensor.laser.fit import ScanFit
from maurice_mcl.values.map import Region
from maurice_mcl.values.pose_sensor import Sensed
from maurice_mcl.values.records import Opinion

SIDES = [False, True]  # just under, just over


def told(clouds: list[Cloud], truth=None, **changes) -> list[str]:
    """Return kinds and texts of the events of a run with these clouds."""
    detector, found = EventDetector(), []
    for step, cloud in enumerate(clouds, start=1):
        record = replace(made(cloud, step=step), **changes)
        found += [f"{one.kind}: {one.text}" for one in detector.see(moment(record, truth), record)]
    return found


def count(kind: str, events: list[str]) -> int:
    return sum(event.startswith(f"{kind}: ") for event in events)


# Comparisons.


def test_an_interval_needs_24_values_and_six_blocks():
    assert [mean_interval(np.arange(n) % 5.0) is not None for n in (23, 24)] == SIDES
    assert block_length(np.repeat([0.0, 1.0], 30)) == 10
    blocks = [ErrorDifference(1.0, None, 10, updates, 0, updates) for updates in (59, 60)]
    assert [one.is_sure for one in blocks] == SIDES


def test_no_more_than_0_97_of_a_correlation_is_believed():
    assert block_length(np.arange(10_000.0)) == 253  # 1.1447 (a n)^(1/3), a = 4 x 0.97^2 / (1 - 0.97^2)^2


def test_sensors_make_it_worse_by_a_tenth():
    worse = [ErrorDifference(mean, (0.05, 0.2), 1, 60, 0, 60) for mean in (0.09, 0.11)]
    assert [OdometryAlone(1.0, 1.0, one).is_better for one in worse] == SIDES


# Episodes.


def test_an_episode_is_sure_or_bereft_at_more_than_half_of_its_steps_and_a_search_at_ten():
    lost = [Episode(LOST, 1, 10, steps=10, sure=n, bereft=n) for n in (5, 6)]
    assert [one.is_sure for one in lost] == [one.is_bereft for one in lost] == SIDES
    searches = [Episode(SEARCHING, 1, 40, steps=40, sure=n) for n in (9, 10)]
    assert [one.is_sure for one in searches] == SIDES


# Events.


def heavy(share: float, size: int = 1000) -> Cloud:
    """A cloud whose effective sample size is this share of its particles, at one place."""
    few = round(share * size)
    return [(0.0, 0.0, 1.0)] * few + [(0.0, 0.0, 1e-12)] * (size - few)


@pytest.mark.parametrize(
    ("shares", "dips"), [((0.11,), 0), ((0.09,), 1), ((0.09, 0.29, 0.09), 1), ((0.09, 0.31, 0.09), 2)]
)
def test_a_dip_is_under_a_tenth_and_ends_above_0_3(shares, dips):
    assert count("ess-dip", told([heavy(share) for share in shares])) == dips


CROSS = [(0.2, 0.0, 1.0), (-0.2, 0.0, 1.0)]  # 0.2016 m wide, with the accuracy of the truth


@pytest.mark.parametrize(
    ("off_m", "excursions"),
    [
        ((0.595, 0.595), 0),  # 2.95 standard deviations
        ((0.615,), 0),
        ((0.615, 0.615), 1),
        ((0.615, 0.615, 0.413, 0.615, 0.615), 1),  # 2.05
        ((0.615, 0.615, 0.393, 0.615, 0.615), 2),  # 1.95
    ],
)
def test_the_truth_is_beyond_at_3_sd_for_two_updates_until_it_is_within_2(off_m, excursions):
    detector, found = EventDetector(), []
    for step, x in enumerate(off_m, start=1):
        record = made(CROSS, step=step)
        found += [one.kind for one in detector.see(moment(record, (x, 0.0, 0.0)), record)]
    assert found.count("beyond-three-sigma") == excursions


@pytest.mark.parametrize("share", [0.49, 0.51])
def test_a_cluster_claims_a_place_with_half_of_the_weight(share):
    rest = [(20.0 + k, 9.0, (1 - share) / 100) for k in range(100)]
    cloud = [(x, y, share / 2) for x, y, _ in CROSS] + rest
    assert count("beyond-three-sigma", told([cloud] * 3, (0.9, 0.0, 0.0))) == (share > 0.5)


def two(first: float, second: float) -> Cloud:
    """Two places that share the weight with forty others."""
    return (
        at(0, 0, first)
        + at(3, 0, second)
        + [(9.0 + 2 * k, 9.0, (1 - first - second) / 40) for k in range(40)]
    )


@pytest.mark.parametrize(
    ("clouds", "switched"),
    [
        ([two(0.6, 0.2), two(0.1, 0.29)], False),
        ([two(0.6, 0.2), two(0.1, 0.31)], True),  # a mode leads with 0.3 of the weight ...
        ([two(0.6, 0.2), two(0.4, 0.49)], False),
        ([two(0.6, 0.2), two(0.39, 0.5)], True),  # ... and a tenth before the last leader
    ],
)
def test_another_mode_leads(clouds, switched):
    assert count("mode-switch", told(clouds)) == switched


@pytest.mark.parametrize(("knows", "chance"), [(0.0105, "probability of 1%"), (0.0095, "under 1%")])
def test_a_chance_below_1_percent_is_not_written_out(knows, chance):
    detector = EventDetector()
    for step, not_lost in enumerate((0.9, knows), start=1):
        record = replace(made(at(0, 0, 1), step=step), opinion=Opinion(not_lost, 0.12))
        events = detector.see(moment(record), record)
    assert chance in events[0].text


# The lost signal, and places as likely.

RIGHT = BeliefNumbers(-2.0, -7.0, -1.0, 1.0, 0.3, 0.3)


def test_differences_count_for_ten_nats_shares_from_a_fiftieth_and_means_take_half():
    signal = LostSignal()
    signal.features(replace(RIGHT, evidence=20.0))
    found = signal.features(replace(RIGHT, evidence=-40.0, mass=0.0, spread=0.0, survivors=0.0))
    assert (found["last gain"], found["gain"], found["gap"]) == (-10.0, 0.0, 0.0)
    assert (found["mass"], found["spread"]) == (
        pytest.approx(np.log(0.02 / 0.98)),
        pytest.approx(np.log(0.02)),
    )


@pytest.mark.parametrize("under", SIDES)
def test_a_run_is_probably_lost_below_6_percent_until_it_knows_by_half(under):
    signal = LostSignal()
    for not_lost in (0.9, 0.059 if under else 0.061):
        signal._judge(not_lost, 0.06)
    assert signal.probably_lost == under


def test_beams_against_an_estimate():
    assert probability_by(0.25) == pytest.approx(0.495)
    assert probability_by(0.225) == pytest.approx(0.99 / (1 + np.exp(-1)))
    assert probability_by(0.0) == pytest.approx(0.99, abs=1e-3)


class Twins:
    """A sensor by which every other place is behind the estimate's by some nats."""

    name = "twins"

    def __init__(self, against: float = 0.0, behind: float = 0.0, ahead: float = 0.0) -> None:
        self.share_against, self.behind, self.ahead = against, behind, ahead

    def against(self, reading, pose):
        return self.share_against

    def settled(self, reading, pose):
        return pose, (0.0 if abs(pose[2]) < 0.1 else -self.behind) + self.ahead * (pose[0] - 60)


def sensed(place: tuple[float, float], sensor: Twins, heading: float = 0.0):
    record = made(at(*place, 1.0), heading=heading)
    part = Sensed(sensor, "scan", 1.0, np.zeros(0, np.float32))
    return replace(
        record,
        sighting=replace(record.sighting, comparison=replace(record.sighting.comparison, sensed=(part,))),
    )


def test_doubt_goes_by_a_quarter_of_the_way():
    signal = LostSignal()
    low = signal.add(sensed((0, 0), Twins(against=0.6)))
    assert signal.add(sensed((0, 0), Twins())) == pytest.approx(low + 0.25 * (0.99 - low), abs=1e-3)


def seen(sensor: Twins) -> tuple[RivalPlace, ...]:
    """The places of a robot that jumped by 60 m, the estimate's own first."""
    places = RivalPlaces()
    for place in ((0.0, 0.0), (60.0, 0.0)):
        record = sensed(place, sensor)
        places.see(record, record.sighting.comparison.sensed[0])
    return places.places


def test_a_place_left_is_half_as_much_behind_as_a_reading_says_and_no_rival_from_10_nats_on():
    turned = [place.nats for place in seen(Twins(behind=4.0))[1:] if abs(place.pose[2]) > 1]
    assert turned == pytest.approx([-2.0] * len(turned))
    assert [len(seen(Twins(behind=2 * nats))) > 2 for nats in (10.1, 9.9)] == SIDES
    assert len(seen(Twins())) == 1 + 8


def test_rivals_lie_up_to_3_m_along_a_corridor():
    along_m = [
        [place.pose[0] - 60.0 for place in seen(Twins(ahead=ahead)) if abs(place.pose[2]) > 1]
        for ahead in (-1.0, 1.0)  # nats a meter: those that are farthest back, or ahead
    ]
    assert [min(along_m[0]), max(along_m[1])] == [pytest.approx(-3.0), pytest.approx(3.0)]
    assert set(np.round(along_m[0], 6) % 0.5) == {0.0}


def test_a_place_within_45_degrees_is_the_same():
    turned = [RivalPlace(np.array([0, 0, np.radians(deg)])) for deg in (46, 44)]
    assert [place.is_near(np.zeros(3), 0.4) for place in turned] == SIDES


@pytest.mark.parametrize("nats", [2.2, 2.4])
def test_a_place_a_tenth_as_likely_is_counted(nats):
    signal = LostSignal()
    for place in ((0.0, 0.0), (60.0, 0.0)):
        signal.add(sensed(place, Twins(behind=2 * nats)))
    assert (signal.places > 2) == (nats < 2.3)


# Scores.


def scored(truths, *, spread=0.0, times_s=None):
    """The table of a run whose estimate stays at the origin."""
    rows = TableRows()
    for step, truth in enumerate(truths, start=1):
        cloud = [(spread, 0.0, 1.0), (-spread, 0.0, 1.0)] if spread else at(0, 0, 1)
        record = made(cloud, step=step)
        frame = replace(record.frame, time_s=record.frame.time_s if times_s is None else times_s[step - 1])
        rows.add(moment(replace(record, frame=frame), truth), replace(record, frame=frame))
    return rows.table()


RIGHT_AT, OFF_AT = (0.0, 0.0, 0.0), (5.0, 0.0, 0.0)


def test_updates_in_a_row_and_of_the_last():
    def score(letters):
        return score_table(scored([RIGHT_AT if letter == "r" else OFF_AT for letter in letters]))

    assert [score("r" * 6 + "o" * n).lost for n in (3, 4)] == SIDES
    assert [score("o" * 6 + letters).localized_at_update is not None for letters in ("rrror", "rrorr")] == [
        True,
        True,
    ]
    assert [
        score("o" * 6 + letters).localized_at_update is not None for letters in ("rroor", "rrrro")
    ] == SIDES
    assert [score("o" * 3 + "r" * n + "o" * (10 - n)).right_at_end for n in (6, 7)] == SIDES
    assert [score("o" * n + "r" * (10 - n)).right_at_end for n in (4, 3)] == SIDES
    assert score("r" * 9).right_at_end is None
    assert score("ooorrr").error_mean_m == pytest.approx(0, abs=1e-9)
    assert score("oooorr").error_mean_m == pytest.approx(5 / 3)


@pytest.mark.parametrize(
    ("turned", "correct", "off"),
    [(29, True, False), (31, False, False), (44, False, False), (46, False, True)],
)
def test_a_heading_is_right_within_30_degrees_and_lost_beyond_45(turned, correct, off):
    run = scored([(0.0, 0.0, np.radians(turned))])
    assert (run.is_correct[0], run.is_off[0]) == (correct, off)


def test_converged_is_nine_tenths_of_the_weight():
    assert [
        bool(replace(scored([RIGHT_AT]), converged=np.array([share])).is_converged[0])
        for share in (0.89, 0.9)
    ] == SIDES


def test_a_goal_is_reached_after_1000_inches_and_a_segment_has_4_radii():
    def drive(length_m, poses=101):
        return replace(
            scored([RIGHT_AT] * poses), truths=(t := np.linspace([0, 0, 0], [length_m, 0, 0], poses)), poses=t
        )

    assert [score_table(drive(length)).reached for length in (25.39, 25.41)] == SIDES
    relative = score_table(drive(25.41)).relative
    assert relative is not None
    assert relative.segment_m == pytest.approx(4 * 0.4572)
    assert relative == relative_error(drive(25.41).truths[3:], drive(25.41).poses[3:], 1.8288)


def test_the_thesis_calls_a_narrow_cloud_within_five_minutes_a_success():
    def at_step(preset, updates=1, **columns):
        run = replace(scored([RIGHT_AT] * updates), **{k: np.array(v) for k, v in columns.items()})
        return successes(run, (2.0, 2.0))[preset].at_step is not None

    whole = {"converged": [1.0], "circle": [1.0]}
    assert [at_step(0, mean_sd_m=[[sd, sd]], **whole) for sd in (0.21, 0.19)] == SIDES
    assert [at_step(0, mean_sd_m=[[0.1, 0.1]], converged=[share]) for share in (0.9, 0.91)] == SIDES
    assert [at_step(1, circle=[share]) for share in (0.9, 0.91)] == SIDES
    late = [at_step(1, 2, circle=[0.5, 1.0], times_s=[0.0, after_s]) for after_s in (301.0, 299.0)]
    assert late == SIDES


# The cloud.


@pytest.mark.parametrize("near", [4, 5])
def test_a_gain_is_told_of_five_particles(near):
    record = made(at(0, 0, 0.5, near) + at(9, 9, 0.5))
    assert (picture_gain(record, np.zeros(3), 0.5) is not None) == (near == 5)


def test_ancestors_are_those_of_ten_updates():
    ancestry = Ancestry()
    half = [0, 0, 2, 2]
    for parents in (half, *[[0, 1, 2, 3]] * 9):
        ancestry.see(made(at(0, 0, 1), parents=parents))
    assert ancestry.distinct() == 2
    ancestry.see(made(at(0, 0, 1), parents=[0, 1, 2, 3]))
    assert ancestry.distinct() == 4


@pytest.mark.parametrize(("descends", "identity"), [(0.24, 2), (0.26, 1)])
def test_a_mode_continues_one_from_which_a_quarter_of_its_weight_descends(descends, identity):
    tracker = ModeTracker()
    tracker.see(made([*at(0, 0, 1, 2), *[(50.0 + 9 * k, 0.0, 1e-9) for k in range(2)]]))
    now = [(5.0, 5.0, descends / 2)] * 2 + [(5.0, 5.0, (1 - descends) / 2)] * 2
    (mode,) = tracker.see(made(now))
    assert mode.identity == identity


# Reasons that are no rules.


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
