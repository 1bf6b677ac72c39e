import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.library import ChannelIndex
from maurice_mcl.records import Sighting
from maurice_mcl.selection import nearest_reference
from maurice_mcl.sensor import (
    FEATURES,
    SensorModel,
    SensorParameters,
    blend,
    contributions,
    distance,
    log_likelihood,
    particle_log_likelihood,
    quality,
)


def _index(seed=0, entries=20, bins=84, floor=0.7):
    rng = np.random.default_rng(seed)
    references = rng.gamma(0.6, 6.0, (entries, bins)).astype(np.float32)
    noise = (rng.random(bins) * 2 * floor).astype(np.float32)
    return ChannelIndex(references, noise, references.max(axis=0))


def _sample(seed=1, bins=84):
    return np.random.default_rng(seed).gamma(0.6, 6.0, bins).astype(np.float32)


def _naive(sample, index):
    """The thesis's formula as it is printed, over the number of bins."""
    sums = []
    for reference in index.references.tolist():
        total = 0.0
        for s, r, n, m in zip(
            sample.tolist(), reference, index.noise_floor.tolist(), index.relevance.tolist(), strict=True
        ):
            total += max(abs(s - r) - n, 0) / m if m > 0 else 0.0
        sums.append(total / len(sample))
    return sums


def test_distance_is_the_thesiss_formula():
    assert distance(_sample(), _index()) == pytest.approx(_naive(_sample(), _index()), rel=1e-5)


def test_bins_without_relevance_count_nothing():
    index = _index()
    references, relevance = index.references.copy(), index.relevance.copy()
    references[:, 10:50] = relevance[10:50] = 0
    index = ChannelIndex(references, index.noise_floor, relevance)
    found = distance(_sample(), index)
    assert np.isfinite(found).all()
    assert found == pytest.approx(_naive(_sample(), index), rel=1e-5)
    assert contributions(_sample(), references[0], index)[10:50].max() == 0


def test_differences_under_the_noise_floor_are_no_differences():
    index = _index()
    quiet = ChannelIndex(index.references, np.full(84, 3.0, np.float32), index.relevance)
    assert distance(index.references[4] + np.float32(2.9), quiet)[4] == 0
    assert distance(index.references[4] + np.float32(3.5), quiet)[4] > 0


def test_an_entry_is_at_no_distance_from_itself():
    index = _index()
    assert [distance(row, index).argmin() for row in index.references] == list(range(20))
    assert [distance(row, index).min() for row in index.references] == [0] * 20


def test_contributions_sum_to_the_distance():
    index = _index()
    parts = [contributions(_sample(), reference, index) for reference in index.references]
    assert np.sum(parts, axis=1) == pytest.approx(distance(_sample(), index), rel=1e-5)
    assert np.min(parts) >= 0


def test_distance_leaves_its_arguments_alone():
    index, sample = _index(), _sample()
    kept = index.references.copy(), index.noise_floor.copy(), index.relevance.copy(), sample.copy()
    distance(sample, index)
    contributions(sample, index.references[0], index)
    now = index.references, index.noise_floor, index.relevance, sample
    assert all(np.array_equal(a, b) for a, b in zip(kept, now, strict=True))


@given(st.lists(st.floats(0, 1, width=32), min_size=1, max_size=40))
def test_quality_lies_between_zero_and_one_and_falls_with_distance(raw):
    distances = np.array(raw, np.float32)
    found = quality(distances)
    assert np.all((found >= 0) & (found <= 1))
    assert np.all(np.diff(found[distances.argsort()]) <= 0)
    if distances.max() > 0:
        assert found[distances.argmax()] == 0
    else:
        assert np.all(found == 1)


def test_quality_has_no_unit():
    distances = np.array([0.1, 0.4, 0.2], np.float32)
    assert quality(distances) == pytest.approx([0.75, 0, 0.5])
    assert quality(distances * 84) == pytest.approx(quality(distances))


def test_blend_gives_each_channel_the_spread_of_its_weight():
    rng = np.random.default_rng(3)
    distances = np.stack([rng.gamma(2, 0.01, 500), rng.gamma(3, 0.2, 500)]).astype(np.float32)
    for channel in (0, 1):
        for weight in (0.3, 0.7):
            alone = np.zeros(2)
            alone[channel] = weight
            assert blend(distances, alone).std() == pytest.approx(weight, rel=1e-5)
    weights = np.array([0.3, 0.7])
    expected = 0.3 * distances[0] / distances[0].std() + 0.7 * distances[1] / distances[1].std()
    assert blend(distances, weights) == pytest.approx(expected, rel=1e-5)
    assert blend(distances * np.array([[100], [1]], np.float32), weights) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("dull", [0.2, 0.3, 0.1 + 0.2])
