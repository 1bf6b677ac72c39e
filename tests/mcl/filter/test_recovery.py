from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import maurice_mcl.filter.localizer as localizer_module
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.motion import OdometryMotion
from maurice_mcl.filter.proposal import MixtureParameters, regions
from maurice_mcl.filter.recovery import (
    Augmented,
    DynamicThreshold,
    Expansion,
    Recovery,
    RecoveryStep,
    SensorResetting,
    none,
)
from maurice_mcl.filter.recovery import always as always_some
from maurice_mcl.filter.resampling import (
    RESAMPLERS,
    KldParameters,
    Resampling,
    adapted_size,
    always,
    every,
)
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.map import Arena
from maurice_mcl.values.randomness import Domain, Purpose, stream
from maurice_mcl.values.records import NO_HISTORY, Belief, Comparison, RecoveryState, normalize

MIDDLE = np.array([2.0, 1.5])
EACH = pytest.mark.parametrize("resampler", sorted(RESAMPLERS))


def _library():
    places = [(0.5, 0.5), (1.5, 0.5), (2.5, 1.5), (3.5, 2.5)]
    return np.array([[x, y, k * np.pi / 2 - 3] for x, y in places for k in range(4)])


NEAREST = nearest_reference(_library(), Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4))))
WHERE = regions(NEAREST, 16)


def never(belief, step):
    """Do not resample."""
    return False


def _choosing(scheme="systematic", when=never, roughening=0.0, kld=None, strategy=none, draw_evenly=False):
    """A localizer of which only the last two stages are used."""
    resampling = Resampling(RESAMPLERS[scheme], when, roughening, kld)
    recovery = RecoveryStep(strategy, NEAREST, WHERE, draw_evenly)
    sensor = SimpleNamespace(sensors={})
    return Localizer(None, NEAREST, WHERE, None, sensor, resampling, recovery)


def _comparison(seed=0, spread=1.0):
    logs = np.random.default_rng(seed).normal(-20, spread, 16).astype(np.float32)
    row = np.zeros((1, 16), np.float32)
    return Comparison(("color",), {}, row, row, row[0], row, -logs, logs)


def _belief(n=500, seed=1):
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-2, 2, n), rng.uniform(-1.5, 1.5, n), rng.uniform(-3, 3, n)])
    logs = rng.normal(0, 1, n)
    logs[::7] = -np.inf
    return Belief(poses.astype(np.float32), normalize(logs)[0], MIDDLE)


def _next(localizer, belief=None, comparison=None, state=None):
    """Resample and recover; return the recovery that was decided, and the result."""
    recovery = localizer.recovery.strategy(-5.0, state or RecoveryState(1.0, 2.0, 3.0, 4))
    resampled = localizer.resample(_belief() if belief is None else belief, recovery, 2)
    likely = _comparison() if comparison is None else comparison
    return recovery, localizer.recover(resampled, recovery, likely, 2)


def _asking(share, expand=False):
    return lambda evidence, memory: Recovery(share, memory, expand)


def test_nothing_asked_for_is_nothing_done():
    belief = _belief()
    recovery, found = _next(_choosing(), belief)
    assert found.belief is belief
    assert found.parents is None
    assert found.injected is None
    assert not recovery.expand
    assert recovery.state == RecoveryState(1.0, 2.0, 3.0, 4)
    assert _next(_choosing(roughening=0.2), belief)[1].belief is belief
    still = SimpleNamespace(step=2, motions=np.zeros((0, 3)))
    localizer = replace(_choosing(), motion=OdometryMotion())
    found = localizer.propose(_belief(), still, _comparison())
    assert np.array_equal(found.belief.poses, _belief().poses)
    assert found.correction is None


