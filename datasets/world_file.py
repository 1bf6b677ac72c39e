"""Worlds by name or from a TOML file."""

from __future__ import annotations

from .two_rooms import two_rooms
from .world import World


def load_world(name_or_path: str, seed: int, tier: str = "nominal") -> World:
    """Draw the world of a seed."""
    return two_rooms(seed)
