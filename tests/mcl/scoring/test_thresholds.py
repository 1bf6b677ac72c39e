"""Each number of the scores, just under and just over it.

Numbers are literal: `python -m benchmarks.studies.mutants` changes each constant, and lists those that no
test notices. These may change unnoticed, for a reason:

* `DRAWS` of the bootstrap: how many draws stand for all. More of them cost time, and move a figure by less
  than its own accuracy.
* `FIRST_ROOM`, `SINGLE_MODE_SHARE`: memory and time, hardly ever a result.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.step_records import Cloud, at, made, moment
from maurice_mcl.scoring.comparison import ErrorDifference, OdometryAlone, block_length, mean_interval
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.scoring.lost_signal import BeliefNumbers, LostSignal, probability_by
from maurice_mcl.scoring.metrics import relative_error, score_table, successes
from maurice_mcl.scoring.modes import Ancestry, ModeTracker, picture_gain
from maurice_mcl.scoring.rival_places import RivalPlace, RivalPlaces
from maurice_mcl.scoring.table import LOST, SEARCHING, TableRows
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
