from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.camera import Lens
from maurice_datasets.render.camera_session import session_camera, survey_camera
from maurice_datasets.render.conditions import Conditions, parse_lights

POSE = np.array([1.2, 1.9, 0.4])
POSES = [POSE, np.array([4.0, 2.5, 2.0]), np.array([2.7, 1.8, 3.0])]
ALL = Conditions(
    parse_lights("dim@3,off@4,daylight@2-9,on@12"), 0.2, 0.1, occluded=1.0, gain="auto", half_resolution=True
)


@pytest.mark.parametrize("conditions", [Conditions(), ALL], ids=["nominal", "everything"])
def test_a_picture_is_a_function_of_seed_number_and_pose_alone(world, conditions):
    one, same = session_camera(world, 3, conditions), session_camera(world, 3, conditions)
    forward = [one.take(k, POSE) for k in (5, 6, 7)]
    backward = [same.take(k, POSE) for k in (7, 6, 5)]
    assert all(np.array_equal(a, b) for a, b in zip(forward, backward[::-1], strict=True))
    assert not np.array_equal(forward[0], session_camera(world, 4, conditions).take(5, POSE))


def test_taking_a_picture_moves_nobody(world):
    pose = POSE.copy()
    obstacles = [region.polygon.copy() for region in world.arena.obstacles]
    session_camera(world, 3, ALL).take(5, pose)
    assert np.array_equal(pose, POSE)
    after = [region.polygon for region in world.arena.obstacles]
    assert all(np.array_equal(a, b) for a, b in zip(obstacles, after, strict=True))


def test_nothing_changes_before_the_first_change_and_on_gives_it_back(world):
    plain = session_camera(world, 3)
    changing = session_camera(world, 3, Conditions(parse_lights("dim@4,off@4,daylight@5-6")))
    off = np.abs(plain.take(3, POSE).astype(int) - changing.take(3, POSE))
    assert off.mean() < 0.2  # texture times light is averaged in another order, nothing more
    assert np.abs(plain.take(4, POSE).astype(int) - changing.take(4, POSE)).mean() > 4
    changing = session_camera(world, 3, Conditions(parse_lights("dim:0.3@2,on@4")))
    assert np.array_equal(changing.take(4, POSE), session_camera(world, 3).take(4, POSE))


def test_automatic_gain_brings_every_mean_near_the_target(world):
    fixed, auto = session_camera(world, 3), session_camera(world, 3, Conditions(gain="auto"))
    want = auto.sensor.target + np.mean(auto.sensor.black)
    means = {
        name: np.array([camera.take(1, pose).mean() for pose in POSES])
        for name, camera in (("fixed", fixed), ("auto", auto))
    }
    assert np.abs(means["auto"] - want).max() < 6
    assert np.abs(means["fixed"] - want).max() > 15
    bright = session_camera(world, 3, Conditions(gain="auto"))
    dim = session_camera(world, 3, Conditions(parse_lights("dim@1"), gain="auto"))
    pose = POSES[1]
    assert np.abs(bright.take(2, pose).astype(int) - dim.take(2, pose)).mean() < 1


def test_half_resolution_doubles_every_other_column(world):
    picture = session_camera(world, 3, Conditions(half_resolution=True)).take(1, POSE)
    whole = session_camera(world, 3).take(1, POSE)
    assert picture.shape == whole.shape == (144, 176, 3)
    assert np.array_equal(picture[:, ::2], picture[:, 1::2])
    assert not np.array_equal(whole[:, ::2], whole[:, 1::2])


@pytest.mark.parametrize("size", [(88, 143), (176, 144), (352, 288), (640, 480)])
def test_every_size_shows_the_same_view(world, size):
    """At 88 x 143 pixels are twice as wide as high."""
    width, height = size
    lens = Lens(width, height, pixel_aspect=2.0 if width < height else 1.0)
    picture = session_camera(world, 3, lens=lens).take(1, POSE)
    assert picture.shape == (height, width, 3)
    usual = session_camera(world, 3).take(1, POSE).astype(float)
    blocks = (6, 8)

    def mosaic(image: np.ndarray) -> np.ndarray:
        middle = round(image.shape[1] / lens_aspect(image) * 3 / 4)
        top = (image.shape[0] - middle) // 2
        cut = image[top : top + middle]
        rows, columns = cut.shape[0] // blocks[0] * blocks[0], cut.shape[1] // blocks[1] * blocks[1]
        shaped = cut[:rows, :columns].reshape(
            blocks[0], rows // blocks[0], blocks[1], columns // blocks[1], 3
        )
        return shaped.mean(axis=(1, 3))

    def lens_aspect(image: np.ndarray) -> float:
        return 0.5 if image.shape[1] < image.shape[0] else 1.0

    assert np.corrcoef(mosaic(picture).ravel(), mosaic(usual).ravel())[0, 1] > 0.95


def test_events_and_notes_tell_what_happens(world):
    camera = session_camera(world, 3, ALL)
    lamp = world.sources[0]
    assert camera.events(4) == (f"lights off {lamp}",)
    assert camera.events(5) == ()
    assert len(camera.notes) == 5
    assert session_camera(world, 3).notes == ()
    with pytest.raises(ValueError, match="found no light called 'attic'"):
        session_camera(world, 3, Conditions(parse_lights("off:attic@3")))
    assert survey_camera(world, 3).events(1) == ()
