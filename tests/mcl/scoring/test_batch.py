"""A batch of runs finds what every run finds alone, to the last bit."""

from __future__ import annotations

from dataclasses import astuple, fields, replace
from functools import cache

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.filter.estimate import CIRCLE_M, share_within
from maurice_mcl.filter.localizer import LEFT_MAP, Localizer, run
from maurice_mcl.scoring.batch import compared_once, run_batch
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.values.library import Radii

SETTINGS = {
    "as it comes": {},
    "thesis": dict(mcl.PRESETS["thesis"]),
    "refined": dict(mcl.PRESETS["refined"]),
    "robust": dict(mcl.PRESETS["robust"]),
    **{name: {"resampling.scheme": name} for name in ("multinomial", "stratified", "residual")},
    **{name: {"recovery.strategy": name} for name in ("always", "threshold", "sensor")},
    **{name: {"recovery.strategy": name} for name in ("augmented", "expansion", "mixture")},
    "augmented, evenly": {"recovery.strategy": "augmented", "recovery.draw": "evenly"},
    "threshold, often": {"recovery.strategy": "threshold", "recovery.threshold.settle": 1},
    "sensor, often": {"recovery.strategy": "sensor", "recovery.sensor.evidence": -2.0},
    "expansion, often": {"recovery.strategy": "expansion", "recovery.expansion.evidence": -2.0},
    "thesis, below the library": {**mcl.PRESETS["thesis"], "recovery.strategy": "library"},
    "below the library": {"recovery.strategy": "library", "recovery.draw": "evenly"},
    "seldom": {"resampling.when": "effective"},
    "every third": {"resampling.when": "every", "resampling.every": 3},
    "every third, some": {"resampling.when": "every", "resampling.every": 3, "recovery.strategy": "always"},
    "roughened": {"resampling.roughening": 0.2},
    "adaptive": {"resampling.adaptive": True, "resampling.kld.least": 20},
    "outliers": {"motion_outliers.share": 0.1},
    "surveyed references only": {"references.interpolation.virtual": False},
    "nearest": {"references.method": "nearest"},
    "blind": {"sensor.sharpness": 0.0},
}


@pytest.fixture(scope="module")
def localizer_of(world):
    @cache
    def made(name):
        settings = {"sensor.weights": {"color": 1.0}} | SETTINGS[name]
        return mcl.make_localizer(world.library, settings=settings).of_session(world.drive)

    return lambda name, particles: replace(made(name), particles=particles)


def _alone(localizer, world, seed, start):
    return list(run(replace(localizer, seed=seed), world.drive, start))


def _same(trace, steps):
    for update, (_, record) in enumerate(steps):
        scored, parents = record.estimate, record.parents
        assert trace.events[update] == record.events
        for name in ("sd_m", "heading_sd_rad", "mass", "confidence", "converged"):
            assert np.array_equal(getattr(trace, name)[update], getattr(scored, name)), name
        assert np.array_equal(trace.poses[update], scored.pose)
        assert np.array_equal(trace.mean_poses[update], record.mean_estimate.pose)
        assert np.array_equal(trace.mean_sd_m[update], record.mean_estimate.sd_m)
        for name in ("effective_sample_size", "log_evidence", "calibrated_evidence"):
            assert np.array_equal(getattr(trace, name)[update], getattr(record, name)), name
        assert trace.circle[update] == share_within(record.weighted, scored.pose, CIRCLE_M)
        assert trace.particles[update] == record.belief.size
        own = record.belief.size if parents is None else len(set(parents.tolist()) - {-1})
        assert trace.parents[update] == own
        assert trace.fresh[update] == (0 if record.injected is None else record.injected.sum())


SIZES = [(name, 60, (0, 7, 4_000_000_000)) for name in SETTINGS]
SIZES += [(name, *size) for name in ("as it comes", "refined") for size in ((1, (5,)), (257, range(6)))]


