"""A run branched at any step goes on as it did, to the last bit; only what is changed makes a difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.filter.branch import branched, recovery_evidence, resized
from maurice_mcl.filter.localizer import run
from maurice_mcl.scoring.batch import run_batch
from maurice_mcl.values.records import Belief

SETTINGS = {
    "thesis": dict(mcl.PRESETS["thesis"]),
    "robust": dict(mcl.PRESETS["robust"]),
    "augmented": {"recovery.strategy": "augmented"},
    "threshold, often": {"recovery.strategy": "threshold", "recovery.threshold.settle": 1},
    "seldom": {"resampling.when": "effective"},
    "adaptive": {"resampling.adaptive": True, "resampling.kld.least": 20},
}
BELIEF = Belief(
    np.random.default_rng(3).normal(size=(40, 3)).astype(np.float32),
    np.log(np.random.default_rng(4).dirichlet(np.ones(40))),
    np.zeros(2),
)


def _localizer(world, settings, **more):
    settings = {"sensor.weights": {"color": 1.0}} | settings
    return replace(mcl.make_localizer(world.library, settings=settings, particles=80), **more).of_session(
        world.drive
    )


def _branch(localizer, steps, at, size=None):
    """Return the state of a branch from the record of a step, as read back from a file: row by row."""
    belief, past = steps[at - 1][1].belief, [recovery_evidence(record) for _, record in steps[:at]]
    stored = Belief(np.ascontiguousarray(belief.poses), belief.log_weights, belief.origin)
    return branched(localizer, steps[at - 1][0].frame.step, stored, past, size)


@pytest.mark.parametrize("name", SETTINGS)
def test_a_branch_that_changes_nothing_is_the_run(world, name):
    localizer = _localizer(world, SETTINGS[name], seed=5)
    steps = list(run(localizer, world.drive, world.start))
    for at in (1, len(steps) // 2, len(steps) - 1):
        state = _branch(localizer, steps, at)
        for moment, record in steps[at:]:
            state, again = localizer.step(state, moment.frame)
            assert np.array_equal(again.weighted.poses, record.weighted.poses)
            assert np.array_equal(again.belief.log_weights, record.belief.log_weights)
            assert again.events == record.events
            assert again.recovery_test == record.recovery_test


@pytest.mark.parametrize("name", SETTINGS)
def test_batches_from_a_branch_are_the_same_as_alone(world, name):
    localizer = _localizer(world, SETTINGS[name])
    steps = list(run(localizer, world.drive, world.start))
    state, after = _branch(localizer, steps, 3), [moment for moment, _ in steps[3:]]
    for trace in run_batch(localizer, after, (1, 9), states=[state, state]):
        one, now = replace(localizer, seed=trace.seed), state
        for update, moment in enumerate(after):
            now, record = one.step(now, moment.frame)
            assert np.array_equal(trace.poses[update], record.estimate.pose)
            assert trace.events[update] == record.events


@pytest.mark.parametrize("size", [1, 13, 40, 160, 333])
def test_every_particle_is_copied_by_its_weight(size):
    found = resized(BELIEF, size, seed=1, step=7)
    assert found.size == size
    assert np.allclose(found.weights, 1 / size)
    copies = (found.poses[:, None] == BELIEF.poses[None]).all(axis=2).sum(axis=0)
    assert copies.sum() == size
    assert np.all(np.abs(copies - size * BELIEF.weights) < 1)


def test_which_particles_of_a_larger_cloud_stay_depends_on_the_seed_and_the_step():
    def kept(seeds, steps):
        return {resized(BELIEF, 13, seed, step).poses.tobytes() for seed in seeds for step in steps}

    assert len(kept([1, 1], [7, 7])) == 1
    assert len(kept(range(9), [7])) > 3 < len(kept([1], range(9)))


def test_a_larger_cloud_begins_with_the_smaller_one():
    """So its first particles have the noise that they have without the others."""
    even = replace(BELIEF, log_weights=np.full(40, -np.log(40)))
    found = resized(even, 160, seed=1, step=7)
    assert np.array_equal(found.poses[:40], even.poses)
    assert np.array_equal(found.poses[120:], even.poses)