@EACH
@pytest.mark.parametrize("share", [0.0, 0.001, 0.13, 0.5, 1.0])
@pytest.mark.parametrize("evenly", [True, False])
def test_sizes_parents_weights_and_flags(resampler, share, evenly):
    belief = _belief()
    localizer = _choosing(scheme=resampler, when=always, strategy=_asking(share), draw_evenly=evenly)
    _, found = _next(localizer, belief)
    fresh = round(share * 500)
    assert (found.belief.size, found.belief.poses.dtype) == (500, np.float32)
    assert found.belief.weights == pytest.approx(np.full(500, 1 / 500))
    assert found.belief.origin is belief.origin
    assert (found.parents.shape, found.parents.dtype) == ((500,), np.int32)
    assert (found.parents == -1).sum() == fresh
    copied = found.parents >= 0
    assert np.array_equal(found.belief.poses[copied], belief.poses[found.parents[copied]])
    assert np.all(np.isfinite(belief.log_weights[found.parents[copied]])), "no dead parent"
    if fresh:
        assert np.array_equal(found.injected, found.parents == -1)
        entries = NEAREST.entries(found.belief.poses[found.injected], MIDDLE)
        assert (entries >= 0).mean() > 0.99
    else:
        assert found.injected is None


def test_reseeding_and_expansion_are_told():
    _, found = _next(_choosing(strategy=always_some(0.1)))
    assert (found.parents == -1).sum() == 50
    assert found.belief.weights == pytest.approx(np.full(500, 1 / 500))
    recovery, found = _next(_choosing(strategy=_asking(0.2, True)))
    assert recovery.expand
    assert found.injected.sum() == 100
    _, found = _next(_choosing(strategy=_asking(1.0, True), roughening=0.2))
    assert found.injected.all()


def test_where_fresh_particles_are_drawn():
    """Where the picture says, or evenly: with one sure entry that is a great difference."""
    logs = np.full(16, -100, np.float32)
    logs[5] = 0
    sure = replace(_comparison(), log_likelihood=logs)
    share = {}
    for evenly in (True, False):
        localizer = _choosing(strategy=_asking(1.0), draw_evenly=evenly)
        _, found = _next(localizer, comparison=sure)
        share[evenly] = (NEAREST.entries(found.belief.poses, MIDDLE) == 5).mean()
    expected = WHERE.sizes()[5] / WHERE.sizes().sum()
    assert share[False] > 0.99
    assert share[True] == pytest.approx(expected, abs=4 * np.sqrt(expected / 500))


def test_nothing_is_changed_in_place():
    belief, comparison = _belief(), _comparison()
    kept = belief.poses.copy(), belief.log_weights.copy(), comparison.log_likelihood.copy()
    localizer = _choosing(when=always, strategy=_asking(0.2, True), roughening=0.2, kld=KldParameters())
    _next(localizer, belief, comparison)
    mixed = replace(localizer, mixture=MixtureParameters(), motion=OdometryMotion())
    mixed.propose(belief, SimpleNamespace(step=2, motions=np.zeros((0, 3))), comparison)
    assert np.array_equal(belief.poses, kept[0])
    assert np.array_equal(belief.log_weights, kept[1])
    assert np.array_equal(comparison.log_likelihood, kept[2])


def test_the_strategy_keeps_the_memory_and_hears_the_evidence():
    told = RecoveryState(7.0, 8.0, 9.0, 10)
    assert _next(_choosing(strategy=lambda e, m: Recovery(0.0, told)))[0].state == told
    assert _next(_choosing(strategy=lambda e, m: Recovery(0.1, told)))[0].state == told
    heard = []

    def listening(evidence, memory):
        heard.append((evidence, memory))
        return Recovery(0.0, memory)

    _next(_choosing(strategy=listening), state=RecoveryState(updates=3))
    assert heard == [(-5.0, RecoveryState(updates=3))]