@pytest.mark.parametrize(("name", "particles", "seeds"), SIZES)
def test_every_run_is_the_same_as_alone(world, localizer_of, name, particles, seeds):
    localizer = localizer_of(name, particles)
    moments = world.drive.all_moments
    starts = [world.start if k % 2 else None for k in range(len(seeds))]
    traces = run_batch(localizer, moments, seeds, starts)
    assert [trace.seed for trace in traces] == list(seeds)
    for trace, seed, start in zip(traces, seeds, starts, strict=True):
        assert trace.updates == len(moments)
        _same(trace, _alone(localizer, world, seed, start))


USUAL = ("as it comes", "thesis", "refined", "outliers", "seldom", "every third", "nearest", "blind")


@pytest.mark.parametrize("name", USUAL)
def test_what_nearly_always_happens_is_done_for_all_runs_at_once(world, localizer_of, name, monkeypatch):
    monkeypatch.setattr(Localizer, "step", None)
    traces = run_batch(localizer_of(name, 300), world.drive.all_moments, range(40), world.start)
    assert len(traces) == 40


def test_a_cloud_beyond_a_hundred_radii_takes_its_step_alone(world, localizer_of):
    localizer = localizer_of("as it comes", 80)
    localizer = replace(localizer, radii=Radii(*(radius / 100 for radius in astuple(localizer.radii))))
    traces = run_batch(localizer, world.drive.all_moments, range(3))
    assert [trace.seed for trace in traces] == [0, 1, 2]
    for trace in traces:
        _same(trace, _alone(localizer, world, trace.seed, None))


def test_runs_that_leave_the_map_take_their_step_alone(world, localizer_of):
    localizer, far = localizer_of("as it comes", 40), np.array([3.95, 2.95, 0.8])
    starts = [far, world.start, far, far]
    traces = run_batch(localizer, world.drive.all_moments, range(4), starts)
    assert any(LEFT_MAP in events for trace in traces for events in trace.events)
    for trace, start in zip(traces, starts, strict=True):
        _same(trace, _alone(localizer, world, trace.seed, start))


def test_comparisons_may_be_given(world, localizer_of):
    localizer = localizer_of("as it comes", 50)
    moments = world.drive.all_moments
    given = compared_once(localizer.sensor, moments)
    with_them = run_batch(localizer, moments, (1, 2), comparisons=given)
    without = run_batch(localizer, moments, (1, 2))
    for a, b in zip(with_them, without, strict=True):
        for field in fields(a):
            np.testing.assert_equal(getattr(a, field.name), getattr(b, field.name))


def test_a_batch_of_no_runs_is_empty(world, localizer_of):
    assert run_batch(localizer_of("as it comes", 50), world.drive.all_moments, ()) == ()


def test_a_trace_is_scored_as_its_records(world, localizer_of):
    localizer = localizer_of("as it comes", 200)
    moments, arena = world.drive.all_moments, world.library.arena
    for trace in run_batch(localizer, moments, (1, 2, 3), world.start):
        steps = _alone(localizer, world, trace.seed, world.start)
        assert score_table(trace, arena.size_m) == mcl.score(steps, arena)
        assert score_table(trace) == mcl.score(steps)


def test_a_trace_is_scored_as_its_records_where_the_truth_is_not_always_known(world, localizer_of):
    localizer, arena = localizer_of("as it comes", 200), world.library.arena
    moments = world.drive.all_moments
    for hidden in (range(len(moments)), (0, 1, 4), (2, 3), (len(moments) - 1,)):
        known = [replace(one, truth=None) if k in hidden else one for k, one in enumerate(moments)]
        late = [replace(one, frame=replace(one.frame, time_s=100.0 * k)) for k, one in enumerate(known)]
        for drive in (known, late):
            (trace,) = run_batch(localizer, drive, (1,))
            records = [record for _, record in _alone(localizer, world, 1, None)]
            steps = [
                (one, replace(record, frame=one.frame)) for one, record in zip(drive, records, strict=True)
            ]
            assert score_table(trace, arena.size_m) == mcl.score(steps, arena)
