"""What drawing adds to an update: milliseconds of CPU and kilobytes, of all panels and of each alone.

A drive is localized first, then drawn from memory. It is drawn twice: the first time reads the pictures of
references, the second time, which counts, has them, as a long session would. Python's collector runs as
seldom as in a command.
"""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import process_time

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo
from maurice_viz.cli.main import COLLECT_AFTER
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.panel import Panel
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import Detail, RunView, Scene
from maurice_viz.viewer import sinks

from .measure import Table

UPDATES = 100
PARTICLES = 5000
BARE = "events and modes, before any panel"
LEAST = 0.05  # milliseconds, or kilobytes: panels below are not listed

Cost = tuple[float, float]  # milliseconds of CPU and kilobytes an update
Chosen = Callable[[Panel], bool]


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive that was localized."""

    session: mcl.Session
    library: mcl.Library
    localizer: Localizer
    updates: Sequence[tuple[Moment, StepRecord]]


@cache
def drive_of(updates: int) -> Drive:
    """Localize the demo's drive."""
    paths = demo_paths()
    library, session = ml.build_library(paths.survey), ml.open_session(paths.session)
    localizer = mcl.make_localizer(library, feature="blended", particles=PARTICLES)
    pairs = [pair for pair, _ in zip(mcl.run(localizer, session, None), range(updates), strict=False)]
    return Drive(session, library, localizer, pairs)


def recordings(quick: bool) -> Table:
    """Measure every detail, into a file and live."""
    gc.set_threshold(*COLLECT_AFTER)
    drive, rows = drive_of(20 if quick else UPDATES), []
    for detail in Detail:
        for way in ("file", "live"):
            milliseconds, kilobytes = _least(drive, detail, lambda _: True, quick, live=way == "live")
            rows.append([detail.value, way, f"{milliseconds:.2f}", f"{kilobytes:.0f}"])
    return Table(
        "recordings",
        "What recording adds to an update at 5,000 particles, two channels, CPU of all threads",
        ["detail", "to", "milliseconds of CPU", "kilobytes"],
        rows,
    )


def panels(quick: bool) -> Table:
    """Measure each panel alone, into a file, with what sending its rows costs."""
    gc.set_threshold(*COLLECT_AFTER)
    drive = drive_of(20 if quick else UPDATES)
    costs: dict[str, list[Cost]] = {name: [] for name in (BARE, *_names(drive))}
    for detail in (Detail.FULL, Detail.LIGHT):
        bare = _least(drive, detail, lambda _: False, quick)
        costs[BARE].append(bare)
        for name in list(costs)[1:]:
            took, memory = _least(drive, detail, _is(name), quick)
            costs[name].append((max(took - bare[0], 0.0), max(memory - bare[1], 0.0)))
    listed = [name for name, (full, light) in costs.items() if max(*full, *light) >= LEAST]
    listed.sort(key=lambda name: -costs[name][0][0])
    return Table(
        "panels",
        "What each panel adds to an update, into a file",
        ["panel", "full, ms of CPU", "full, kB", "light, ms of CPU", "light, kB"],
        [[name, *(f"{part:.2f}" for cost in costs[name] for part in cost)] for name in listed],
    )


def _is(name: str) -> Chosen:
    return lambda panel: _name(panel) == name


def _name(panel: Panel) -> str:
    return type(panel).__name__.removesuffix("Panel")


def _names(drive: Drive) -> list[str]:
    view, scene = RunView.of("run", drive.localizer), scene_of(drive)
    return [_name(panel) for panel in RerunObserver(sinks.recording("names"), view, scene).panels]


def scene_of(drive: Drive) -> Scene:
    """Return what is drawn around it."""
    return Scene(SessionInfo("x", drive.library.display_units), drive.library, True)


def _least(drive: Drive, detail: Detail, chosen: Chosen, quick: bool, live: bool = False) -> Cost:
    """Return the least of some rounds: other work on the machine only adds to it."""
    rounds = [_measure(drive, detail, chosen, live) for _ in range(1 if quick else 5)]
    return min(took for took, _ in rounds), min(held for _, held in rounds)


def _measure(drive: Drive, detail: Detail, chosen: Chosen, live: bool = False) -> Cost:
    """Draw a drive with some panels; return what an update took and held the second time."""
    view, scene = RunView.of("run", drive.localizer), scene_of(drive)
    layout = runs_blueprint([view], scene)
    with tempfile.TemporaryDirectory() as folder:
        path, port = Path(folder) / "run.rrd", sinks.free_port() if live else None
        with sinks.to_file(path, "run", layout, serve=port) as rec:
            observer = RerunObserver(rec, view, scene, detail)
            observer.panels = [panel for panel in observer.panels if chosen(panel)]
            for again in (False, True):
                before, began = _held(folder), process_time()
                for moment, record in drive.updates:
                    observer.see(moment, record)
                rec.flush()
                if again:
                    took, memory = process_time() - began, _held(folder) - before
            observer.end()
    return took / len(drive.updates) * 1e3, memory / len(drive.updates) / 1e3


def _held(folder: str) -> int:
    return sum(file.stat().st_size for file in Path(folder).iterdir())
