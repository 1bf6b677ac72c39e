from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import DISTANCES
from maurice_mcl.sensor.model import BLENDS, LIKELIHOODS, SensorModel, SensorParameters, relative_quality
from maurice_mcl.sensor.references import InterpolationParameters, interpolated_reference, nearest_reference
from maurice_mcl.values.records import Comparison

BY = {"color": "thesis", "edges": "thesis"}
THESIS = SensorParameters({"color": 1.0}, sharpness=2.0, likelihood="power", blend="sum", distances=BY)


def _model(world, parameters=THESIS, **changes):
    reference = nearest_reference(world.library.poses, world.library.arena)
    return SensorModel(world.library, reference, replace(parameters, **changes))


def _poses(world, n=200):
    rng = np.random.default_rng(5)
    xy = rng.uniform(-2.2, 2.2, (n, 2))
    return np.column_stack([xy, rng.uniform(-3, 3, n)]).astype(np.float32)


def _compare(model, world, step=0):
    return model.compare(model.measure(world.drive.all_moments[step].frame.image))


@pytest.mark.parametrize("blend", sorted(BLENDS))
@pytest.mark.parametrize("likelihood", sorted(LIKELIHOODS))
def test_a_comparison_is_made_of_the_parts(world, blend, likelihood):
    chosen = {"color": "l1", "tiny": "l2"}
    weights, scales = np.array([0.7, 0.3, 0.2]), np.array([0.2, 3.0, 2.0])
    parameters = SensorParameters(
        dict(zip(("edges", "color", "tiny"), weights.tolist(), strict=True)),
        2.5,
        likelihood,
        blend,
        chosen,
        dict(zip(("edges", "color", "tiny"), scales.tolist(), strict=True)),
    )
    model = _model(world, parameters)
    found = _compare(model, world)
    assert found.channels == ("edges", "color", "tiny")
    descriptors = model.measure(world.drive.all_moments[0].frame.image)
    named = zip(found.channels, (CHANNELS["edges"].distance, "l1", "l2"), strict=True)
    rows = np.stack([DISTANCES[by](descriptors[name], world.library.index[name]) for name, by in named])
    assert np.array_equal(found.distances, rows)
    assert np.array_equal(found.channel_quality, relative_quality(rows))
    blended = BLENDS[blend](rows, weights, scales)
    assert np.array_equal(found.quality, blended.quality)
    assert np.array_equal(found.log_likelihood, LIKELIHOODS[likelihood](blended, 2.5))
    assert found.channel_cost == pytest.approx(rows / scales[:, None], rel=1e-5)
    assert found.cost == pytest.approx(weights @ (rows / scales[:, None]), rel=1e-5)


def test_a_sighting_is_the_selections_word_on_the_comparison(world):
    poses, nearest = _poses(world), nearest_reference(world.library.poses, world.library.arena)
    between = interpolated_reference(
        nearest, world.library.poses, world.library.arena, InterpolationParameters()
    )
    for selection in (nearest, between):
        model = replace(_model(world), references=selection)
        comparison = _compare(model, world)
        sighting = model.at(comparison, poses)
        assert sighting.comparison is comparison
        origin = world.library.origin
        assert np.array_equal(sighting.entries, nearest.entries(poses, origin))
        assert np.array_equal(sighting.log_likelihood, selection.at(comparison.log_likelihood, poses, origin))
        outside = sighting.entries < 0
        assert 0 < outside.sum() < len(poses)
        assert np.all(sighting.log_likelihood[outside] == -np.inf)
        assert np.isfinite(sighting.log_likelihood[~outside]).all()


@pytest.mark.parametrize("name", sorted(CHANNELS))
@pytest.mark.parametrize("blend", ["sum", "calibrated"])
def test_one_channel_alone_is_its_own_quality(world, name, blend):
    found = _compare(_model(world, weights={name: 1.0}, blend=blend), world, 1)
    assert found.quality == pytest.approx(found.channel_quality[0], abs=1e-6)
    assert np.array_equal(found.cost, found.channel_cost[0])


