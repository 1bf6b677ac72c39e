from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.surveys import reference_poses
from maurice_datasets.worlds.build import grid_nodes, load_plan, load_world
from maurice_datasets.worlds.world import World, clearance, floor_at, inside, touching
from maurice_mcl.values.geometry import INCH_M

SEEDS = range(6)
LIBRARY = load_plan("two-rooms").library


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return [load_world("two-rooms", seed) for seed in SEEDS]


def test_the_thesiss_nodes_remain_for_every_seed(worlds, world):
    for one in worlds:
        assert len(grid_nodes(LIBRARY, one.arena)) == 88
        assert len(one.nodes) == 78, one.name
        assert len(reference_poses(one.nodes, one.headings)) == 624
    inches = grid_nodes(LIBRARY, world.arena) / INCH_M
    assert np.allclose((inches - 8) / 18, np.rint((inches - 8) / 18))
    assert np.isclose(inches, [80, 8]).all(axis=1).any()  # figure 19


def test_the_seeds_draw_all_layouts_and_both_rooms_as_the_bright_one(worlds):
    layouts = {tuple(piece.name for piece in world.furniture) for world in worlds}
    assert len(layouts) > 2
    assert {s for world in worlds for s in world.sources if "window" in s} == {
        "west room window",
        "east room window",
    }
    for world in worlds:
        bright = max(world.room_lights, key=lambda light: light.ambient.sum())
        dim = sum(r.ambient.sum() for r in world.room_lights if r.room.name != bright.room.name)
        assert bright.ambient.sum() > 2 * dim


def test_furniture_stands_inside_and_nodes_are_clear(worlds):
    for world in worlds:
        plans = [piece.plan for piece in world.furniture]
        for k, plan in enumerate(plans):
            assert any(inside(room.polygon, plan).all() for room in world.arena.rooms)
            assert not any(touching(plan, other) for other in plans[:k])
        room = clearance(world.arena, grid_nodes(LIBRARY, world.arena)) / INCH_M
        assert ((room > 4.6) | (room < 1.5)).all(), world.name


def test_the_map_is_the_thesiss_and_the_door_is_open(world):
    assert world.arena.size_m == pytest.approx((17 * 12 * INCH_M, 13 * 12 * INCH_M))
    assert {floor.name for floor in world.arena.floors} == {"wood", "carpet"}
    assert len(world.arena.rooms) == 2
    names = [floor_at(world.arena, x, y) for x, y in world.nodes]
    assert min(names.count("wood"), names.count("carpet")) > 15
    x = 107 * INCH_M
    gap, solid = np.array([[x, 71 * INCH_M]]), np.array([[x, 30 * INCH_M]])
    assert clearance(world.arena, gap)[0] > 12 * INCH_M
    assert clearance(world.arena, solid)[0] == pytest.approx(2 * INCH_M)


def test_worlds_follow_their_seed_and_tier(world):
    again, other = load_world("two-rooms", 0), load_world("two-rooms", 1)
    assert len(again.faces) == len(world.faces)
    for a, b in zip(again.faces, world.faces, strict=True):
        assert np.array_equal(a.albedo, b.albedo)
        assert np.array_equal(a.corner, b.corner)
    assert not np.array_equal(other.faces[0].albedo, world.faces[0].albedo)
    dim, hard = (load_world("two-rooms", 0, tier) for tier in ("dim", "hard"))
    for other in (dim, hard):
        assert np.array_equal(other.nodes, world.nodes)
        assert [p.name for p in other.furniture] == [p.name for p in world.furniture]
        for a, b in zip(other.furniture, world.furniture, strict=True):
            assert np.array_equal(a.plan, b.plan)
    ratio = [a.color / b.color for a, b in zip(dim.lamps, world.lamps, strict=True)]
    assert np.allclose(ratio, 0.3)
    assert len(hard.shell) < len(world.shell) - 3


def test_surfaces_give_back_no_more_light_than_they_get(world):
    for face in world.faces:
        assert face.albedo.dtype == np.float32
        assert float(face.albedo.min()) > 0
        assert float(face.albedo.max()) <= 1
