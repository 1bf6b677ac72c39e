"""Two rooms of which one is the other, turned by half a turn: nothing tells them apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_datasets.render.camera_session import CameraSession, survey_camera
from maurice_datasets.render.image_sensor import Sensor
from maurice_datasets.surveys import Surveyor, reference_poses, write_survey
from maurice_datasets.worlds.build import load_world, shipped_worlds
from maurice_datasets.worlds.plan import WorldError
from maurice_datasets.worlds.rearrange import move_things
from maurice_datasets.worlds.world import World, clearance
from maurice_loaders.libraries.store import build_library
from maurice_mcl.filter.estimate import modes
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose

NOISELESS = Sensor(read_noise=0.0, row_noise=0.0, shot_noise=0.0)


@pytest.fixture(scope="module")
def twins() -> World:
    return load_world("twins", 3)


@pytest.fixture(scope="module")
def camera(twins: World) -> CameraSession:
    return replace(survey_camera(twins, 3), sensor=NOISELESS)


def twin_of(world: World, pose: F64) -> F64:
    return np.append(world.turned(pose[:2]), pose[2] + np.pi)


def free_poses(world: World, count: int) -> F64:
    rng = np.random.default_rng(1)
    places = rng.uniform(world.arena.bounds[:2], world.arena.bounds[2:], (20 * count, 2))
    places = places[clearance(world.arena, places) > 0.1][:count]
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])


def test_pictures_at_twin_poses_are_equal_to_the_bit(twins: World, camera: CameraSession) -> None:
    pictures = [camera.take(0, pose) for pose in free_poses(twins, 12)]
    for pose, picture in zip(free_poses(twins, 12), pictures, strict=True):
        assert np.array_equal(camera.take(0, twin_of(twins, pose)), picture)
    assert not np.array_equal(pictures[0], pictures[1])
    assert min(picture.std() for picture in pictures) > 5


def test_furniture_that_was_moved_makes_no_twins(twins: World) -> None:
    moved = move_things(twins, 1, 0)
    assert not moved.twins
    camera = replace(survey_camera(moved, 3), sensor=NOISELESS)
    pairs = [(pose, twin_of(twins, pose)) for pose in free_poses(twins, 12)]
    assert any(not np.array_equal(camera.take(0, a), camera.take(0, b)) for a, b in pairs)


def test_the_map_has_every_thing_twice(twins: World) -> None:
    arena = twins.arena
    for regions in (arena.obstacles, arena.floors[1:]):
        half = len(regions) // 2
        for region, twin in zip(regions[:half], regions[half:], strict=True):
            assert np.allclose(twins.turned(region.polygon), twin.polygon)
    assert len(twins.nodes) >= 50
    half = len(twins.nodes) // 2
    assert np.array_equal(twins.turned(twins.nodes[:half]), twins.nodes[half:])
    assert len({lamp.source for lamp in twins.lamps}) == 4


def test_the_belief_of_a_filter_stays_in_both_rooms(
    tmp_path: Path, twins: World, camera: CameraSession
) -> None:
    log = tmp_path / "survey.log"
    askew = np.array([0.0, 0.0, 0.01])  # exactly along a wall rounding decides what is seen
    poses = reference_poses(twins.nodes, 4) + askew
    write_survey(log, twins, camera, Surveyor(0.0, 0.0), lambda done, total, what: None, poses)
    library = build_library(log, ["color"])
    localizer = mcl.make_localizer(library, preset="thesis", feature="color", particles=6000, motion={})
    state, pose = localizer.initialize(None), np.append(twins.nodes[4], 0.3)
    for step in range(1, 21):
        motion = np.array([0.05, 0.0, 0.4])
        pose = compose(pose, motion)
        frame = mcl.Frame(step, float(step), motion[None], camera.take(step, pose), "")
        comparison = localizer.sensor.see(frame)
        first, second = comparison.log_likelihood.reshape(2, -1, 4)  # the second's is turned by two headings
        assert np.array_equal(first, np.roll(second, 2, axis=1))
        state, record = localizer.step(state, frame)
    in_first = record.weighted.weights[record.weighted.world_poses[:, 0] < twins.arena.bounds[2] / 2].sum()
    assert 0.2 < in_first < 0.8
    best, rival = modes(record.weighted, record.estimate.radii)[:2]
    assert rival.mass > 0.1
    assert best.pose[:2] == pytest.approx(twins.turned(rival.pose[:2]), abs=0.3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rect = [104, 0, 204, 156]", "rect = [104, 0, 210, 156]", "two rooms and a door that half a turn"),
        ("rect = [100, 60, 104, 96]", "rect = [100, 70, 104, 96]", "two rooms and a door that half a turn"),
        ("at = [57, 96]", "at = [150, 96]", "stands in the second room"),
    ],
)
def test_rooms_that_are_no_twins_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(shipped_worlds()["twins"].read_text().replace(old, new))
    with pytest.raises(WorldError, match=f"twins: .*{said}"):
        load_world(file)
