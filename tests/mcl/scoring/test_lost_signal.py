"""The lost signal: what it reads, that it notices a kidnapping, and that no truth is needed for it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.step_records import at, made, moment
from maurice_mcl.reasons.second_opinion import FRESH_SHARE, OPINION
from maurice_mcl.scoring.episodes import doubts
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.scoring.lost_signal import PROBABLY_LOST_BELOW, WEIGHTS, BeliefNumbers, LostSignal
from maurice_mcl.scoring.table import PROBABLY_LOST, TableRows
from maurice_mcl.values.records import LibraryEvidence, Opinion, StepRecord

RIGHT = BeliefNumbers(-2.0, -7.0, -1.0, 1.0, 0.3, 0.3)
LOST = replace(RIGHT, evidence=-10.0)


def fed(signal: LostSignal, *numbers: BeliefNumbers) -> list[float]:
    return [signal.see(one) for one in numbers]


def test_a_picture_that_fits_better_elsewhere_lowers_it_and_several_make_an_alarm():
    signal = LostSignal()
    assert fed(signal, *[RIGHT] * 10)[-1] > 0.9
    assert not signal.probably_lost
    falling = fed(signal, *[LOST] * 5)
    assert falling == sorted(falling, reverse=True)
    assert signal.probably_lost
    fed(signal, *[RIGHT] * 10)
    assert not signal.probably_lost


def test_what_has_never_known_where_it_is_cannot_be_lost():
    signal = LostSignal()
    assert max(fed(signal, *[replace(LOST, mass=0.05, spread=4.0)] * 10)) < 0.5
    assert not signal.probably_lost


def test_impossible_evidence_is_a_number():
    signal = LostSignal()
    fed(signal, *[RIGHT] * 5)
    assert 0 <= fed(signal, replace(RIGHT, evidence=-np.inf))[0] < 1


def test_the_page_states_the_weights_and_the_limits():
    page = (Path(__file__).parents[3] / "docs" / "lost-signal.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([a-z ]+) \| (-?\d+\.\d+) \|", page, re.MULTILINE)
    ours = {**OPINION, **WEIGHTS}
    assert {name: float(weight) for name, weight in rows if name in ours} == {
        name: ours[name] for name in [*WEIGHTS, "near", "apart", "apart lately"]
    }
    assert f"Below {PROBABLY_LOST_BELOW:.0%}".replace("%", " %") in page
    assert "a twentieth of them drawn anew" in page
    assert FRESH_SHARE == 1 / 20


@pytest.mark.parametrize(("knew", "is_lost"), [(0.49, False), (0.51, True)])
def test_only_a_run_that_knew_where_it_is_by_half_can_be_probably_lost(knew, is_lost):
    signal = LostSignal()
    for not_lost in (knew, 0.01):
        signal.add(replace(record(1, -2.0), opinion=Opinion(not_lost, 0.12)))
    assert signal.probably_lost == is_lost


def test_features_of_a_picture_count_for_ten_nats_and_half_of_the_mean():
    signal = LostSignal()
    signal.features(replace(RIGHT, evidence=3.5))  # 10.5 nats over the library
    found = signal.features(replace(RIGHT, evidence=-10.0, mass=1.0, survivors=0.001))
    assert (found["gain"], found["last gain"]) == (10.0 / 2 - 3.0 / 2, -3.0)
    assert (found["mass"], found["survivors"]) == (pytest.approx(np.log(49)), pytest.approx(np.log(0.02)))


def record(step: int, evidence: float) -> StepRecord:
    one = made(at(1.0, 1.0, 1.0), step=step, evidence=evidence)
    return replace(one, library_evidence=LibraryEvidence(-7.0, -1.0))


def test_numbers_of_a_record_and_of_one_without_library():
    one = replace(record(1, -3.0), parents=np.array([0, 0, 1, -1], np.int32))
    found = BeliefNumbers.of(one)
    assert found is not None
    assert (found.evidence, found.library_mean, found.library_best) == (-3.0, -7.0, -1.0)
    assert found.survivors == 0.5
    assert found.mass == pytest.approx(1)
    assert BeliefNumbers.of(made(at(1.0, 1.0, 1.0))) is None
    assert LostSignal().add(made(at(1.0, 1.0, 1.0))) is None


def test_events_say_when_it_is_probably_lost_and_the_state_does_so_without_truth():
    for truth in (None, (1.0, 1.0, 0.0)):
        detector, kinds = EventDetector(), []
        for step in range(1, 25):
            one = record(step, -2.0 if step < 13 else -11.0)
            kinds += [event.kind for event in detector.see(moment(one, truth), one)]
            assert detector.knows is not None
        assert kinds.count(PROBABLY_LOST) == 1
        assert (detector.state == PROBABLY_LOST) == (truth is None)


def test_the_summary_of_a_run():
    signal, rows = LostSignal(), TableRows()
    assert signal.summary() is None
    for step in range(1, 31):
        one = record(step, -11.0 if 13 <= step < 20 else -2.0)
        signal.add(one)
        rows.add(moment(one), one, signal)
    found = signal.summary()
    assert found is not None
    [(first, last)] = doubts(rows.table())
    assert 13 <= first <= 17
    assert 19 <= last <= 22
    assert 0.5 < found.share < 1
    assert found.at_end > 0.5


def test_the_library_as_a_whole_explains_a_picture_less_than_its_best_entry():
    _, one = next(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    found, cost = one.library_evidence, one.sighting.comparison.cost.astype(float)
    assert found is not None
    assert found.best == pytest.approx(-cost.min())
    assert found.mean == pytest.approx(np.log(np.exp(-cost).mean()))
