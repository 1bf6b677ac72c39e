"""The demo's drives, from the user's cache. The simulator is imported only when they are not there."""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.values import NamedProgress

from .folders import SimulationPaths, cached, paths_in
from .tasks import (
    DEMO,
    KIDNAPPING_SEED,
    KIDNAPPING_UPDATES,
    LASER_SEED,
    LASER_UPDATES,
    UPDATES,
    simulation_key,
)


def demo_paths(seed: int = DEMO, progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo from the user's cache (MAURICE_CACHE names another place), made when absent."""
    return _paths(simulation_key("tracking", seed, seed, UPDATES), progress, "demo_plan", seed)


def kidnapping_paths(progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo's kidnapped drive from the user's cache, made when absent."""
    key = simulation_key("kidnapped", DEMO, KIDNAPPING_SEED, KIDNAPPING_UPDATES)
    return _paths(key, progress, "kidnapping_plan")


def laser_paths(progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo of a robot with a laser, carried away in an office, from the user's cache."""
    key = simulation_key("kidnapped", DEMO, LASER_SEED, LASER_UPDATES, laser=True)
    return _paths(key, progress, "laser_plan")


def _paths(key: str, progress: NamedProgress | None, plan: str, *seed: int) -> SimulationPaths:
    def make(folder: Path) -> None:
        from . import sessions

        sessions.write_simulation(folder, getattr(sessions, plan)(*seed), progress=progress)

    return paths_in(cached("demos", key, make))
