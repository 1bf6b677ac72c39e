"""Fixtures of the tests of localization: a small world, made once."""

from __future__ import annotations

import pytest

from helpers.filter_world import World, make_world


@pytest.fixture(scope="session")
def world() -> World:
    return make_world()


@pytest.fixture(scope="session")
def world_at():
    """The same world anywhere: `world_at((500_000.0, 0.0))`."""
    return make_world
