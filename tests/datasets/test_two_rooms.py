from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.layouts import LAYOUTS, Layout, stand_aside, stand_for
from maurice_datasets.solids import Solid, footprint
from maurice_datasets.survey import reference_poses
from maurice_datasets.two_rooms import BOUNDS_M, free_nodes, grid_nodes, two_rooms, walls_m
from maurice_datasets.world import World, clearance, floor_at, inside
from maurice_mcl.arena import Arena, Region
from maurice_mcl.geometry import INCH_M

SEEDS = range(6)


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return [two_rooms(seed) for seed in SEEDS]


def test_ten_of_88_nodes_are_blocked_and_624_references_remain_for_every_seed(worlds: list[World]) -> None:
    assert len(grid_nodes()) == 88
    for world in worlds:
        nodes = free_nodes(world.arena)
        assert len(nodes) == 78, world.name
        assert len(reference_poses(nodes, 8)) == 624


def test_nodes_lie_at_8_and_18_more_inches_and_hold_the_one_the_thesis_names() -> None:
    inches = grid_nodes() / INCH_M
    assert np.allclose((inches - 8) / 18, np.rint((inches - 8) / 18))
    assert np.isclose(inches, [80, 8]).all(axis=1).any()  # figure 19


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("seed", range(20))
def test_every_layout_blocks_exactly_ten_nodes_whatever_is_drawn(layout: Layout, seed: int) -> None:
    rng = np.random.default_rng(seed)
    stands = [stand_for(place, rng) for place in layout.blocking] + [
        stand_aside(p, rng) for p in layout.asides
    ]
    plans = [
        footprint(Solid(s.x_in, s.y_in, 0, s.width_in, s.depth_in, 1, s.yaw_rad)) * INCH_M for s in stands
    ]
    arena = Arena(BOUNDS_M, walls_m(), tuple(Region("piece", plan) for plan in plans))
    assert len(free_nodes(arena)) == 78
    for k, plan in enumerate(plans):
        assert (plan >= 0).all()
        assert (plan <= BOUNDS_M[2:]).all()
        assert not any(inside(plan, other).any() for j, other in enumerate(plans) if j != k)


def test_a_node_is_well_in_the_open_or_well_blocked(worlds: list[World]) -> None:
    for world in worlds:
        room = clearance(world.arena, grid_nodes()) / INCH_M
        assert ((room > 3.5) | (room < 1)).all(), world.name


def test_the_map_is_17_by_13_feet_with_wood_and_carpet_and_two_rooms(world: World) -> None:
    assert world.arena.size_m == pytest.approx((17 * 12 * INCH_M, 13 * 12 * INCH_M))
    assert {floor.name for floor in world.arena.floors} == {"wood", "carpet"}
    assert len(world.arena.rooms) == 2
    names = [floor_at(world.arena, x, y) for x, y in free_nodes(world.arena)]
    assert min(names.count("wood"), names.count("carpet")) > 15


def test_the_door_can_be_driven_through_and_the_divider_cannot(world: World) -> None:
    x = 107 * INCH_M
    gap, solid = np.array([[x, 71 * INCH_M]]), np.array([[x, 30 * INCH_M]])
    assert clearance(world.arena, gap)[0] > 12 * INCH_M
    assert clearance(world.arena, solid)[0] == pytest.approx(0)


def test_the_same_seed_gives_the_same_world_and_another_another(world: World) -> None:
    again, other = two_rooms(0), two_rooms(1)
    assert len(again.faces) == len(world.faces)
    for a, b in zip(again.faces, world.faces, strict=True):
        assert np.array_equal(a.albedo, b.albedo)
        assert np.array_equal(a.corner, b.corner)
    assert not np.array_equal(other.faces[0].albedo, world.faces[0].albedo)


def test_surfaces_give_back_no_more_light_than_they_get(world: World) -> None:
    for face in world.faces:
        assert face.albedo.dtype == np.float32
        assert float(face.albedo.min()) > 0
        assert float(face.albedo.max()) <= 1
