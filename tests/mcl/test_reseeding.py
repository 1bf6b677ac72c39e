import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.filter.recovery import Augmented, DynamicThreshold, Expansion, SensorResetting, always, none
from maurice_mcl.records import NO_HISTORY, RecoveryState

STRATEGIES = {
    "none": none,
    "always": always(0.05),
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
        assert all(map(math.isfinite, (memory.slow, memory.fast, memory.spread)))
        assert memory.spread >= 0
        assert 0 <= memory.updates <= len(evidence)


@pytest.mark.parametrize("name", sorted(STRATEGIES))
@given(evidence=st.floats(-40, 0), updates=st.integers(1, 200))
def test_nothing_unusual_is_no_cause_for_anything(name, evidence, updates):
    """The same evidence, one that is good enough, again and again."""
    good = max(evidence, -10.0)
    last = _run(STRATEGIES[name], [good] * updates)[-1]
    assert last.share == pytest.approx(0.05 if name == "always" else 0.0, abs=1e-9)
    assert not last.expand


def test_none_and_always():
    memory = RecoveryState(1.0, 2.0, 3.0, 4)
    assert (none(-math.inf, memory).share, none(-5.0, memory).state) == (0, memory)
    verdict = always(0.07)(-5.0, memory)
    assert (verdict.share, verdict.state, verdict.expand) == (0.07, memory, False)


def test_threshold_by_hand():
    strategy = DynamicThreshold(share=0.2, deviations=2, rate=0.25, settle=2, least_sd=0.5)
    verdicts = _run(strategy, [-4.0, -6.0, -5.0, -9.0, -9.0, -5.5])
    # rates are 1, 1/2, 1/3 and then 1/4: a plain mean at first
    slow = [-4.0, -5.0, -5.0, -5.0, -5.0, -5.125]
    # (1 - rate) (spread + rate off^2): 0; 1/2 of 1/2 x 4; 2/3 of 1; then -9 lies under -5 - 2 sd, twice
    spread = [0.0, 1.0, 2 / 3, 2 / 3, 2 / 3, 0.75 * (2 / 3 + 0.25 * 0.25)]
    assert [v.state.slow for v in verdicts] == pytest.approx(slow)
    assert [v.state.spread for v in verdicts] == pytest.approx(spread)
    assert [v.share for v in verdicts] == [0, 0, 0, 0.2, 0.2, 0]
    assert [v.state.updates for v in verdicts] == [1, 2, 3, 3, 3, 4]


def test_the_threshold_waits_until_it_has_settled():
    verdicts = _run(DynamicThreshold(settle=5, share=0.1), [-5.0] * 4 + [-500.0])
    assert [v.share for v in verdicts] == [0] * 5
    verdicts = _run(DynamicThreshold(settle=5, share=0.1), [-5.0] * 5 + [-500.0])
    assert verdicts[-1].share == 0.1


def test_bad_pictures_do_not_lower_the_thresholds_bar():
    verdicts = _run(DynamicThreshold(0.1, 3.0), [-5.0] * 10 + [-30.0] * 50)
    assert all(v.share == 0.1 for v in verdicts[10:])
    assert {v.state for v in verdicts[10:]} == {verdicts[9].state}


def test_chance_alone_stays_over_the_threshold():
    """Three standard deviations of the least spread: 3 nats under the mean is nothing, 3.1 is."""
    for nats, share in ((-7.99, 0), (-8.01, 0.1)):
        assert _run(DynamicThreshold(0.1, 3.0), [-5.0] * 10 + [nats])[-1].share == share


def test_when_nobody_is_in_free_space_the_threshold_is_passed():
    memory = RecoveryState(-5.0, 0.0, 0.1, 2)
    verdict = DynamicThreshold(0.1, 3.0)(-math.inf, memory)
    assert (verdict.share, verdict.state) == (0.1, memory)


def test_sensor_resetting_by_hand():
    strategy = SensorResetting(evidence=-12.0, most=0.5)
    found = [strategy(nats, NO_HISTORY).share for nats in (-3.0, -12.0, -12.1, -12.5, -13.0, -math.inf)]
    expected = [0, 0, 1 - math.exp(-0.1), 1 - math.exp(-0.5), 0.5, 0.5]
    assert found == pytest.approx(expected)


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
        assert verdict.state.slow == pytest.approx(slow)
        assert verdict.state.fast == pytest.approx(fast)
        assert verdict.state.updates == k + 1
    assert verdicts[3].share > 0.2 > verdicts[4].share


def test_augmented_begins_anew_after_a_reset():
    verdicts = _run(Augmented(), [-4.0] * 20 + [-15.0, -15.0, -4.0, -4.0])
    assert [v.share for v in verdicts[:20]] == pytest.approx([0] * 20, abs=1e-12)
    assert verdicts[20].share > 0.3
    assert verdicts[20].state == NO_HISTORY
    assert verdicts[21].share == 0, "the first of new averages"
    assert verdicts[21].state.slow == pytest.approx(math.exp(-15))
    assert [v.share for v in verdicts[22:]] == [0, 0], "what is better than lately is no reason"


def test_augmented_never_draws_more_than_its_most():
    verdict = _run(Augmented(most=0.4, resets=0.9), [-1.0] * 10 + [-700.0] * 10)[-1]
    assert verdict.share == 0.4
    assert verdict.state.updates == 20, "not over the share that resets"


def test_augmented_with_likelihoods_that_vanish():
    verdicts = _run(Augmented(), [-math.inf, -math.inf, -3.0, -2000.0, -2000.0])
    # anew from the third on; in the second update of averages both have the rate 1/2
    assert [v.share for v in verdicts] == pytest.approx([0, 0.5, 0, 0, 1 - 0.25 / (0.5 * 2 / 3)])


def test_augmented_does_not_care_about_the_unit_of_likelihood():
    evidence = [-3.0, -4.0, -2.5, -6.0, -3.0, -7.0, -8.0]
    once, other = (_run(Augmented(), [e - shift for e in evidence]) for shift in (0, 20))
    assert [v.share for v in once] == pytest.approx([v.share for v in other])


def test_expansion_spreads_and_draws_nothing():
    strategy = Expansion(evidence=-14.0)
    for nats, expand in ((-13.9, False), (-14.0, False), (-14.1, True), (-math.inf, True)):
        verdict = strategy(nats, NO_HISTORY)
        assert (verdict.share, verdict.expand) == (0, expand)
