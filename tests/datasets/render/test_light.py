from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.camera import LitScene, radiance
from maurice_datasets.render.light import (
    Baking,
    bake,
    face_points,
    hit_distance,
    irradiance_by_part,
    lighting_of,
    nearest_source,
    openness,
    parts_of,
    relit,
    unlit,
    windows_of,
)
from maurice_datasets.worlds.world import Box, Face, Lamp, RoomLight, World
from maurice_mcl.values.map import Arena, Region

UNIT = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def _light_in(world, points, normals):
    """Return all light (K, 3) at points (K, 3)."""
    return irradiance_by_part(world, parts_of(world), points, normals, Baking()).sum(axis=0)


def f32(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(rows, np.float32)


def test_light_falls_as_geometry_says():
    start = f32((-3, 0, 0), (-3, 0, 0), (-3, 2, 0), (0, 0, 0), (0, 0, 5))
    toward = f32((1, 0, 0), (-1, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, -1))
    assert hit_distance(start, toward, (UNIT,)) == pytest.approx([2, np.inf, np.inf, 0, 4])
    turned = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), np.pi / 4)
    far = hit_distance(f32((-3, 0.001, 0)), f32((1, 0, 0)), (turned,))
    assert far[0] == pytest.approx(3 - np.sqrt(2), abs=0.01)
    behind = Box((4.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert hit_distance(f32((-3, 0, 0)), f32((1, 0, 0)), (behind, UNIT))[0] == pytest.approx(2)
    wall = Box((0.0, 0.0, 5.0), (0.05, 50.0, 5.0))
    points, up = np.array([[5.0, 0, 0.01], [0.06, 0, 0.01]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    far, near = openness(points, up, (wall,), Baking(directions=200))
    assert far == pytest.approx(1)
    assert 0.45 < near < 0.6


def world_with(lamps: tuple[Lamp, ...], boxes: tuple[Box, ...] = (), ambient: float = 0.0) -> World:
    room = Region("room", np.array([[-9.0, -9], [9, -9], [9, 9], [-9, 9]]))
    face = Face(
        np.array([-1.0, 1, 0]),
        np.array([2.0, 0, 0]),
        np.array([0, -2.0, 0]),
        np.full((64, 64, 3), 0.5, np.float32),
    )
    arena = Arena((-9, -9, 9, 9), np.zeros((0, 4)))
    return World(
        "test",
        arena,
        (face,),
        boxes,
        (),
        lamps,
        (RoomLight("lamp", room, np.full(3, ambient)),),
        np.zeros((0, 2)),
        8,
    )


def test_lamps_and_boxes_make_light_and_shadow():
    lamp = Lamp("lamp", np.array([[0.0, 0, 2]]), np.ones(3))
    points, up = np.array([[0.0, 0, 0], [2, 0, 0]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    light = _light_in(world_with((lamp,)), points, up)
    assert light[:, 0] == pytest.approx([0.25, np.cos(np.pi / 4) / 8])
    lamp, shade = Lamp("lamp", np.array([[0.0, 0, 2]]), np.ones(3)), Box((0.0, 0.0, 1.0), (0.2, 0.2, 0.1))
    points, up = np.array([[0.0, 0, 0], [2, 0, 0]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    light = _light_in(world_with((lamp,), (shade,)), points, up)
    assert light[0, 0] == 0
    assert light[1, 0] > 0
    window = Lamp("lamp", np.array([[0.0, 0, 1]]), np.ones(3), facing=np.array([1.0, 0, 0]))
    points, up = np.array([[1.0, 0, 0], [-1, 0, 0]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    light = _light_in(world_with((window,)), points, up)
    assert light[0, 0] > 0
    assert light[1, 0] == 0


def test_baking_of_plain_light():
    (lit,) = bake(world_with((), ambient=0.8)).faces
    assert lit.levels[0] == pytest.approx(np.full((64, 64, 3), 0.4), abs=1e-5)
    assert [level.shape[0] for level in lit.levels] == [64, 32, 16, 8, 4]
    face = world_with(()).faces[0]
    points, (rows, columns) = face_points(face, Baking(spacing_m=0.5))
    assert (rows, columns) == (4, 4)
    assert points[:, 2] == pytest.approx(np.full(16, Baking().lift_m))
    assert points.mean(axis=0)[:2] == pytest.approx([0, 0])


POSES = [np.array(pose) for pose in ([0.5, 1.8, 0.3], [2.7, 1.8, 3.0], [4.6, 1.6, -1.2], [3.6, 1.8, np.pi])]


@pytest.fixture(scope="module")
def bare(world: World) -> LitScene:
    return unlit(lighting_of(world))


def view(world: World, bare: LitScene, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
    return radiance(relit(bare, lighting_of(world).under(weights)), pose)


@pytest.mark.slow
def test_weights_of_one_give_the_picture_that_is_lit_for_good(world, scene, bare):
    ones = np.ones((len(lighting_of(world).parts), 3))
    for pose in POSES:
        fixed, live = radiance(scene, pose), view(world, bare, ones, pose)
        assert np.abs(fixed - live).mean() < 0.01 * fixed.mean()


def test_light_is_the_sum_over_its_sources(world, bare):
    parts = len(lighting_of(world).parts)
    weights = np.random.default_rng(5).uniform(0.2, 2, (parts, 3))
    alone = [view(world, bare, weights * (np.arange(parts) == k)[:, None], POSES[1]) for k in range(parts)]
    assert sum(alone) == pytest.approx(view(world, bare, weights, POSES[1]), abs=1e-4)
    assert view(world, bare, np.zeros((len(lighting_of(world).parts), 3)), POSES[0]).max() < 1e-5


def test_a_lamp_that_goes_out_changes_shading_and_not_only_brightness(world, bare):
    lighting = lighting_of(world)
    source = windows_of(world) and next(iter(windows_of(world)))
    off = np.array([[0.0 if part.source == source else 1.0] * 3 for part in lighting.parts])
    ratios = []
    for pose in POSES:
        with_it = view(world, bare, np.ones_like(off), pose)
        ratios.append((view(world, bare, off, pose) / with_it).ravel())
    ratio = np.concatenate(ratios)
    assert ratio.max() <= 1 + 1e-4
    assert np.quantile(ratio, 0.95) - np.quantile(ratio, 0.05) > 0.3


def test_what_glows_goes_out_with_the_lamp_that_is_nearest(world):
    lighting, first = lighting_of(world), 0
    glowing = 0
    for face, (rows, columns) in zip(world.faces, lighting.shapes, strict=True):
        here = slice(first, first + rows * columns)
        first = here.stop
        if face.glow:
            glowing += 1
            own = [k for k, part in enumerate(lighting.parts) if part.source == nearest_source(world, face)]
            dark = np.array([[0.0 if k in own else 1.0] * 3 for k in range(len(lighting.parts))])
            left = lighting.total[here] - lighting.under(dark)[here]
            assert left.min() >= face.glow * 0.999
    assert glowing > 0


@pytest.mark.slow
def test_survey_and_session_of_one_world_bake_once(world):
    assert lighting_of(world) is lighting_of(world)
    assert len(bake(world).faces) == len(world.faces)
