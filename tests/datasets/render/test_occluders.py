from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.camera import LitScene, joined, radiance
from maurice_datasets.render.camera_session import session_camera
from maurice_datasets.render.conditions import Conditions
from maurice_datasets.render.light import lighting_of, seen_past, unlit
from maurice_datasets.render.people import (
    FARTHEST_M,
    NEAREST_M,
    ROOM_M,
    StandingPerson,
    people,
    stands_at,
)
from maurice_datasets.worlds.world import Box, World, clearance
from maurice_mcl.values.map import Arena, crosses

OPEN = Arena((-9, -9, 9, 9), np.array([[-9.0, -9, 9, -9]]))
ORIGIN = np.zeros(3)
POSE = np.array([4.0, 2.0, np.pi])


def test_people_come_as_often_as_asked():
    frames = 2000
    share = np.mean([bool(stands_at(OPEN, ORIGIN, 7, k, 0.3)) for k in range(1, frames + 1)])
    assert abs(share - 0.3) < 4 * np.sqrt(0.3 * 0.7 / frames)
    assert not any(stands_at(OPEN, ORIGIN, 7, k, 0.0) for k in range(1, 100))
    turned = np.array([1.0, -2, 2.5])
    for k in range(1, 200):
        assert bool(stands_at(OPEN, ORIGIN, 7, k, 0.3)) == bool(stands_at(OPEN, turned, 7, k, 0.3))
    assert stands_at(OPEN, ORIGIN, 7, 1, 1.0) == stands_at(OPEN, ORIGIN, 7, 1, 1.0)
    assert stands_at(OPEN, ORIGIN, 7, 1, 1.0) != stands_at(OPEN, ORIGIN, 7, 2, 1.0)
    assert stands_at(OPEN, ORIGIN, 7, 1, 1.0) != stands_at(OPEN, ORIGIN, 8, 1, 1.0)


def test_people_stand_ahead_at_free_places_that_can_be_seen(world):
    rng = np.random.default_rng(2)
    found = 0
    for k in range(1, 150):
        pose = np.append(world.nodes[rng.integers(len(world.nodes))], rng.uniform(-np.pi, np.pi))
        for stand in stands_at(world.arena, pose, 7, k, 1.0):
            found += 1
            place = np.array([stand.x_m, stand.y_m])
            away = place - pose[:2]
            assert NEAREST_M <= np.linalg.norm(away) <= FARTHEST_M
            assert away @ [np.cos(pose[2]), np.sin(pose[2])] > 0.9 * np.linalg.norm(away)
            assert clearance(world.arena, place[None])[0] > ROOM_M
            walls = world.arena.walls
            assert not crosses(pose[None, :2], place[None], walls)[0]
    assert found > 75


def test_boxes_hide_what_is_behind():
    box = Box((1.0, 0.0, 0.0), (0.2, 0.5, 0.5), 0.3)
    targets = np.array([[2.0, 0, 0], [0.5, 0, 0], [0, 2.0, 0], [2, 0, 4.0], [-2.0, 0, 0]])
    assert seen_past(np.zeros(3), targets, (box,)).tolist() == [False, True, True, True, True]
    assert seen_past(np.zeros(3), targets, ()).all()


def person(world: World, stand: StandingPerson, dim: float = 1.0) -> LitScene:
    parts = lighting_of(world).parts
    return people(world, parts, np.full((len(parts), 3), dim), (stand,), 7)


def test_a_person_is_people_sized_and_lit_by_the_place(world):
    made = person(world, StandingPerson(3.0, 2.0, 0.7, 2))
    corners = np.concatenate([made.corner + a * made.across + b * made.down for a in (0, 1) for b in (0, 1)])
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert 1.5 < corners[:, 2].max() < 1.9
    assert np.abs(corners[:, :2] - [3.0, 2.0]).max() < 0.45
    stand = StandingPerson(3.0, 2.0, 0.7, 2)
    bright, dim = person(world, stand), person(world, stand, 0.25)
    assert bright.light is not None
    assert dim.light == pytest.approx(0.25 * bright.light, rel=1e-4)
    west, east = (np.mean(person(world, StandingPerson(x, 2.0, 0.0, 1)).light) for x in (1.2, 4.0))
    assert max(west, east) > 2 * min(west, east)  # one room is bright, the other dim


def test_furniture_in_front_hides_a_person(world):
    """What a picture with somebody in it differs in is hidden where something nearer stands."""
    ahead, beyond = (
        StandingPerson(3.0, 2.0, 0.0, 0),
        StandingPerson(-0.6, 2.0, 0.0, 0),
    )  # the second behind the outer wall
    scene = unlit(lighting_of(world))
    empty = radiance(scene, POSE)
    assert np.abs(radiance(joined(scene, person(world, ahead)), POSE) - empty).mean() > 1e-3
    assert np.array_equal(radiance(joined(scene, person(world, beyond)), POSE), empty)


def test_pictures_without_people_are_as_if_none_had_been_asked_for(world):
    some, none = session_camera(world, 3, Conditions(occluded=0.3)), session_camera(world, 3)
    seen = {bool(some.stands(k, POSE)) for k in range(1, 30)}
    assert seen == {True, False}
    for k in range(1, 9):
        off = np.abs(some.take(k, POSE).astype(int) - none.take(k, POSE)).mean()
        assert (off > 0.5) == bool(some.stands(k, POSE))
