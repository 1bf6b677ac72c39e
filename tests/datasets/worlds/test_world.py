from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.worlds.rearrange import door_middles, move_things
from maurice_datasets.worlds.world import Face, World, clearance, floor_at, inside, segment_distance, touching
from maurice_loaders.errors import InputError
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena, Region

SQUARE = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]])


def arena() -> Arena:
    return Arena(
        (0, 0, 10, 10),
        np.array([[0.0, 0, 10, 0], [5, 4, 5, 10]]),
        obstacles=(Region("box", SQUARE + np.array([0, 5])),),
        floors=(Region("wood", 10 * SQUARE - 10), Region("carpet", SQUARE)),
    )


def test_a_floor_at_a_point_is_that_which_inside_finds():
    rng = np.random.default_rng(2)
    for corners in rng.integers(3, 9, size=40):
        polygon = rng.normal(size=(corners, 2)).round(1)  # may cross itself
        points = rng.normal(size=(100, 2)).round(1)  # often level with a corner
        floor = Arena((0, 0, 1, 1), np.zeros((0, 4)), floors=(Region("mat", polygon),))
        found = [floor_at(floor, float(x), float(y)) == "mat" for x, y in points]
        assert found == inside(polygon, points).tolist()


def test_inside_tells_points_whichever_way_round():
    points = np.array([[2, 1.5], [0.5, 1.5], [2, 2.5], [3.5, 1.5]])
    assert inside(SQUARE, points).tolist() == [True, False, False, False]
    notched = np.array([[0.0, 0], [4, 0], [4, 4], [2, 1], [0, 4]])
    assert inside(notched, np.array([[2, 0.5], [2, 2], [0.5, 2]])).tolist() == [True, False, True]
    points = np.random.default_rng(0).uniform(0, 4, (200, 2))
    assert (inside(SQUARE, points) == inside(SQUARE[::-1], points)).all()


def test_distances_and_floors_by_hand():
    start, end = np.array([[0.0, 0], [9, 9]]), np.array([[4.0, 0], [9, 9]])
    points = np.array([[2, 3], [7, 4], [-3, -4], [9, 8]])
    assert segment_distance(points, np.concatenate([start, end], axis=1)) == pytest.approx([3, 5, 5, 1])
    points = np.array([[8, 1], [4.5, 6], [2, 6.5], [2, 5.6], [5, 3]])
    assert clearance(arena(), points) == pytest.approx([1, 0.5, 0, 0.4, 1])
    assert floor_at(arena(), 2, 1.5) == "carpet"
    assert floor_at(arena(), 5, 5) == "wood"
    assert floor_at(arena(), 50, 5) == ""
    north_wall = Face(
        np.array([0.0, 5, 2]), np.array([3.0, 0, 0]), np.array([0, 0, -2.0]), np.ones((2, 2, 3), np.float32)
    )
    assert north_wall.normal == pytest.approx([0, -1, 0])


def moves(before: World, after: World) -> np.ndarray:
    """How far each piece went."""
    pairs = zip(before.furniture, after.furniture, strict=True)
    return np.array([np.linalg.norm(b.plan.mean(axis=0) - a.plan.mean(axis=0)) for a, b in pairs])


@pytest.mark.parametrize("seed", range(4))
def test_so_many_pieces_move_far_and_stand_free(world, seed):
    after = move_things(world, 3, seed)
    far = moves(world, after)
    assert (far > 0).sum() == 3
    assert (far[far > 0] >= 24 * INCH_M).all()
    plans = [piece.plan for piece in after.furniture]
    for k, plan in enumerate(plans):
        assert any(inside(room.polygon, plan).all() for room in world.arena.rooms)
        assert not any(touching(plan, other) for other in plans[:k])
    for plan, distance in zip(plans, far, strict=True):
        if distance > 0:
            assert not any(touching(plan, gap) for gap in door_middles(world.arena))


def test_map_boxes_and_faces_follow_and_nodes_stay(world):
    after = move_things(world, 2, 1)
    for piece, obstacle in zip(after.furniture, after.arena.obstacles, strict=True):
        assert np.array_equal(piece.plan, obstacle.polygon)
    assert np.array_equal(after.nodes, world.nodes)
    for before, piece in zip(world.furniture, after.furniture, strict=True):
        centers = [p.mean(axis=0) for p in (before.plan, piece.plan)]
        for old, new in zip(before.boxes, piece.boxes, strict=True):
            reach = [
                np.linalg.norm(np.array(b.center[:2]) - c) for b, c in zip((old, new), centers, strict=True)
            ]
            assert reach[0] == pytest.approx(reach[1])
        for a, b in zip(before.faces, piece.faces, strict=True):
            assert a.normal[2] == pytest.approx(b.normal[2])
            assert a.albedo is b.albedo


def test_the_seed_decides_and_limits_are_kept(world):
    first, again, other = (move_things(world, 2, seed) for seed in (5, 5, 6))
    assert np.array_equal(moves(world, first), moves(world, again))
    assert not np.array_equal(moves(world, first), moves(world, other))
    assert (moves(world, move_things(world, 0, 1)) == 0).all()
    with pytest.raises(InputError, match="8 pieces of furniture, fewer than the 9 to move"):
        move_things(world, 9, 0)
    (gap,) = door_middles(world.arena)
    assert inside(gap, np.array([[107, 71.0]]) * INCH_M)[0]
