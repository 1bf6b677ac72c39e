from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.values.map import Arena, Region, make_grid, open_arena

PLACES = np.array([[0.5, 0.5], [1.0, 0.5], [0.5, 1.0], [1.0, 1.0]])
NO_WALLS = np.zeros((0, 4))


def _square(name, low, high):
    return Region(name, np.array([[low, low], [high, low], [high, high], [low, high]], float))


def _at(grid, x, y):
    cell = grid.cells_of(np.array([[x, y]], np.float32), np.zeros(2))[0]
    return divmod(int(cell), grid.shape[1])


def test_cells_centers_and_borders_agree():
    grid = make_grid(Arena((-0.3, 0.1, 2.0, 1.7), NO_WALLS), PLACES)
    centers = grid.centers()
    for origin in (np.zeros(2), np.array([0.7, -0.2])):
        found = grid.cells_of((centers - origin).astype(np.float32), origin)
        assert np.array_equal(found, np.arange(len(centers)))
    assert grid.cell_m == pytest.approx(0.5 / 18)
    grid = make_grid(Arena((0.0, 0.0, 2.0, 1.5), NO_WALLS), PLACES)
    outside = np.array([[-0.5, 0.5], [2.5, 0.5], [0.5, -0.5], [0.5, 1.8], [-9e3, 9e3]], np.float32)
    assert np.all(grid.cells_of(outside, np.zeros(2)) == -1)
    assert grid.free.all()
    grid = make_grid(Arena((0.0, 0.0, 2.0, 1.5), NO_WALLS), PLACES)
    for border in (PLACES[:, 0], np.array([0.75])):
        steps = (border - grid.corner[0]) / grid.cell_m
        assert steps == pytest.approx(np.round(steps))


def test_floors_lie_on_top_of_each_other_in_their_order():
    floors = (_square("wood", 0, 2), _square("rug", 0.8, 1.2), _square("wood", 1.0, 1.1))
    grid = make_grid(Arena((0, 0, 3, 3), NO_WALLS, floors=floors), PLACES)
    assert grid.floors == ("", "wood", "rug")
    names = [grid.floors[grid.floor[_at(grid, xy, xy)]] for xy in (0.4, 0.9, 1.05, 2.5)]
    assert names == ["wood", "rug", "wood", ""]


def test_walls_and_obstacles_are_not_free():
    wall = np.array([[1.5, 0.0, 1.5, 1.0]])
    grid = make_grid(Arena((0, 0, 2, 1.5), wall, obstacles=(_square("box", 0.1, 0.3),)), PLACES)
    assert not grid.free[_at(grid, 0.2, 0.2)]
    assert grid.free[_at(grid, 0.4, 0.4)]
    assert grid.walled[_at(grid, 1.5001, 0.5)]
    assert not grid.free[_at(grid, 1.5001, 0.5)]
    assert grid.free[_at(grid, 1.5001, 1.2)]
    walls = np.array([[1.5, 0, 1.5, 1.5]])
    grid = make_grid(Arena((0, 0, 2, 1.5), walls), PLACES)
    assert not grid.free[_at(grid, 1.8, 0.7)]
    assert grid.free[_at(grid, 1.2, 0.7)]
    with_door = make_grid(Arena((0, 0, 2, 1.5), np.array([[1.5, 0, 1.5, 1.2]])), PLACES)
    assert with_door.free[_at(with_door, 1.8, 0.7)]


def test_every_cell_that_a_slanted_wall_runs_through_is_walled():
    wall = np.array([[0.2, 0.13, 1.87, 1.21]])
    grid = make_grid(Arena((0, 0, 2, 1.5), wall), PLACES)
    along = np.random.default_rng(0).random(5000)[:, None]
    points = (wall[0, :2] + along * (wall[0, 2:] - wall[0, :2])).astype(np.float32)
    walled = grid.walled.ravel()[grid.cells_of(points, np.zeros(2))]
    assert walled.mean() > 0.995, "all but the clipped tips of corners"


def test_odd_maps():
    grid = make_grid(open_arena(np.array([[3.0, 4.0, 0.0]])), np.array([[3.0, 4.0]]))
    assert grid.free.all()
    assert grid.cell_m == pytest.approx(0.0254)
    assert _at(grid, 3.01, 4.01) != (-1, -1)
    grid = make_grid(Arena((0, 0, 1000, 500), NO_WALLS), np.array([[1.0, 1.0], [1.1, 1.0]]))
    assert np.prod(grid.shape) < 1.1e6


@pytest.mark.parametrize(("apart_m", "margin_m"), [(0.1, 0.2), (0.4, 0.8), (0.7, 1.0), (5.0, 5.0)])
def test_without_a_map_the_bounds_stay_as_near_as_the_places_are_to_each_other(
    apart_m: float, margin_m: float
) -> None:
    places = apart_m * np.array([[0, 0, 0.0], [0, 0, 1.0], [1, 0, 0.0], [2, 0, 0.0]])
    low, high = -margin_m, margin_m
    assert open_arena(places).bounds == pytest.approx((low, low, 2 * apart_m + high, high))


@pytest.mark.parametrize("off_m", [(0, 0), (500_000, 5_400_000), (-3e6, 7e6)])
def test_depth_in_a_polygon_does_not_depend_on_where_the_map_lies(off_m):
    rng, off_m = np.random.default_rng(4), np.array(off_m)
    triangle = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    points = rng.uniform(-0.5, 2.0, (500, 2))
    x, y = points.T
    sides = np.stack([y, x, (2 - x - 2 * y) / np.sqrt(5)])  # inside: the distance to the nearest line
    depth = Region("rug", triangle + off_m).depth_m(points + off_m)
    inside = sides.min(axis=0) > 0
    assert depth[inside] == pytest.approx(sides.min(axis=0)[inside], abs=1e-6)
    assert (depth[~inside] <= 0).all()
    corner = (x < 0) & (y < 0)
    assert depth[corner] == pytest.approx(-np.hypot(*points[corner].T), abs=1e-6)
