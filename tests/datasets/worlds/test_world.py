import numpy as np
import pytest

from maurice_datasets.worlds.world import Face, clearance, floor_at, inside, segment_distance
from maurice_mcl.map import Arena, Region

SQUARE = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]])


def arena() -> Arena:
    return Arena(
        (0, 0, 10, 10),
        np.array([[0.0, 0, 10, 0], [5, 4, 5, 10]]),
        obstacles=(Region("box", SQUARE + np.array([0, 5])),),
        floors=(Region("wood", 10 * SQUARE - 10), Region("carpet", SQUARE)),
    )


def test_inside_tells_points_whichever_way_round() -> None:
    points = np.array([[2, 1.5], [0.5, 1.5], [2, 2.5], [3.5, 1.5]])
    assert inside(SQUARE, points).tolist() == [True, False, False, False]
    notched = np.array([[0.0, 0], [4, 0], [4, 4], [2, 1], [0, 4]])
    assert inside(notched, np.array([[2, 0.5], [2, 2], [0.5, 2]])).tolist() == [True, False, True]
    points = np.random.default_rng(0).uniform(0, 4, (200, 2))
    assert (inside(SQUARE, points) == inside(SQUARE[::-1], points)).all()


def test_distances_and_floors_by_hand() -> None:
    start, end = np.array([[0.0, 0], [9, 9]]), np.array([[4.0, 0], [9, 9]])
    points = np.array([[2, 3], [7, 4], [-3, -4], [9, 8]])
    assert segment_distance(points, start, end) == pytest.approx([3, 5, 5, 1])
    points = np.array([[8, 1], [4.5, 6], [2, 6.5], [2, 5.6], [5, 3]])
    assert clearance(arena(), points) == pytest.approx([1, 0.5, 0, 0.4, 1])
    assert floor_at(arena(), 2, 1.5) == "carpet"
    assert floor_at(arena(), 5, 5) == "wood"
    assert floor_at(arena(), 50, 5) == ""
    north_wall = Face(
        np.array([0.0, 5, 2]), np.array([3.0, 0, 0]), np.array([0, 0, -2.0]), np.ones((2, 2, 3), np.float32)
    )
    assert north_wall.normal == pytest.approx([0, -1, 0])
