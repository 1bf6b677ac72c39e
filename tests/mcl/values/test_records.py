from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import maurice_mcl as mcl
from maurice_mcl.config.parameters import PRESETS
from maurice_mcl.values.records import (
    Belief,
    Comparison,
    effective_sample_size,
    normalize,
    uniform_log_weights,
)

LOGS = arrays(np.float64, st.integers(1, 50), elements=st.floats(-2000, 500))


@given(LOGS)
def test_normalized_weights_sum_to_one_and_keep_their_ratios(logs):
    normalized, total = normalize(logs)
    assert np.exp(normalized).sum() == pytest.approx(1)
    assert normalized + total == pytest.approx(logs)


@given(LOGS)
def test_effective_sample_size_lies_between_one_and_n(logs):
    size = effective_sample_size(normalize(logs)[0])
    assert 1 - 1e-9 <= size <= len(logs) * (1 + 1e-9)


def test_effective_sample_size_and_normalize_by_hand():
    assert effective_sample_size(uniform_log_weights(37)) == pytest.approx(37)
    with np.errstate(divide="ignore"):
        assert effective_sample_size(np.log(np.array([1.0, 0.0, 0.0]))) == pytest.approx(1)
    assert effective_sample_size(np.log(np.array([0.5, 0.25, 0.25]))) == pytest.approx(1 / 0.375)
    normalized, total = normalize(np.array([-5000.0, -5000.0 - np.log(3)]))
    assert np.exp(normalized) == pytest.approx([0.75, 0.25])
    assert total == pytest.approx(-5000 + np.log(4 / 3))
    normalized, total = normalize(np.array([-np.inf, 0.0, 0.0]))
    assert np.exp(normalized) == pytest.approx([0, 0.5, 0.5])
    assert total == pytest.approx(np.log(2))
    logs = np.full(3, -np.inf)
    normalized, total = normalize(logs)
    assert total == -np.inf
    assert np.array_equal(normalized, logs)


def test_world_poses_are_exact_far_from_the_origin():
    origin = np.array([500_000.25, -4_000_000.5])
    poses = np.array([[0.001, 0.002, 1.0], [-1.5, 2.5, -3.0]], np.float32)
    belief = Belief(poses, uniform_log_weights(2), origin)
    assert belief.world_poses[:, :2] - origin == pytest.approx(poses[:, :2], abs=1e-8)
    assert belief.world_poses[:, 2] == pytest.approx(poses[:, 2])
    assert belief.poses is poses
    assert belief.size == 2
    assert belief.weights == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("preset", sorted(set(PRESETS) - {"precise", "laser", "amcl"}))  # others need more
def test_a_record_needs_no_collector_to_be_freed(preset):
    """Commands let Python's collector wait: whatever refers to itself would pile up, 100 kB a step."""
    localizer = mcl.make_localizer(mcl.tiny_library(), preset=preset, particles=50)
    gc.collect()
    gc.disable()
    try:
        for _, record in mcl.run(localizer, mcl.tiny_session()):
            comparison = record.sighting.comparison
            for name in dir(Comparison):  # everything that is computed once and kept
                if not name.startswith("_"):
                    getattr(comparison, name)
            comparison.prepare()
            kept = [weakref.ref(comparison), weakref.ref(record.predicted), weakref.ref(record.belief)]
            frame = weakref.ref(record.sighting.comparison.quality)
        del localizer, record, comparison
        assert [one() for one in (*kept, frame)] == [None] * 4
        assert gc.collect() == 0
    finally:
        gc.enable()
