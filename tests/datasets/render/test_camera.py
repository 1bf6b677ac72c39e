from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.camera import Lens, LitFace, halvings, orientation, radiance, scene_of

LEVEL = Lens(pitch_rad=0.0, height_m=1.0)
FOCAL = LEVEL.width_px / 2 / np.tan(LEVEL.horizontal_fov_rad / 2)
RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
EAST = np.array([0.0, 0.0, 0.0])


def board(
    x: float, left_y: float, right_y: float, low: float, high: float, color: tuple[float, ...]
) -> LitFace:
    """A plain board across the way of a camera that looks east."""
    texture = np.broadcast_to(np.array(color, np.float32), (32, 32, 3)).copy()
    corner, across = np.array([x, left_y, high]), np.array([0.0, right_y - left_y, 0.0])
    return LitFace(corner, across, np.array([0.0, 0, low - high]), halvings(texture))


def look(*faces: LitFace, pose: np.ndarray = EAST) -> np.ndarray:
    return radiance(scene_of(faces), pose, LEVEL)


def span(picture: np.ndarray, channel: int) -> tuple[float, float, float, float]:
    """Left, right, top and bottom pixel edges of what is lit in one channel, from half lit on."""
    lit = picture[..., channel]
    rows, columns = np.flatnonzero(lit.max(axis=1) > 0.5), np.flatnonzero(lit.max(axis=0) > 0.5)
    return columns[0], columns[-1] + 1, rows[0], rows[-1] + 1


def test_the_picture_is_upright_level_and_not_mirrored():
    assert radiance(scene_of((board(2, 1, -1, 0, 2, RED),)), EAST).shape == (144, 176, 3)
    right, down, forward = orientation(0.0, 0.0)
    assert right == pytest.approx([0, -1, 0])
    assert down == pytest.approx([0, 0, -1])
    assert forward == pytest.approx([1, 0, 0])
    face = board(2.0, 0.5, -0.5, 0.5, 1.5, (0, 0, 0))
    texture = np.zeros((32, 32, 3), np.float32)
    texture[:16, :16] = RED  # top left, as seen from its front
    picture = look(LitFace(face.corner, face.across, face.down, halvings(texture)))
    left, right, top, bottom = span(picture, 0)
    assert right == pytest.approx(88, abs=1)
    assert bottom == pytest.approx(72, abs=1)
    assert left < 60
    assert top < 50


def test_boards_fall_on_the_right_pixels():
    picture = look(board(2.0, 0.4, -0.2, 0.9, 1.3, RED))
    left, right, top, bottom = span(picture, 0)
    assert left == pytest.approx(88 - FOCAL * 0.4 / 2, abs=0.8)
    assert right == pytest.approx(88 + FOCAL * 0.2 / 2, abs=0.8)
    assert top == pytest.approx(72 - FOCAL * 0.3 / 2, abs=0.8)
    assert bottom == pytest.approx(72 + FOCAL * 0.1 / 2, abs=0.8)
    far, near = look(board(4, 0.4, -0.4, 0.8, 1.2, RED)), look(board(2, 0.4, -0.4, 0.8, 1.2, RED))
    wide = [span(p, 0)[1] - span(p, 0)[0] for p in (far, near)]
    assert wide[1] == pytest.approx(2 * wide[0], abs=2.1)
    face = board(2, 0.2, -0.2, 0.8, 1.2, RED)
    ahead = span(look(face), 0)[0]
    assert span(look(face, pose=np.array([0, 0, 0.1])), 0)[0] == pytest.approx(ahead + FOCAL * 0.1, abs=3)
    assert span(look(face, pose=np.array([0, -0.2, 0])), 0)[0] == pytest.approx(ahead - FOCAL * 0.1, abs=1)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_face_hides_the_farther_whatever_their_order(order):
    faces = [board(1, 0.1, -0.1, 0.9, 1.1, RED), board(3, 1, -1, 0, 2, GREEN)]
    picture = look(*(faces[k] for k in order))
    assert picture[72, 88] == pytest.approx(RED)
    assert picture[72, 88 + int(FOCAL * 0.1) + 2] == pytest.approx(GREEN)


def test_faces_that_cross_or_turn_their_back_are_hidden():
    slanted = LitFace(
        np.array([1.0, 0.5, 2.0]),
        np.array([2.0, -1.0, 0]),
        np.array([0.0, 0, -2]),
        board(1, 1, 0, 0, 1, BLUE).levels,
    )  # from near on the left to far on the right, through the board at 2 m
    picture = look(board(2, 1, -1, 0, 2, RED), slanted)
    assert picture[72, 88 - 8] == pytest.approx(BLUE)
    assert picture[72, 88 + 8] == pytest.approx(RED)
    face = board(2, -0.5, 0.5, 0.5, 1.5, RED)  # its front to the east
    behind = board(-2, 0.5, -0.5, 0.5, 1.5, GREEN)
    assert look(face, behind).max() == 0


def test_textures_reach_far_and_are_averaged():
    texture = np.ones((64, 64, 3), np.float32)
    floor = LitFace(
        np.array([-50.0, 50, 0]), np.array([100.0, 0, 0]), np.array([0, -100.0, 0]), halvings(texture)
    )
    lit = look(floor)[..., 0].mean(axis=1)
    assert (lit[:72] == 0).all()
    assert (lit[78:] > 0.99).all()
    face = board(40, 8, -8, -7, 9, (0, 0, 0))
    texture = np.zeros((512, 512, 3), np.float32)
    texture[:, ::2] = 1.0  # stripes finer than a pixel from there
    picture = look(LitFace(face.corner, face.across, face.down, halvings(texture)))
    assert picture[70:74, 80:96] == pytest.approx(0.5, abs=0.06)


def test_rooms_are_closed_and_the_door_gap_shows_the_other(scene):
    for pose in ([0.5, 1.8, 0.3], [2.7, 1.8, 3.0], [4.6, 1.6, -1.2], [0.25, 0.7, -2.6]):
        assert radiance(scene, np.array(pose)).min() > 0
    # From the dim room, what is seen through the gap is brighter than the wall beside it
    across_the_gap = np.array([[1.2, 1.8, 0.0], [4.2, 1.8, np.pi]])
    through = [radiance(scene, pose)[30:110, 70:106].mean() for pose in across_the_gap]
    beside = [radiance(scene, pose)[30:110, [2, 3, -3, -2]].mean() for pose in across_the_gap]
    brighter = [t > 1.5 * b for t, b in zip(through, beside, strict=True)]
    assert sum(brighter) == 1  # one room is bright, the other dim
    pose = np.array([1.0, 1.9, 0.7])
    assert np.array_equal(radiance(scene, pose), radiance(scene, pose))
