"""Each kind of event happens exactly where its definition says, once."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers import expect_facts
from helpers.step_records import Cloud, at, made, moment
from maurice_mcl.scoring.episodes import RunSoFar
from maurice_mcl.scoring.events import (
    KINDS,
    LEAST_SD_M,
    BeyondSigma,
    Dip,
    EventDetector,
    RunEvent,
    deviations,
    joined,
    say_recovery_test,
)
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.table import STATES
from maurice_mcl.values.records import AVERAGES, LIBRARY, PICTURE, RecoveryTest

HERE, NEAR, FAR = at(0, 0, 1), at(0.3, 0, 1), at(3, 0, 1)  # right, right, and 118 in off
SPREAD = [*at(0, 0, 0.4), *at(3, 0, 0.35), *at(6, 0, 0.25)]
TRUTH = (0.0, 0.0, 0.0)


def kinds(events: Sequence[RunEvent]) -> list[tuple[int, str]]:
    return [(event.step, event.kind) for event in events if event.kind not in ("mode-switch", "ess-dip")]


def watch(
    clouds: Sequence[Cloud],
    truth: tuple[float, float, float] | None = TRUTH,
    told: dict[int, str] | None = None,
    detector: EventDetector | None = None,
) -> list[RunEvent]:
    """See clouds from step 1 on, against one truth."""
    found, detector = list[RunEvent](), detector or EventDetector()
    for step, cloud in enumerate(clouds, start=1):
        said = (told or {}).get(step)
        found += detector.see(moment(made(cloud, step=step), truth, *([said] if said else [])), made(cloud))
    return found


def test_localized_is_said_when_four_of_five_are_known():
    assert kinds(watch([HERE] * 4)) == []
    assert kinds(watch([HERE] * 9)) == [(5, "localized")]
    assert watch([HERE] * 9)[0].text == "localized from step 1 on"
    assert kinds(watch([FAR, HERE, FAR, HERE, HERE, HERE, HERE])) == [(6, "localized")]
    assert "from step 2" in watch([FAR, HERE, FAR, HERE, HERE, HERE])[-1].text
    assert kinds(watch([HERE, FAR, HERE, FAR, HERE])) == [], "three of five are too few"


def test_lost_is_four_running_and_said_once():
    assert (8, "lost") not in kinds(watch([HERE] * 5 + [FAR] * 3))
    found = watch([HERE] * 5 + [FAR] * 10)
    assert [one for one in kinds(found) if one[1] == "lost"] == [(9, "lost")]
    off = "now 3.00 m and 0 deg off, sure of it"
    assert found[-1].text == f"wrong from step 6, declared lost at step 9; {off}"
    turned = [made(HERE, step=step, heading=1.0) for step in range(1, 6)]
    detector = EventDetector()
    found = [event for one in turned for event in detector.see(moment(one, TRUTH), one)]
    assert kinds(found) == [(4, "lost")]
    assert "57 deg off" in found[0].text


def test_recovery_comes_after_loss_or_kidnapping():
    found = watch([HERE] * 5 + [FAR] * 6 + [HERE] * 6)
    assert [kind for _, kind in kinds(found) if kind != "beyond-three-sigma"] == [
        "localized",
        "lost",
        "recovered",
    ]
    last = found[-1]
    said = "wrong from step 6, declared lost at step 9; localized again from step 12 on"
    assert (last.step, last.text) == (16, said)
    found = watch(([HERE] * 5 + [FAR] * 5) * 3 + [HERE] * 5)
    said = [kind for _, kind in kinds(found) if kind != "beyond-three-sigma"]
    assert said == ["localized"] + ["lost", "recovered"] * 3
    found = watch([HERE] * 6 + [FAR] * 2 + [HERE] * 7, told={7: "kidnapped"})
    said = [one for one in kinds(found) if one[1] in ("kidnapped", "lost", "localized", "recovered")]
    assert said == [(5, "localized"), (7, "kidnapped"), (13, "recovered")]
    assert found[-1].text == "wrong from step 7; localized again from step 9 on"
    found = watch([SPREAD] * 6 + [HERE] * 5, (0, 5, 0))
    assert kinds(found)[0] == (4, "lost")
    assert "not localized yet" in found[0].text
    searching = watch([FAR] * 6 + [HERE] * 5)
    assert [kind for _, kind in kinds(searching)][-1] == "localized"


@settings(max_examples=60)
@given(st.lists(st.sampled_from([0, 1, 2, 3]), min_size=1, max_size=24))
def test_events_agree_with_the_table_of_figures(letters):
    """Whatever happens: first localized and lost at the updates that the scores name; 3: no truth."""
    clouds, so_far, detector, alone = (HERE, FAR, SPREAD, HERE), RunSoFar(), EventDetector(), EventDetector()
    found = list[RunEvent]()
    for step, letter in enumerate(letters, start=1):
        record = made(clouds[letter], step=step)
        here = moment(record, None if letter == 3 else TRUTH)
        so_far.add(here, record)
        if step % 2:  # whoever asks first, all who read a run are told the same
            so_far.recent.standing()
        told = detector.see(here, record, so_far)
        assert told == alone.see(here, record)
        assert (detector.state, detector.knows) == (alone.state, alone.knows)
        assert detector.state in STATES
        found += told
    assert so_far.rows.updates == len(letters), "who reads a run adds nothing to it"
    score = score_table(so_far.rows.table())
    firsts = {kind: next((e for e in found if e.kind == kind), None) for kind in ("localized", "lost")}
    localized, lost = firsts["localized"], firsts["lost"]
    assert (None if lost is None else lost.step) == score.lost_at_update
    if score.lost_at_update is None:
        assert (localized is None) == (score.localized_at_update is None)
    if localized is not None and score.localized_at_update is not None:
        judged = [step for step, letter in enumerate(letters, start=1) if letter != 3]
        assert localized.step == judged[judged.index(score.localized_at_update) + 4]
        assert localized.text == f"localized from step {score.localized_at_update} on"


def test_a_run_whose_drawing_begins_late_is_as_lost_as_it_is():
    so_far, detector = RunSoFar(), EventDetector()
    for step, cloud in enumerate([HERE, *[FAR] * 6], start=1):
        record = made(cloud, step=step)
        here = moment(record, TRUTH)
        so_far.add(here, record)
    detector.see(here, record, so_far)
    assert detector.state == "lost"


def test_without_truth_what_needs_it_never_happens():
    found = watch([HERE] * 6 + [FAR] * 8 + [SPREAD] * 3, None, {3: "kidnapped"})
    assert kinds(found) == [(3, "kidnapped")]


def test_states():
    def states(clouds: Sequence[Cloud], truth: tuple[float, float, float] | None = TRUTH) -> list[str]:
        detector, said = EventDetector(), list[str]()
        for step, cloud in enumerate(clouds, start=1):
            detector.see(moment(made(cloud, step=step), truth), made(cloud))
            said.append(detector.state)
        return said

    assert states([SPREAD, HERE]) == ["searching", "localized"]
    assert states([HERE] + [FAR] * 5) == ["localized"] + ["wrong and confident"] * 3 + ["lost"] * 2
    assert states([SPREAD] * 6, (0, 5, 0)) == ["searching"] * 6, "a cloud that was never anywhere is not lost"
    assert states([SPREAD, HERE], None) == ["spread", "converged"]


def test_the_log_is_sorted_by_its_first_word():
    said = {
        1: "kidnapped",
        2: "lights off west room lamp",
        3: "slip +18.3 deg",
        4: "floor  wood",
        5: "\u96e8",
    }
    found = watch([HERE] * 5, None, said)
    assert [(event.kind, event.text) for event in found] == [
        ("kidnapped", "the robot was carried away"),
        ("lights-changed", "lights off west room lamp"),
        ("session", "slip +18.3 deg"),
        ("session", "floor wood"),
        ("session", "\u96e8"),
    ]
    assert [event.is_routine for event in found] == [False, False, False, True, False]
    detector = EventDetector()
    (found,) = detector.see(moment(made(HERE), None, " "), made(HERE))
    assert (found.kind, found.text, found.is_routine) == ("session", "", False)


def test_an_excursion_is_one_event():
    def steps(distances: Sequence[float]) -> list[int]:
        watcher, record = BeyondSigma(), made(at(0, 0, 1))
        sd = float(np.sqrt(0.02**2 / 2 + LEAST_SD_M**2))
        said = [watcher.see(record, np.array([d * sd, 0, 0]), "{:.2f}".format) for d in distances]
        return [number for number, text in enumerate(said) if text is not None]

    assert steps([1, 3.1, 3.1, 3.1, 2.5, 3.1, 3.1]) == [2], "it ends under two, not under three"
    assert steps([1, 3.1, 1, 3.1, 1]) == [], "one update alone is chance"
    assert steps([4, 4, 1.9, 4, 4]) == [1, 4]
    assert kinds(watch([SPREAD] * 3, (0, 5, 0))) == []
    most = [*at(0, 0, 0.6), *at(3, 0, 0.4)]
    assert kinds(watch([most] * 3, (0, 5, 0))) == [(2, "beyond-three-sigma")]


def test_deviations_are_mahalanobis_distances_of_the_cluster():
    rng = np.random.default_rng(0)
    points = rng.multivariate_normal([2, 1], [[0.01, 0.006], [0.006, 0.01]], 400)
    weights = rng.uniform(0.5, 1.5, 400)
    far = [(*p, w) for p, w in zip(points, weights, strict=True)] + [(9.0, 9.0, 5.0)]
    record = made(far, origin=(100.0, -50.0))
    truth = np.array([2.3, 0.8, 0.0])
    inside = np.hypot(*(points - record.estimate.pose[:2]).T) <= 24 * 0.0254
    off = points[inside] - record.estimate.pose[:2]
    covariance = (off.T * weights[inside]) @ off / weights[inside].sum() + np.eye(2) * 0.0254**2
    apart = truth[:2] - record.estimate.pose[:2]
    expected = float(np.sqrt(apart @ np.linalg.inv(covariance) @ apart))
    assert deviations(record, truth) == pytest.approx(expected, rel=1e-3)
    assert deviations(made([(1, 1, 1)]), np.array([1.0508, 1, 0])) == pytest.approx(2, rel=1e-3)


def test_a_dip_is_one_event():
    watcher = Dip()
    shares = [0.5, 0.09, 0.05, 0.2, 0.09, 0.31, 0.099, 0.1]
    assert [watcher.see(share) for share in shares] == [
        None, 0.09, None, None, None, None, 0.099, None
    ]  # fmt: skip
    heavy = [(0, 0, 0.98), *[(0, 0, 0.02 / 39)] * 39]
    (found,) = watch([heavy, heavy], None)
    assert (found.step, found.kind) == (1, "ess-dip")
    assert found.text == "few particles have nearly all the weight: effective sample size 1 of 40 (2.6%)"


def test_reseeding_at_steps_in_a_row_is_one_line_with_all_its_particles():
    detector, found = EventDetector(), list[RunEvent]()
    for step in range(1, 9):
        fresh = [step in (2, 5, 6, 7)] * 2 + [False] * 2
        record = made(HERE, step=step, injected=fresh, events=("reseeded",) if fresh[0] else ())
        found += detector.see(moment(record), record)
    assert [(one.step, one.continues, one.fresh) for one in found] == [
        (2, False, 2),
        (5, False, 2),
        (6, True, 2),
        (7, True, 2),
    ]
    first, second = joined(found)
    assert (first.step, first.last, second.step, second.last, second.fresh) == (2, None, 5, 7, 6)
    expect_facts(second.text, "2 of 4 fresh", "-5.0 nats", "step 7", "6 fresh")


@pytest.mark.parametrize(
    ("said", "kind", "text"),
    [
        (
            "all weights zero",
            "all-weights-zero",
            "no particle is in free space: the weights cannot be updated",
        ),
        ("reseeded", "reseeded", "2 of 4 fresh (fit of this picture -13.2 nats)"),
        ("expanded", "expanded", "fit of this picture -13.2 nats: the whole cloud was spread"),
    ],
)
def test_what_the_filter_noticed(said, kind, text):
    injected = [False, False, True, True]
    record = made(HERE, injected=injected, events=("resampled", said), evidence=-13.21)
    found = EventDetector().see(moment(record), record)
    assert [(event.kind, event.text) for event in found] == [
        (kind, text),
        ("resampled", "effective sample size 4 of 4"),
    ]
    assert [event.is_routine for event in found] == [False, True]


@pytest.mark.parametrize(
    ("test", "said"),
    [
        (RecoveryTest(PICTURE, -9.14, -10.73), "this picture fits badly (-10.7 nats, threshold -9.1)"),
        (RecoveryTest(PICTURE, -12.01, -12.04), "this picture fits badly (-12.04 nats, threshold -12.01)"),
        (
            RecoveryTest(LIBRARY, 0.0, -0.12),
            "the cloud matches this picture worse than the library's mean (-0.1 nats, threshold 0.0)",
        ),
        (
            RecoveryTest(AVERAGES, -3.0, -3.61),
            "pictures fit badly of late (-3.6 nats, long-term average -3.0)",
        ),
        (
            RecoveryTest(PICTURE, -9.1, -np.inf),
            "no particle in free space (threshold -9.1 nats)",
        ),
    ],
)
def test_recovery_says_what_it_compared_with_what(test, said):
    assert say_recovery_test(test) == said
    record = replace(
        made(HERE, injected=[False, False, True, True], events=("reseeded",)), recovery_test=test
    )
    (event,) = EventDetector().see(moment(record), record)
    assert event.text == f"{said}: 2 of 4 fresh"


Switch = Callable[[Sequence[Cloud]], list[tuple[int, str]]]


@pytest.fixture
def switches() -> Switch:
    def seen(clouds: Sequence[Cloud]) -> list[tuple[int, str]]:
        return [(e.step, e.text) for e in watch(clouds, None) if e.kind == "mode-switch"]

    return seen


def two(left: float, right: float) -> Cloud:
    return [*at(0, 0, left), *at(4, 0, right)]


def test_a_mode_switch_needs_a_lead_and_a_distance(switches):
    assert switches([two(0.6, 0.4), two(0.3, 0.7)]) == [(2, "mode 2 (70%) leads, 4.00 m from mode 1 (30%)")]
    assert switches([two(0.6, 0.4), two(0.46, 0.54), two(0.6, 0.4)]) == [], "by 8 % only"
    assert len(switches([two(0.6, 0.4), two(0.3, 0.7), two(0.7, 0.3)])) == 2
    many = [particle for k in range(5) for particle in at(4.0 * k, 0, 0.2)]
    turned = [(x, y, w * (1.2 if k >= 16 else 0.95)) for k, (x, y, w) in enumerate(many)]
    assert switches([many, turned, many]) == []
    ((step, text),) = switches([two(0.9, 0.1), two(1e-9, 1)])
    assert (step, text) == (2, "mode 2 (100%) leads, 4.00 m from mode 1 (gone)")

    def pair(left: float, right: float) -> Cloud:
        return [*at(0, 0, left), *at(0.59, 0, 0.001, 1), *at(1.2, 0, right)]

    assert len(switches([pair(0.7, 0.3), pair(0.2, 0.8)])) == 1


def test_every_kind_is_documented_and_in_order():
    record = made(HERE, events=("resampled", "reseeded", "all weights zero"))
    found = EventDetector().see(moment(record, None, "bump", "kidnapped"), record)
    order = list(KINDS)
    assert [order.index(event.kind) for event in found] == sorted(order.index(e.kind) for e in found)
    assert {event.kind for event in found} <= set(KINDS)
    assert {(event.step, event.time_s) for event in found} == {(1, 2.5)}
    text = (Path(__file__).parents[3] / "docs" / "saved-runs.md").read_text(encoding="utf-8")
    text = text.split("## Kinds of events")[1]
    assert re.findall(r"^\| `([a-z-]+)` \|", text, re.MULTILINE)[: len(KINDS)] == list(KINDS)
    for name in STATES:
        assert name in text


def test_texts_and_runs_repeat():
    inches = EventDetector(say=lambda length_m: f"{length_m / 0.0254:.0f} in")
    found = watch([HERE] * 5 + [FAR] * 4, detector=inches)
    assert "118 in" in next(event.text for event in found if event.kind == "lost")
    clouds = [HERE, FAR, SPREAD, NEAR] * 6
    assert watch(clouds) == watch(clouds)
    record = made(SPREAD)
    before = record.weighted.poses.copy(), record.weighted.log_weights.copy()
    EventDetector().see(moment(record, TRUTH), record)
    assert (record.weighted.poses == before[0]).all()
    assert (record.weighted.log_weights == before[1]).all()
