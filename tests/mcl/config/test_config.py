"""Everything that can be chosen about a filter, put together by name and run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import (
    FilterParameters,
    Layer,
    MapParameters,
    RecoveryParameters,
    ReferenceParameters,
    ResamplingParameters,
    configure,
)
from maurice_mcl.filter.estimate import heaviest_cluster, weighted_mean
from maurice_mcl.filter.localizer import RESEEDED, run
from maurice_mcl.filter.motion import MotionOutliers
from maurice_mcl.filter.proposal import MixtureParameters
from maurice_mcl.filter.resampling import KldParameters
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.map import OBSTACLES, Region


@pytest.mark.parametrize(
    "choice",
    [
        {"references": ReferenceParameters("furthest")},
        {"resampling": ResamplingParameters("lottery")},
        {"resampling": ResamplingParameters(when="sometimes")},
        {"recovery": RecoveryParameters("hope")},
        {"recovery": RecoveryParameters("always", draw="somewhere")},
    ],
)
def test_unknown_names_are_refused(world, choice):
    with pytest.raises(KeyError):
        build_localizer(world.library, world.drive, FilterParameters(**choice))


@pytest.mark.parametrize(
    "choice",
    [
        {"weights": {"smell": 1.0}},
        {"blend": "shaken"},
        {"likelihood": "none"},
        {"distances": {"color": "far"}},
    ],
)
@pytest.mark.parametrize("method", ["nearest", "interpolated"])
def test_unknown_names_of_the_sensor_are_refused_before_any_picture(world, choice, method):
    sensor = SensorParameters(**{"weights": {"color": 1.0}} | choice)
    parameters = FilterParameters(sensor=sensor, references=ReferenceParameters(method))
    with pytest.raises(KeyError):
        build_localizer(world.library, world.drive, parameters)


RESEEDINGS = ["none", "always", "threshold", "sensor", "augmented", "expansion", "mixture"]


@pytest.mark.parametrize("strategy", RESEEDINGS)
@pytest.mark.parametrize("method", ["nearest", "interpolated"])
@pytest.mark.parametrize("draw", ["evenly", "likelihood"])
def test_every_strategy_runs_repeats_and_keeps_its_books(world, strategy, method, draw):
    parameters = FilterParameters(
        references=ReferenceParameters(method),
        resampling=ResamplingParameters("residual", when="effective", roughening=0.1),
        recovery=RecoveryParameters(strategy, draw),
        motion_outliers=MotionOutliers(0.1),
        particles=200,
    )
    localizer = build_localizer(world.library, world.drive, parameters, seed=3)
    records, again = ([r for _, r in run(localizer, world.drive, world.start)] for _ in range(2))
    for record, other in zip(records, again, strict=True):
        assert record.belief.poses.tobytes() == other.belief.poses.tobytes()
        assert record.weighted.log_weights.tobytes() == other.weighted.log_weights.tobytes()
    for record in records:
        assert record.belief.size == 200
        assert np.isfinite(record.belief.poses).all()
        assert record.weighted.weights.sum() == pytest.approx(1)
        assert record.belief.weights.sum() == pytest.approx(1)
        assert (record.injected is not None) == (RESEEDED in record.events)
        if record.injected is not None:
            assert np.array_equal(record.injected, record.parents == -1)
        if strategy == "always":
            assert record.injected.sum() == 10
        if strategy == "mixture":
            assert record.predicted.weights == pytest.approx(np.full(200, 1 / 200))


def test_fresh_particles_count_in_the_estimate_once_a_picture_has_weighted_them(world):
    parameters = FilterParameters(
        recovery=RecoveryParameters("always", share=0.4),
        sensor=SensorParameters({"color": 1.0}, sharpness=0.0),
        particles=400,
    )
    localizer = build_localizer(world.library, world.drive, parameters)
    state, _ = localizer.step(localizer.initialize(world.start), world.drive.all_moments[0].frame)
    _, record = localizer.step(state, world.drive.all_moments[1].frame)
    for found, estimator in ((record.estimate, heaviest_cluster), (record.mean_estimate, weighted_mean)):
        expected = estimator(record.weighted, localizer.radii)
        assert np.array_equal(found.pose, expected.pose)
        assert found.converged == expected.converged
    assert record.estimate.converged < 0.8


def test_adaptive_size_follows_the_cloud(world):
    parameters = FilterParameters(
        resampling=ResamplingParameters(adaptive=True, kld=KldParameters(least=50, most=3000)),
        sensor=SensorParameters({"color": 1.0}, sharpness=0.0),
        particles=1000,
    )
    localizer = build_localizer(world.library, world.drive, parameters)
    sizes = {}
    for name, start in {"known": world.start, "anywhere": None}.items():
        sizes[name] = [r.belief.size for _, r in run(localizer, world.drive, start)]
        assert all(50 <= size <= 3000 for size in sizes[name])
    assert sizes["known"][0] < 300 < 2500 < sizes["anywhere"][0]
    state = localizer.initialize(None)
    for moment in world.drive.all_moments:
        state, record = localizer.step(state, moment.frame)
        assert record.predicted.size == len(record.sighting.log_likelihood) == record.weighted.size
        assert len(record.parents) == record.belief.size


def test_evidence_of_dual_draws_counts_their_densities(world):
    """Draws where the picture fits would make every picture look well explained."""
    frame = replace(world.drive.all_moments[0].frame, motions=np.zeros((0, 3)))
    found = []
    for strategy in ("none", "mixture"):
        parameters = FilterParameters(
            recovery=RecoveryParameters(strategy, mixture=MixtureParameters(0.5, 0.0)),
            sensor=SensorParameters({"color": 1.0}, distances={"color": "thesis"}, scales={"color": 0.002}),
            references=ReferenceParameters("nearest"),
            particles=100_000,
        )
        localizer = build_localizer(world.library, world.drive, parameters)
        _, record = localizer.step(localizer.initialize(None), frame)
        assert record.calibrated_evidence == pytest.approx(record.log_evidence, abs=1e-4)
        assert record.channel_evidence[0] == pytest.approx(record.calibrated_evidence, abs=1e-4)
        found.append(record.calibrated_evidence)
    assert found[1] == pytest.approx(found[0], abs=0.05)


def test_a_later_layer_wins_and_errors_name_the_layer():
    origin = "MAURICE_FILTER_MOTION_OUTLIERS__SHARE"
    layers = [Layer("file", {"motion_outliers.share": 0.1}), Layer(origin, {"motion_outliers.share": "0.3"})]
    found = configure(layers)
    assert found.parameters.motion_outliers.share == 0.3
    assert {s.key: s.origin for s in found.settings}["motion_outliers.share"] == origin
    with pytest.raises(ValueError, match=r"old\.toml: motion_outliers\.share: found 2, .* from 0"):
        configure([Layer("old.toml", {"motion_outliers.share": 2})])


def test_movable_obstacles_leave_particles_where_the_map_has_one_and_walls_stay(world):
    """After the survey a wardrobe may have been moved, and the robot be where it was."""
    middle = world.library.poses[0, :2]
    box = Region("wardrobe", middle + np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]))
    arena = replace(world.library.arena, obstacles=(*world.library.arena.obstacles, box))
    library = replace(world.library, arena=arena)
    pose = np.array([[*(middle - library.origin), 0.0]], np.float32)
    free = {}
    for obstacles in OBSTACLES:
        made = build_localizer(library, world.drive, FilterParameters(map=MapParameters(obstacles)))
        free[obstacles] = made.reference.grid.free
        inside = made.reference.entries(pose, library.origin)[0] >= 0
        there = np.isfinite(
            made.sensor.references.at(np.zeros(library.size + 9999, np.float32), pose, library.origin)
        )
        assert inside == there[0] == (obstacles != "solid")
    walls = replace(arena, obstacles=())
    assert np.array_equal(free["movable"], nearest_reference(library.poses, walls).grid.free)
    assert free["movable"].sum() > free["solid"].sum()
    assert free["no_walls"].all(), "everywhere within the bounds"