def test_a_channel_that_tells_nothing_apart_has_no_say(dull):
    distances = np.stack([np.linspace(0.1, 0.4, 50), np.full(50, dull)]).astype(np.float32)
    distances[1, ::2] = np.nextafter(distances[1, ::2], np.float32(1))  # rounding is no difference
    assert quality(blend(distances, np.array([0.5, 0.5]))) == pytest.approx(quality(distances[0]), abs=1e-5)


def test_when_no_channel_tells_anything_all_entries_are_alike():
    found = quality(blend(np.full((2, 9), 0.2, np.float32), np.array([0.5, 0.5])))
    assert np.array_equal(found, np.ones(9))


def test_sharpness_one_is_the_quality_itself():
    qualities = np.array([1.0, 0.5, 0.25, 0.002], np.float32)
    assert np.exp(log_likelihood(qualities, 1.0)) == pytest.approx(qualities, rel=1e-5)
    assert np.exp(log_likelihood(qualities, 4.0)) == pytest.approx(qualities**4.0, rel=1e-4)


def test_the_worst_entry_is_unlikely_but_not_ruled_out():
    found = log_likelihood(np.array([0.0, 1e-9, 1e-3, 1.0], np.float32), 8.0)
    assert np.isfinite(found).all()
    assert found == pytest.approx([8 * np.log(1e-3)] * 3 + [0])
    assert np.array_equal(log_likelihood(np.zeros(2, np.float32), 0.0), np.zeros(2))


def _model(world, weights, sharpness=2.0):
    reference = nearest_reference(world.library.poses, world.library.arena)
    return SensorModel(world.library, reference, SensorParameters(weights, sharpness))


def _poses(world, n=200):
    rng = np.random.default_rng(5)
    xy = rng.uniform(-2.2, 2.2, (n, 2))
    return np.column_stack([xy, rng.uniform(-3, 3, n)]).astype(np.float32)


def test_a_sighting_is_made_of_the_parts(world):
    model, poses = _model(world, {"edges": 0.7, "color": 0.3}), _poses(world)
    descriptors = model.measure(world.drive.all_moments[0].frame.image)
    sighting = model.sight(descriptors, poses)
    assert sighting.channels == ("edges", "color")
    rows = [distance(descriptors[name], world.library.index[name]) for name in sighting.channels]
    assert np.array_equal(sighting.distances, np.stack(rows))
    assert np.array_equal(sighting.channel_quality, np.stack([quality(row) for row in rows]))
    expected = quality(blend(np.stack(rows), np.array([0.7, 0.3])))
    assert np.array_equal(sighting.quality, expected)
    assert np.array_equal(sighting.log_likelihood, log_likelihood(expected, 2.0))
    assert np.array_equal(sighting.entries, model.reference.entries(poses, world.library.origin))
    best = sighting.ranking()
    assert np.all(np.diff(sighting.quality[best]) <= 0)
    assert sorted(best) == list(range(world.library.size))


@pytest.mark.parametrize("name", ["color", "edges"])
def test_one_channel_alone_is_its_own_quality(world, name):
    model = _model(world, FEATURES[name])
    sighting = model.sight(model.measure(world.drive.all_moments[1].frame.image), _poses(world))
    assert sighting.quality == pytest.approx(sighting.channel_quality[0], abs=1e-6)


def test_weights_matter_a_channel(world):
    image, poses = world.drive.all_moments[0].frame.image, _poses(world)
    found = [_model(world, {"color": w, "edges": 1 - w}) for w in (0.0, 0.5, 1.0)]
    none, half, full = (m.sight(m.measure(image), poses).quality for m in found)
    assert not np.allclose(half, full)
    alone = _model(world, FEATURES["edges"])
    assert none == pytest.approx(alone.sight(alone.measure(image), poses).quality, abs=1e-6)


def test_particles_get_their_entrys_likelihood_and_nothing_outside(world):
    model, poses = _model(world, FEATURES["color"]), _poses(world)
    sighting = model.sight(model.measure(world.drive.all_moments[0].frame.image), poses)
    found = particle_log_likelihood(sighting)
    outside = sighting.entries < 0
    assert 0 < outside.sum() < len(poses)
    assert np.all(found[outside] == -np.inf)
    assert np.array_equal(found[~outside], sighting.log_likelihood[sighting.entries[~outside]])


def test_the_best_few_are_the_beginning_of_the_ranking() -> None:
    rng = np.random.default_rng(5)
    for size in (1, 4, 5, 6, 300):
        quality = np.round(rng.random(size), 3).astype(np.float32)
        nothing = np.zeros((0, size), np.float32)
        sighting = Sighting((), {}, nothing, nothing, quality, quality, np.zeros(0, np.int32))
        best = sighting.best(5)
        assert len(best) == min(5, size)
        assert len(set(best.tolist())) == len(best)
        np.testing.assert_array_equal(quality[best], quality[sighting.ranking()[:5]])
