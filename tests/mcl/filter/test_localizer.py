from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from maurice_mcl.config.build import build_localizer, make_localizer
from maurice_mcl.config.parameters import FilterParameters, ReferenceParameters, ResamplingParameters
from maurice_mcl.filter.localizer import (
    ALL_ZERO,
    EXPANDED,
    LEFT_MAP,
    NO_NUMBER,
    RESAMPLED,
    RESEEDED,
    Localizer,
    run,
)
from maurice_mcl.filter.motion import OdometryMotion, OdometryParameters
from maurice_mcl.filter.proposal import ProposedParticles, belief_at, uniform_belief
from maurice_mcl.filter.resampling import always
from maurice_mcl.filter.weighting import weigh
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.scoring.metrics import score
from maurice_mcl.sensor.ahead import compared as compare_picture
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.map import Arena, Region, make_grid
from maurice_mcl.values.randomness import stream
from maurice_mcl.values.records import Belief, uniform_log_weights
from maurice_mcl.values.session import Frame, Moment

BY = {"color": "thesis", "edges": "thesis"}
FEATURES = {"color": {"color": 1.0}, "edges": {"edges": 1.0}, "blended": {"color": 0.5, "edges": 0.5}}


def _localizer(world, particles=300, seed=5, resampler="systematic", feature="blended"):
    """Put together the thesis's filter."""
    sensor = SensorParameters(FEATURES[feature], likelihood="power", blend="sum", distances=BY)
    parameters = FilterParameters(
        sensor=sensor,
        references=ReferenceParameters("nearest"),
        resampling=ResamplingParameters(resampler),
        particles=particles,
    )
    return build_localizer(world.library, world.drive, parameters, seed=seed)


def _records(world, start="known", **choices):
    localizer = _localizer(world, **choices)
    pose = world.start if start == "known" else None
    return [record for _, record in run(localizer, world.drive, pose)]


def _alike(a, b):
    """Compare two values to the last bit, dataclasses field by field; timings aside."""
    if is_dataclass(a):
        names = [f.name for f in fields(a) if f.name != "took_s"]
        return type(a) is type(b) and all(_alike(getattr(a, n), getattr(b, n)) for n in names)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_alike(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(_alike, a, b))
    return a == b


EITHER_START = pytest.mark.parametrize("start", ["known", "anywhere"])


@EITHER_START
@pytest.mark.parametrize("resampler", ["systematic", "multinomial"])
def test_the_same_seed_gives_the_same_records_to_the_last_bit(world, start, resampler):
    once, again = (_records(world, start, resampler=resampler) for _ in range(2))
    assert len(once) == len(world.drive.all_moments)
    assert all(_alike(a, b) for a, b in zip(once, again, strict=True))


@EITHER_START
def test_another_seed_gives_other_particles(world, start):
    once, other = (_records(world, start, seed=seed) for seed in (5, 6))
    pairs = zip(once, other, strict=True)
    assert not any(np.array_equal(a.predicted.poses, b.predicted.poses) for a, b in pairs)


@pytest.mark.parametrize("change", ["moved", "removed"])
def test_truth_and_events_change_no_particle(world, change):
    def altered(moment):
        truth = None if change == "removed" else moment.truth + np.array([1.0, -1.0, 0.5])
        return replace(moment, truth=truth, events=() if change == "removed" else ("kidnapped",))

    drive = replace(world.drive, all_moments=tuple(altered(m) for m in world.drive.all_moments))
    other = _records(replace(world, drive=drive))
    assert all(_alike(a, b) for a, b in zip(_records(world), other, strict=True))


