import numpy as np
import pytest

from maurice_datasets.render.camera import LitScene, radiance
from maurice_datasets.render.light import bake, lighting_of, nearest_source, relit, unlit, windows_of
from maurice_datasets.worlds.world import World

POSES = [np.array(pose) for pose in ([0.5, 1.8, 0.3], [2.7, 1.8, 3.0], [4.6, 1.6, -1.2], [3.6, 1.8, np.pi])]


@pytest.fixture(scope="module")
def bare(world: World) -> LitScene:
    return unlit(lighting_of(world))


def view(world: World, bare: LitScene, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
    return radiance(relit(bare, lighting_of(world).under(weights)), pose)


@pytest.mark.slow
def test_weights_of_one_give_the_picture_that_is_lit_for_good(
    world: World, scene: LitScene, bare: LitScene
) -> None:
    ones = np.ones((len(lighting_of(world).parts), 3))
    for pose in POSES:
        fixed, live = radiance(scene, pose), view(world, bare, ones, pose)
        assert np.abs(fixed - live).mean() < 0.01 * fixed.mean()


def test_light_is_the_sum_over_its_sources(world: World, bare: LitScene) -> None:
    parts = len(lighting_of(world).parts)
    weights = np.random.default_rng(5).uniform(0.2, 2, (parts, 3))
    alone = [view(world, bare, weights * (np.arange(parts) == k)[:, None], POSES[1]) for k in range(parts)]
    assert sum(alone) == pytest.approx(view(world, bare, weights, POSES[1]), abs=1e-4)
    assert view(world, bare, np.zeros((len(lighting_of(world).parts), 3)), POSES[0]).max() < 1e-5


def test_a_lamp_that_goes_out_changes_shading_and_not_only_brightness(world: World, bare: LitScene) -> None:
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


def test_what_glows_goes_out_with_the_lamp_that_is_nearest(world: World) -> None:
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
def test_survey_and_session_of_one_world_bake_once(world: World) -> None:
    assert lighting_of(world) is lighting_of(world)
    assert len(bake(world).faces) == len(world.faces)
