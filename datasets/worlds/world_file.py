"""Worlds by name or from a TOML file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from maurice_loaders.errors import InputError

from ..tasks import TIERS
from .build import build_world
from .plan import WorldPlan
from .read_plan import read_plan
from .world import World


def shipped_worlds() -> dict[str, Path]:
    """Give the worlds that ship, by name."""
    folder = Path(str(files("maurice_datasets.worlds")))
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


def load_plan(name_or_path: str | Path) -> WorldPlan:
    """Read a shipped world by its name, or a TOML file by its path; InputError names what is wrong."""
    known = shipped_worlds()
    if str(name_or_path) in known:
        return read_plan(known[str(name_or_path)])
    path = Path(name_or_path)
    if not path.is_file():
        raise InputError(
            path, f"there is no world or file of that name; there are {', '.join(known)}, or FILE.toml"
        )
    return read_plan(path)


def load_world(name_or_path: str | Path, seed: int = 0, tier: str = "nominal") -> World:
    """Return a simulated world: a shipped one by name, or one from a TOML file, as a seed draws it in a tier.

    Lengths in meters, angles in radians. Raises InputError where name, file or tier is wrong.

    >>> world = load_world("two-rooms", seed=0)
    >>> world.arena.bounds
    """
    return build_world(load_plan(name_or_path), seed, TIERS[check_tier(name_or_path, tier)])


def check_tier(name_or_path: str | Path, tier: str) -> str:
    """Give the name of a tier back; InputError where there is none of that name."""
    if tier not in TIERS:
        raise InputError(Path(name_or_path), f"found no tier {tier!r}; there are {', '.join(TIERS)}")
    return tier