@pytest.mark.parametrize("blend", sorted(BLENDS))
def test_weights_matter_a_channel(world, blend):
    scales = {"color": 0.1, "edges": 0.1}
    found = [
        _compare(
            _model(world, weights={"color": w, "edges": 1 - w}, blend=blend, scales=scales), world
        ).quality
        for w in (0.0, 0.5, 1.0)
    ]
    assert not np.allclose(found[1], found[2], atol=1e-3)
    alone = _compare(_model(world, weights={"edges": 1.0}, blend=blend, scales=scales), world)
    assert found[0] == pytest.approx(alone.quality, abs=1e-6)


def test_distances_and_scales_are_chosen_by_channel():
    parameters = SensorParameters({"tiny": 1.0, "color": 1.0}, distances={"color": "chi2"})
    assert parameters.distance_of("tiny") == CHANNELS["tiny"].distance
    assert parameters.distance_of("color") == "chi2"
    parameters = SensorParameters({"color": 1.0}, distances={"color": "l2"}, scales={"color": 0.25})
    assert parameters.scale_of("color") == 0.25
    assert replace(parameters, scales={}).scale_of("color") > 0


def test_costs_are_the_same_whatever_the_likelihood(world):
    """So that runs can be compared by their evidence."""
    found = [
        _compare(_model(world, likelihood=name, sharpness=sharpness, scales={"color": 0.1}), world)
        for name, sharpness in (("power", 1.0), ("exponential", 1.0), ("exponential", 5.0))
    ]
    assert np.array_equal(found[0].cost, found[1].cost)
    assert np.array_equal(found[1].cost, found[2].cost)
    assert not np.array_equal(found[1].log_likelihood, found[2].log_likelihood)
    weights, scales = {"color": 0.6, "hog": 1.4}, {"color": 0.2, "hog": 3.0}
    parameters = SensorParameters(weights, scales=scales)
    found = _compare(_model(world, parameters), world)
    assert found.log_likelihood == pytest.approx(-found.cost, rel=1e-5)


def test_the_best_few_are_the_beginning_of_the_ranking():
    rng = np.random.default_rng(5)
    for size in (1, 4, 5, 6, 300):
        quality = np.round(rng.random(size), 3).astype(np.float32)
        nothing = np.zeros((0, size), np.float32)
        found = Comparison((), {}, nothing, nothing, quality, nothing, quality, quality)
        best = found.best(5)
        assert len(best) == min(5, size)
        assert len(set(best.tolist())) == len(best)
        ranking = found.ranking()
        assert np.all(np.diff(quality[ranking]) <= 0)
        assert sorted(ranking.tolist()) == list(range(size))
        np.testing.assert_array_equal(quality[best], quality[ranking[:5]])


FUSED = SensorParameters({"color": 1.0, "edges": 1.0})


@pytest.mark.parametrize("sharpness", [0.1, 2.0])
def test_an_outlier_cost_bounds_what_a_picture_that_shows_nothing_known_can_say(world, sharpness):
    """Without it such a picture prefers some pose by many nats; poses that fit well keep their nats."""
    chosen = replace(FUSED, sharpness=sharpness)
    free, bound = (_compare(_model(world, chosen, outlier_cost=cost), world) for cost in (0.0, 6.0))
    np.testing.assert_allclose(bound.log_likelihood, np.logaddexp(free.log_likelihood, -6.0), rtol=1e-5)
    np.testing.assert_array_equal(bound.cost, free.cost)  # which diagnosis and recovery read
    if sharpness < 1:
        assert bound.log_likelihood.argmax() == free.log_likelihood.argmax()
    else:  # nothing is known of what it shows
        assert np.ptp(free.log_likelihood) > 6
        assert np.ptp(bound.log_likelihood) < 1e-3
