"""The recovery step: when it resamples, reseeds and moves copies, and what it draws."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import maurice_mcl as mcl
import maurice_mcl.filter.localizer as localizer_module
from maurice_mcl.filter.localizer import Localizer, run
from maurice_mcl.filter.motion import OdometryMotion
from maurice_mcl.filter.proposal import MixtureParameters, MixtureProposal, regions
from maurice_mcl.filter.recovery import (
    Recovery,
    RecoveryStep,
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
from maurice_mcl.values.records import LIBRARY, NO_HISTORY, Belief, Comparison, RecoveryState, normalize

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
    found = localizer.proposal.propose(localizer.predict(_belief(), still), _comparison(), ())
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
    prediction = localizer.predict(belief, SimpleNamespace(step=2, motions=np.zeros((0, 3))))
    MixtureProposal(MixtureParameters(), NEAREST, WHERE).propose(prediction, comparison, ())
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


def test_to_the_letter_fresh_particles_come_where_even_draws_would_match_better(world):
    """Match quality against match quality: neither calibrated evidence nor earlier pictures have a say."""
    settings = {key: value for key, value in mcl.PRESETS["thesis-exact"].items() if key != "motion"}
    localizer = mcl.make_localizer(world.library, particles=300, settings=settings)
    acted = []
    for _, record in run(localizer, world.drive, None):
        quality, entries = record.sighting.comparison.quality, record.sighting.entries
        inside, test = entries >= 0, record.recovery_test
        cloud = quality[entries[inside]].astype(float).sum() / len(entries)
        assert test.compared == LIBRARY
        assert test.found == pytest.approx(np.log(cloud / quality.astype(float).mean()), abs=1e-3)
        acted.append(record.injected is not None)
        assert acted[-1] == (test.found < test.threshold == 0)
    assert 0 < np.mean(acted) < 1