def test_what_is_given_is_not_changed(world):
    localizer = _localizer(world, particles=300)
    state = localizer.initialize(None)
    frame = world.drive.all_moments[0].frame
    given = [state.belief.poses, state.belief.log_weights, frame.motions, frame.image]
    kept = [array.copy() for array in given]
    _, record = localizer.step(state, frame)
    stages = [record.predicted, record.weighted, record.belief]
    stage_arrays = [a for b in stages for a in (b.poses, b.log_weights)]
    frozen = [a.copy() for a in stage_arrays]
    localizer.step(localizer.step(state, frame)[0], world.drive.all_moments[1].frame)
    assert all(np.array_equal(a, b) for a, b in zip(given, kept, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(stage_arrays, frozen, strict=True))


def test_a_step_goes_on_from_the_state_alone(world):
    records = _records(world)
    localizer = _localizer(world, particles=300, seed=5)
    state = localizer.initialize(world.start)
    for moment, expected in zip(world.drive.all_moments, records, strict=True):
        branch, record = localizer.step(state, moment.frame)
        again, _ = localizer.step(state, moment.frame)
        assert _alike(record, expected)
        assert _alike(branch, again)
        assert branch.step == moment.frame.step
        state = branch


@EITHER_START
def test_weights_stay_with_their_particles(world, start):
    """Shuffled against each other, no weight would fit its particle's own entry any more."""
    reference = _localizer(world).reference
    for record in _records(world, start):
        likelihood = np.append(record.sighting.comparison.log_likelihood, -np.inf).astype(np.float64)
        entries = record.sighting.entries
        assert np.array_equal(entries, reference.entries(record.predicted.poses, world.library.origin))
        expected = record.predicted.log_weights + likelihood[entries]
        assert record.weighted.log_weights + record.log_evidence == pytest.approx(expected, abs=1e-9)
        assert record.weighted.poses is record.predicted.poses


@pytest.mark.parametrize("resampler", ["systematic", "multinomial"])
def test_parents_reproduce_the_belief(world, resampler):
    for record in _records(world, "anywhere", resampler=resampler):
        assert np.array_equal(record.belief.poses, record.weighted.poses[record.parents])
        assert np.exp(record.belief.log_weights) == pytest.approx(np.full(300, 1 / 300))
        assert np.all(np.isfinite(record.weighted.log_weights[record.parents])), "no dead parent"
        assert record.events == (RESAMPLED,)


def test_each_step_starts_from_the_last_ones_belief(world):
    localizer = _localizer(world, particles=300)
    still = [replace(m.frame, motions=np.zeros((0, 3))) for m in world.drive.all_moments]
    state = localizer.initialize(None)
    for frame in still:
        before = state.belief
        state, record = localizer.step(state, frame)
        assert np.array_equal(record.predicted.poses, before.poses), "no movement, no noise"
        assert state.belief is record.belief


def test_without_resampling_weights_multiply(world):
    localizer = replace(
        _localizer(world, particles=300),
        resampling=replace(_localizer(world).resampling, when=lambda belief, step: False),
    )
    state, total = localizer.initialize(None), np.zeros(300)
    for moment in world.drive.all_moments[:4]:
        state, record = localizer.step(state, moment.frame)
        total = total + np.append(record.sighting.comparison.log_likelihood, -np.inf)[record.sighting.entries]
        assert record.parents is None
        assert record.events == ()
        assert record.belief is record.weighted
    alive = np.isfinite(total)
    shifted = total[alive] - np.log(np.exp(total[alive]).sum())
    assert record.weighted.log_weights[alive] == pytest.approx(shifted, abs=1e-4)
    assert record.effective_sample_size == pytest.approx(1 / (record.weighted.weights**2).sum())
    assert always(record.belief, 4)


def test_evidence_is_the_mean_likelihood_under_the_prior():
    prior = np.log(np.array([0.5, 0.3, 0.2]))
    belief = Belief(np.zeros((3, 3), np.float32), prior, np.zeros(2))
    likelihood = np.array([0.1, 0.6, 0.0], np.float32)
    with np.errstate(divide="ignore"):
        weighted, log_evidence = weigh(ProposedParticles(belief), np.log(likelihood))
    assert np.exp(log_evidence) == pytest.approx(0.5 * 0.1 + 0.3 * 0.6)
    assert weighted.weights == pytest.approx(np.array([0.05, 0.18, 0.0]) / 0.23)
    weighted, log_evidence = weigh(ProposedParticles(belief), np.full(3, -np.inf, np.float32))
    assert log_evidence == -np.inf
    assert np.array_equal(weighted.log_weights, prior)


def test_a_cloud_that_would_leave_the_map_stays_and_only_turns(world):
    localizer = _localizer(world, particles=50)
    start = localizer.initialize(world.start)
    frame = replace(world.drive.all_moments[0].frame, motions=np.array([[100.0, 0.0, 0.5]]))
    _, record = localizer.step(start, frame)
    assert record.events == (LEFT_MAP, RESAMPLED)
    assert np.array_equal(record.weighted.poses[:, :2], start.belief.poses[:, :2])
    assert np.abs(record.weighted.poses[:, 2] - start.belief.poses[:, 2]).min() > 0.01
    assert np.isfinite(record.log_evidence)
    assert (record.sighting.entries >= 0).all()


def test_a_channel_that_holds_nan_is_told_as_such_and_moves_no_particle(world):
    localizer = _localizer(world, particles=50)
    start, frame = localizer.initialize(world.start), world.drive.all_moments[0].frame
    (compared,) = compare_picture([localizer.sensor], frame)
    broken = np.full_like(compared.comparison.log_likelihood, np.nan)
    spoiled = replace(compared, comparison=replace(compared.comparison, log_likelihood=broken))
    _, record = localizer.step(start, frame, spoiled)
    assert set(record.events) - {RESAMPLED} == {NO_NUMBER, ALL_ZERO}
    assert np.array_equal(record.weighted.poses, localizer.step(start, frame)[1].weighted.poses)
    moment = Moment(frame, None, ())
    (event,) = [one for one in EventDetector().see(moment, record) if one.kind == "all-weights-zero"]
    assert "a channel or the library holds NaN" in event.text


@pytest.mark.parametrize("strategy", ["always", "threshold", "sensor", "augmented", "expansion", "mixture"])
def test_every_recovery_bears_pictures_without_a_number(world, strategy):
    settings = {"recovery.strategy": strategy}
    localizer = make_localizer(world.library, feature="color", particles=50, settings=settings)
    localizer = localizer.of_session(world.drive)
    state = localizer.initialize(world.start)
    for moment in world.drive.all_moments[:4]:
        (compared,) = compare_picture([localizer.sensor], moment.frame)
        if moment.frame.step > 1:
            broken = {
                name: np.full_like(getattr(compared.comparison, name), np.nan)
                for name in ("distances", "channel_cost", "cost", "log_likelihood", "virtual")
            }
            compared = replace(compared, comparison=replace(compared.comparison, **broken))
        state, record = localizer.step(state, moment.frame, compared)
        assert np.isfinite(record.belief.poses).all()
    assert not np.isnan([state.recovery.slow, state.recovery.fast, state.recovery.spread]).any()


@pytest.mark.parametrize("strategy", ["threshold", "sensor", "augmented", "expansion"])
def test_leaving_the_map_starts_every_recovery(world, strategy):
    settings = {"recovery.strategy": strategy}
    localizer = make_localizer(world.library, feature="color", particles=50, settings=settings)
    localizer = localizer.of_session(world.drive)
    state = localizer.initialize(world.start)
    *before, last = (moment.frame for moment in world.drive.all_moments[:4])
    for frame in before:
        state, _ = localizer.step(state, frame)
    away = replace(last, motions=np.array([[100.0, 0.0, 0.5]]))
    _, record = localizer.step(state, away)
    assert LEFT_MAP in record.events
    assert {RESEEDED, EXPANDED} & set(record.events)


@pytest.mark.parametrize("strategy", ["none", "mixture"])
def test_a_cloud_that_left_the_map_stays_and_each_particle_turns_by_itself(world, strategy):
    settings = {"recovery.strategy": strategy, "recovery.mixture.teleport": 0.0}
    localizer = make_localizer(world.library, feature="color", particles=50, settings=settings)
    localizer = replace(localizer, motion=OdometryMotion(OdometryParameters(0, 0, 0, 0)))
    state = localizer.initialize(world.start)
    poses = state.belief.poses.copy()
    poses[:, 2] = np.linspace(-3, 3, 50)
    state = replace(state, belief=replace(state.belief, poses=poses))
    away = replace(world.drive.all_moments[0].frame, motions=np.array([[100.0, 0.0, 0.5]]))
    _, record = localizer.step(state, away)
    assert LEFT_MAP in record.events
    assert np.array_equal(record.weighted.poses[:, :2], poses[:, :2])
    assert wrap(record.weighted.poses[:, 2] - poses[:, 2]) == pytest.approx(np.full(50, 0.5), abs=1e-5)


def test_when_every_particle_is_outside_it_is_an_event_and_no_nan(world):
    localizer = _localizer(world, particles=50)
    state = localizer.initialize(np.array([-3.0, -3.0, 0.0]))
    for moment in world.drive.all_moments[:3]:
        state, record = localizer.step(state, moment.frame)
        assert (record.events, record.log_evidence) == ((ALL_ZERO, RESAMPLED), -np.inf)
        assert record.weighted.weights == pytest.approx(np.full(50, 0.02))
        assert record.effective_sample_size == pytest.approx(50)
        assert np.isfinite(record.belief.poses).all()
        assert np.isfinite(record.estimate.pose).all()
        assert np.isfinite(record.mean_estimate.pose).all()


@EITHER_START
def test_more_particles_keep_the_first_ones_draws(world, start):
    few, many = (_records(world, start, particles=n)[0] for n in (100, 350))
    assert len(world.drive.all_moments[0].frame.motions) > 1, "in the second movement too"
    assert np.array_equal(many.predicted.poses[:100], few.predicted.poses)


def test_odd_frames_and_one_particle(world):
    localizer = _localizer(world, particles=20)
    image = world.drive.all_moments[0].frame.image
    motions = np.tile([[0.01, 0.0, 0.02]], (50, 1))
    for step, moved in [(1, np.zeros((0, 3))), (2, motions)]:
        state, record = localizer.step(localizer.initialize(world.start), Frame(step, 0.0, moved, image, ""))
        assert np.isfinite(record.predicted.poses).all()
        assert state.step == step
    record = _records(world)[0]
    assert set(record.took_s) == {"measure", "propose", "weight", "estimate", "resample", "recover"}
    assert min(record.took_s.values()) > 0
    record = _records(world, particles=1)[-1]
    assert record.effective_sample_size == pytest.approx(1)
    assert record.estimate.mass == pytest.approx(1)


@pytest.mark.parametrize("feature", ["color", "edges", "blended"])
def test_features_by_name(world, feature):
    expected = {"color": {"color"}, "edges": {"edges"}, "blended": {"color", "edges"}}[feature]
    assert set(_records(world, feature=feature)[0].sighting.comparison.channels) == expected


def test_far_from_the_origin_the_errors_are_the_same(world_at):
    at = np.array([500_000.0, -250_000.0])
    scores = []
    for world in (world_at(), world_at((float(at[0]), float(at[1])))):
        localizer = _localizer(world, particles=400, seed=2)
        scores.append(score(run(localizer, world.drive, world.start)))
    assert scores[1].error_mean_m == pytest.approx(scores[0].error_mean_m, abs=0.002)
    assert scores[1].heading_error_mean_rad == pytest.approx(scores[0].heading_error_mean_rad, abs=0.002)


def test_a_robot_whose_pictures_match_is_tracked(world):
    """Give each update the very picture of the entry nearest to the truth: the filter stays with it."""
    localizer = _localizer(world, feature="color", particles=1000)
    state = localizer.initialize(world.start)
    index = world.library.index["color"]
    for moment in world.drive.all_moments:
        relative = np.array([moment.truth], np.float32) - np.append(world.library.origin, 0)
        entry = localizer.reference.entries(relative.astype(np.float32), world.library.origin)[0]
        seeing = replace(localizer, sensor=_Seeing(localizer.sensor, index.references[entry]))
        state, record = seeing.step(state, moment.frame)
        assert np.hypot(*(record.estimate.pose[:2] - moment.truth[:2])) < 0.4
        assert record.sighting.comparison.ranking()[0] == entry


class _Seeing:
    """The real sensor model, with a known descriptor in place of the picture's."""

    def __init__(self, model, descriptor):
        self.model, self.descriptor, self.sensors = model, descriptor, model.sensors

    def see(self, frame):
        return self.model.compare({"color": self.descriptor})

    def at(self, comparison, poses):
        return self.model.at(comparison, poses)


def test_the_localizer_holds_no_state():
    assert {f.name for f in fields(Localizer)} >= {"library", "motion", "sensor", "resampling", "seed"}
    assert Localizer.__dataclass_params__.frozen
    assert np.exp(uniform_log_weights(4)) == pytest.approx([0.25] * 4)
    belief = belief_at(np.array([500_000.5, 2.0, 3.0 + 2 * np.pi]), 7, np.array([500_000.0, 1.5]))
    assert belief.world_poses == pytest.approx(np.tile([500_000.5, 2.0, 3.0], (7, 1)))
    assert belief.weights == pytest.approx(np.full(7, 1 / 7))
    few, many = (uniform_belief(_grid(), n, MIDDLE, stream(9, 2)).poses for n in (50, 500))
    assert np.array_equal(many[:50], few)


BOX = Region("box", np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]]))
PLACES = np.array([[0.5, 2.5], [1.0, 2.5], [0.5, 3.0]])
MIDDLE = np.array([2.0, 1.5])


