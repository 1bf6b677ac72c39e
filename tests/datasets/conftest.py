"""Worlds that several tests look at; made once."""

from __future__ import annotations

import pytest

from maurice_datasets.render.camera import LitScene
from maurice_datasets.render.light import bake
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import World


@pytest.fixture(scope="session")
def world() -> World:
    return load_world("two-rooms", 0)


@pytest.fixture(scope="session")
def scene(world: World) -> LitScene:
    return bake(world)
