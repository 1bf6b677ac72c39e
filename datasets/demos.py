"""The demo's drives, from the user's cache. The simulator is imported only when they are not there."""

from __future__ import annotations

from pathlib import Path

from maurice_mcl.values import NamedProgress

from .folders import SimulationPaths, cached, paths_in
from .tasks import DEMO, KIDNAPPING_SEED, KIDNAPPING_UPDATES, LASER_SEED, UPDATES, simulation_key


def demo_paths(seed: int = DEMO, progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo from the user's cache (MAURICE_CACHE names another place), made when absent."""

    def make(folder: Path) -> None:
        from .sessions import write_demo

        write_demo(folder, seed, progress=progress)

    return paths_in(cached("demos", simulation_key("tracking", seed, seed, UPDATES), make))


def kidnapping_paths(progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo's kidnapped drive from the user's cache, made when absent."""

    def make(folder: Path) -> None:
        from .sessions import kidnapping_plan, write_simulation

        write_simulation(folder, kidnapping_plan(), progress=progress)

    key = simulation_key("kidnapped", DEMO, KIDNAPPING_SEED, KIDNAPPING_UPDATES)
    return paths_in(cached("demos", key, make))


def laser_paths(progress: NamedProgress | None = None) -> SimulationPaths:
    """Return the demo of a robot with a laser, carried away in an office, from the user's cache."""

    def make(folder: Path) -> None:
        from .sessions import laser_plan, write_simulation

        write_simulation(folder, laser_plan(), progress=progress)

    return paths_in(cached("demos", simulation_key("laser-kidnapped", DEMO, LASER_SEED, UPDATES), make))