def _grid(obstacles=(BOX,)):
    return make_grid(Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4)), obstacles), PLACES)


def test_global_start_is_even_over_free_space_and_headings():
    n, grid = 100_000, _grid()
    belief = uniform_belief(grid, n, MIDDLE, stream(9, 1))
    x, y, heading = belief.world_poses.T
    assert grid.free.ravel()[grid.cells_of(belief.poses[:, :2], MIDDLE)].mean() > 0.9999
    assert not ((x < 1.97) & (y < 1.47)).any()
    share = {"right": (x > 2.04), "above": (x < 2.04) & (y > 1.54), "north": heading > np.pi / 2}
    area = 4 * 3 - 2.04 * 1.54
    expected = {"right": 1.96 * 3 / area, "above": 2.04 * 1.46 / area, "north": 0.25}
    for name, inside in share.items():
        p = expected[name]
        assert abs(inside.mean() - p) < 4 * np.sqrt(p * (1 - p) / n) + 0.008  # a cell's border
    assert np.abs(heading).max() <= np.float32(np.pi)


def test_no_free_space_is_said():
    all_over = Region("flood", np.array([[-1.0, -1.0], [5.0, -1.0], [5.0, 4.0], [-1.0, 4.0]]))
    with pytest.raises(ValueError, match="no free space"):
        uniform_belief(_grid((all_over,)), 10, MIDDLE, stream(9, 1))