def test_copies_move_and_fresh_ones_stay():
    belief = Belief(np.zeros((20_000, 3), np.float32), normalize(np.zeros(20_000))[0], MIDDLE)
    recovery, found = _next(_choosing(strategy=_asking(0.0, True)), belief)
    assert recovery.expand
    assert found.injected is None
    assert found.parents is not None
    reach = (1 + np.sqrt(2)) / 2  # of the places, the median distance to the nearest other
    sd = np.array([reach, reach, np.pi / 8])
    assert found.belief.poses.std(axis=0) == pytest.approx(sd, rel=4 / np.sqrt(40_000) + 0.005)
    plain = _next(_choosing(when=always, strategy=_asking(0.2)))[1]
    rough = _next(_choosing(when=always, strategy=_asking(0.2), roughening=0.2))[1]
    assert np.array_equal(plain.parents, rough.parents)
    moved = (plain.belief.poses != rough.belief.poses).any(axis=1)
    assert moved[:400].all()
    assert not moved[400:].any()


def test_roughening_and_expansion_draw_numbers_of_their_own():
    """The same normals twice would spread by the sum instead of the root of the sum of squares."""
    n = 20_000
    poses = np.zeros((n, 3), np.float32)
    poses[0], poses[1] = [-1, -1, -0.2], [1, 1, 0.2]
    belief = Belief(poses, normalize(np.zeros(n))[0], MIDDLE)
    share = 20.0  # so that roughening's sd of 2 share N^(-1/3) is like the expansion's
    rough = 2 * share * n ** (-1 / 3)
    localizer = _choosing(strategy=_asking(0.0, True), roughening=share)
    sd = _next(localizer, belief)[1].belief.poses[:, 0].std()
    assert sd == pytest.approx(np.hypot(rough, (1 + np.sqrt(2)) / 2), rel=0.03)


@EACH
@pytest.mark.parametrize("spread", [0.05, 2.0])
def test_adaptive_size(resampler, spread):
    belief = _belief(1000)
    belief = Belief((belief.poses * np.float32(spread)).clip(-3, 3), belief.log_weights, MIDDLE)
    kld = KldParameters(least=120, most=1500)
    localizer = _choosing(scheme=resampler, kld=kld, strategy=_asking(0.1))
    _, found = _next(localizer, belief)
    size = adapted_size(belief, kld, stream(Domain.FILTER, localizer.seed, 2, Purpose.SIZE))
    assert size != 1000
    assert found.belief.size == len(found.parents) == len(found.injected) == size
    assert found.injected.sum() == round(0.1 * size)
    assert found.belief.weights == pytest.approx(np.full(size, 1 / size))


def test_the_size_changes_only_where_the_policy_resamples():
    localizer = _choosing(when=every(2), kld=KldParameters(least=120, most=1500))
    belief = _belief(1000)
    kept, resized = (localizer.resample(belief, none(-5.0, NO_HISTORY), step) for step in (3, 4))
    assert kept.belief is belief
    assert resized.belief.size != 1000


def test_purposes_have_streams_of_their_own(monkeypatch):
    asked = []

    def noted(domain, seed, step, purpose, child):
        asked.append(purpose)
        return stream(domain, seed, step, purpose, child)

    monkeypatch.setattr(localizer_module, "stream", noted)
    _next(_choosing(when=always, strategy=_asking(0.1), roughening=0.2))
    assert asked == [Purpose.RESAMPLE, Purpose.ROUGHEN, Purpose.INJECT]


STRATEGIES = {
    "none": none,
    "always": always_some(0.05),
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


@pytest.mark.parametrize("name", sorted(STRATEGIES))
@given(evidence=st.floats(-40, 0), updates=st.integers(1, 200))
def test_nothing_unusual_is_no_cause_for_anything(name, evidence, updates):
    """The same evidence, one that is good enough, again and again."""
    good = max(evidence, -10.0)
    last = _run(STRATEGIES[name], [good] * updates)[-1]
    assert last.share == pytest.approx(0.05 if name == "always" else 0.0, abs=1e-9)
    assert not last.expand


@pytest.mark.parametrize("name", ["threshold", "sensor", "augmented", "expansion"])
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
