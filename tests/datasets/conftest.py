"""Worlds that several tests look at; made once."""

from __future__ import annotations

import pytest

from maurice_datasets.light import Scene, bake
from maurice_datasets.two_rooms import two_rooms
from maurice_datasets.world import World


@pytest.fixture(scope="session")
def world() -> World:
    return two_rooms(0)


@pytest.fixture(scope="session")
def scene(world: World) -> Scene:
    return bake(world)
