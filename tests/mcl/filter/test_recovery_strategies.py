"""Strategies of recovery: laws of all, and each by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.filter.recovery import (
    Augmented,
    DynamicThreshold,
    Expansion,
    SensorResetting,
    below_library,
    none,
)
from maurice_mcl.filter.recovery import always as always_some
from maurice_mcl.values.records import NO_HISTORY, RecoveryState

STRATEGIES = {
    "none": none,
    "always": always_some(0.05),
    "library": below_library(0.05),
    "threshold": DynamicThreshold(0.1, 3.0),
    "sensor": SensorResetting(),
    "augmented": Augmented(),
    "expansion": Expansion(),
}
NATS = st.one_of(st.just(-math.inf), st.floats(-800, 0))


def _run(strategy, evidence):
    """Give every verdict on a sequence of evidences."""
    memory, found = NO_HISTORY, []
    for nats in evidence:
        found.append(strategy(nats, memory))
        memory = found[-1].state
    return found


@pytest.mark.parametrize("name", sorted(STRATEGIES))
@given(evidence=st.lists(NATS, min_size=1, max_size=40))
def test_shares_are_shares_and_memories_numbers(name, evidence):
    for verdict in _run(STRATEGIES[name], evidence):
        assert 0 <= verdict.share <= 1
        memory = verdict.state
        assert not any(map(math.isnan, (memory.slow, memory.fast)))  # -inf: the log of an average of zero
        assert max(memory.slow, memory.fast) <= 0
        assert math.isfinite(memory.spread)
        assert memory.spread >= 0
        assert 0 <= memory.updates <= len(evidence)


@pytest.mark.parametrize("name", sorted({*STRATEGIES} - {"library"}))
@given(evidence=st.floats(-40, 0), updates=st.integers(1, 200))
def test_nothing_unusual_is_no_cause_for_anything(name, evidence, updates):
    """The same evidence, one that is good enough, again and again."""
    good = max(evidence, -10.0)
    last = _run(STRATEGIES[name], [good] * updates)[-1]
    assert last.share == pytest.approx(0.05 if name == "always" else 0.0, abs=1e-9)
    assert not last.expand


@pytest.mark.parametrize("name", ["library", "threshold", "sensor", "augmented", "expansion"])
@given(evidence=st.lists(NATS, min_size=1, max_size=40))
def test_a_strategy_acts_exactly_where_what_it_compared_is_below(name, evidence):
    for nats, verdict in zip(evidence, _run(STRATEGIES[name], evidence), strict=True):
        acts, test = verdict.share > 0 or verdict.expand, verdict.test
        if test is None:  # nothing to compare with yet
            assert name in ("threshold", "augmented")
            assert not acts or nats == -math.inf
        elif abs(test.found - test.threshold) > 1e-6:
            assert acts == (test.found < test.threshold or test.threshold == -math.inf)
        if test is not None and name != "augmented":
            assert test.found == nats


def test_resets_by_hand():
    memory = RecoveryState(1.0, 2.0, 3.0, 4)
    assert (none(-math.inf, memory).share, none(-5.0, memory).state) == (0, memory)
    verdict = always_some(0.07)(-5.0, memory)
    assert (verdict.share, verdict.state, verdict.expand) == (0.07, memory, False)
    strategy = SensorResetting(evidence=-12.0, most=0.5)
    found = [strategy(nats, NO_HISTORY).share for nats in (-3.0, -12.0, -12.1, -12.5, -13.0, -math.inf)]
    expected = [0, 0, 1 - math.exp(-0.1), 1 - math.exp(-0.5), 0.5, 0.5]
    assert found == pytest.approx(expected)
    strategy = Expansion(evidence=-14.0)
    for nats, expand in ((-13.9, False), (-14.0, False), (-14.1, True), (-math.inf, True)):
        verdict = strategy(nats, NO_HISTORY)
        assert (verdict.share, verdict.expand) == (0, expand)


def test_threshold_by_hand():
    strategy = DynamicThreshold(share=0.2, deviations=2, rate=0.25, settle=2, least_sd=0.5)
    verdicts = _run(strategy, [-4.0, -6.0, -5.0, -9.0, -9.0, -5.5])
    # rates are 1, 1/2, 1/3 and then 1/4: a plain mean at first
    slow, spread = [-4.0, -5.0, -5.0], [0.0, 1.0, 2 / 3]
    for _ in range(2):  # -9, twice far below, counts as two sd below, and a tenth
        sd = math.sqrt(spread[-1])
        slow.append(slow[-1] - 0.025 * 2 * sd)
        spread.append(0.975 * (spread[-1] + 0.025 * 4 * sd**2))
    spread.append(0.75 * (spread[-1] + 0.25 * (-5.5 - slow[-1]) ** 2))
    slow.append(slow[-1] + 0.25 * (-5.5 - slow[-1]))
    assert [v.state.slow for v in verdicts] == pytest.approx(slow)
    assert [v.state.spread for v in verdicts] == pytest.approx(spread)
    assert [v.share for v in verdicts] == [0, 0, 0, 0.2, 0.2, 0]
    assert [v.state.updates for v in verdicts] == [1, 2, 3, 4, 5, 6]


@given(
    good=st.floats(-20, 0),
    drop=st.floats(1, 800),
    settle=st.integers(0, 8),
    deviations=st.floats(0.1, 4),
    rate=st.floats(0.05, 0.5),
)
def test_no_level_of_the_evidence_injects_forever(good, drop, settle, deviations, rate):
    """A few bad pictures do not lower the threshold to themselves; what lasts is the new usual."""
    strategy = DynamicThreshold(settle=settle, deviations=deviations, rate=rate)
    assert not any(v.share for v in _run(strategy, [good] * 20)), "a level is no reason, whatever it is"
    after = _run(strategy, [good] * 20 + [good - drop] * 2000)[20:]
    assert after[-1].share == 0
    if drop > 2 * deviations + 4:
        assert all(v.share for v in after[:2])


def test_the_threshold_waits_and_keeps_its_bar():
    verdicts = _run(DynamicThreshold(settle=5, share=0.1), [-5.0] * 4 + [-500.0])
    assert [v.share for v in verdicts] == [0] * 5
    verdicts = _run(DynamicThreshold(settle=5, share=0.1), [-5.0] * 5 + [-500.0])
    assert verdicts[-1].share == 0.1
    verdicts = _run(DynamicThreshold(0.1, 3.0), [-5.0] * 10 + [-30.0] * 50)
    assert all(v.share == 0.1 for v in verdicts[10:])
    verdicts = _run(DynamicThreshold(0.1, 3.0), [-5.0] * 10 + [-30.0] * 300)
    assert verdicts[-1].share == 0, "the new usual"
    # Three standard deviations of the least spread: 3 nats under the mean is nothing, 3.1 is
    for nats, share in ((-7.99, 0), (-8.01, 0.1)):
        assert _run(DynamicThreshold(0.1, 3.0), [-5.0] * 10 + [nats])[-1].share == share
    memory = RecoveryState(-5.0, 0.0, 0.1, 2)
    verdict = DynamicThreshold(0.1, 3.0)(-math.inf, memory)
    assert (verdict.share, verdict.state) == (0.1, memory)


def test_augmented_by_hand():
    """Table 8.3 of Probabilistic Robotics, its averages begun at the first likelihood."""
    strategy = Augmented(slow=0.2, fast=0.5, most=0.9, resets=0.8)
    likelihoods = [0.4, 0.2, 0.1, 0.05, 0.3]
    verdicts = _run(strategy, [math.log(w) for w in likelihoods])
    slow = fast = likelihoods[0]
    assert verdicts[0].share == 0
    for k, (w, verdict) in enumerate(zip(likelihoods[1:], verdicts[1:], strict=True), start=1):
        slow += max(0.2, 1 / (k + 1)) * (w - slow)
        fast += 0.5 * (w - fast)
        assert verdict.share == pytest.approx(max(0.0, 1 - fast / slow))
        assert math.exp(verdict.state.slow) == pytest.approx(slow)
        assert math.exp(verdict.state.fast) == pytest.approx(fast)
        assert verdict.state.updates == k + 1
    assert verdicts[3].share > 0.2 > verdicts[4].share


def test_augmented_begins_anew_and_has_bounds():
    verdicts = _run(Augmented(), [-4.0] * 20 + [-15.0, -15.0, -4.0, -4.0])
    assert [v.share for v in verdicts[:20]] == pytest.approx([0] * 20, abs=1e-12)
    assert verdicts[20].share > 0.3
    assert verdicts[20].state == NO_HISTORY
    assert verdicts[21].share == 0, "the first of new averages"
    assert verdicts[21].state.slow == pytest.approx(-15)
    assert [v.share for v in verdicts[22:]] == [0, 0], "what is better than lately is no reason"
    verdict = _run(Augmented(most=0.4, resets=0.9), [-1.0] * 10 + [-700.0] * 10)[-1]
    assert verdict.share == 0.4
    assert verdict.state.updates == 20, "not over the share that resets"
    verdicts = _run(Augmented(), [-math.inf, -math.inf, -3.0, -2000.0, -2000.0])
    # anew from the third on; in the second update of averages both have the rate 1/2
    assert [v.share for v in verdicts] == pytest.approx([0, 0.5, 0, 0, 1 - 0.25 / (0.5 * 2 / 3)])
    evidence = [-3.0, -4.0, -2.5, -6.0, -3.0, -7.0, -8.0]
    for shift in (20, 800, 1e6):
        once, other = (_run(Augmented(), [e - by for e in evidence]) for by in (0, shift))
        assert [v.share for v in once] == pytest.approx([v.share for v in other])
