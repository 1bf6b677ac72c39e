"""Whether time and memory a step stay what they are over a long session, and how they grow with a library.

    python -m benchmarks growth

The demo's first hundred updates are filtered again and again under growing numbers, alone, with a recording
(`--detail light`, then complete), and with random libraries of several sizes, each in a process of its own,
so that its memory is its own. Python's collector runs as seldom as in a command: values that refer to
themselves show up.
"""

from __future__ import annotations

import gc
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths, laser_paths
from maurice_loaders.libraries.files import save_library
from maurice_loaders.libraries.measured import SWITCH
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.values.session import Moment, SessionInfo
from maurice_viz.cli.main import COLLECT_AFTER
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.playback import FilterRun, ResultCollector, run_together
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import Detail, RunView, Scene
from maurice_viz.viewer import sinks

from .libraries import SIZES, random_library
from .measure import Table

ROUND, PARTICLES = 100, 1000
STEPS, QUICK = (120, 1200, 10_000), (120, 360)
ALONE = "filter alone"
DETAILS = {"with a recording, light": Detail.LIGHT, "with a recording, full": Detail.FULL}
LASER_RUN, LASER_STEPS = "laser and its scores", (120, 1200, 3600)
REFERENCES, LIBRARY_STEPS = "filter alone, {:,} references", 300
MB = 1e6 if sys.platform == "darwin" else 1e3  # of the unit in which the system tells memory


def growth(quick: bool) -> Table:
    """Measure milliseconds a step and megabytes at the most, by the number of steps."""
    demo_paths()
    rows = []
    for way in (ALONE, *DETAILS):
        rows += [_row(way, steps) for steps in (QUICK if quick else STEPS)]
    rows += [_row(LASER_RUN, steps) for steps in (QUICK if quick else LASER_STEPS)]
    with tempfile.TemporaryDirectory() as folder:
        for size in SIZES:
            save_library(random_library(size, Path(folder)), Path(folder) / str(size))
            steps = QUICK[0] if quick else LIBRARY_STEPS
            rows.append(_row(REFERENCES.format(size), steps, str(Path(folder) / str(size))))
    return Table(
        "growth",
        "Time and memory over a long session and over library sizes, blended, 1,000 particles",
        ["what", "steps", "milliseconds a step", "megabytes at the most"],
        rows,
    )


def _row(way: str, steps: int, *library: str) -> list[str]:
    words = [sys.executable, "-m", "benchmarks.speed.growth", way, str(steps), *library]
    words_out = subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()
    return [way, f"{steps:,}", f"{float(words_out[0]):.2f}", f"{float(words_out[1]):.0f}"]


def repeated(session: mcl.Session, steps: int) -> Iterator[Moment]:
    """Yield the first moments of a session again and again, under growing numbers."""
    some = list(islice(session.moments(), ROUND))
    for number, moment in enumerate(islice(cycle(some), steps), start=1):
        yield replace(moment, frame=replace(moment.frame, step=number, time_s=float(number)))


def one(way: str, steps: int, folder: str | None = None) -> tuple[float, float]:
    """Return the milliseconds a step and the megabytes of this process at the most.

    `folder` is a library instead of the demo's; the filter then starts anywhere.
    """
    paths = laser_paths() if way == LASER_RUN else demo_paths()
    library, session = ml.open_library(folder or paths.survey), ml.open_session(paths.session)
    chosen = {"preset": "laser"} if way == LASER_RUN else {"feature": "blended"}
    localizer = mcl.make_localizer(library, particles=PARTICLES, **chosen).of_session(session)
    run = FilterRun("run", localizer, None if folder else session.info.start)
    with ExitStack() as stack:
        drawn = _observer(stack, localizer, library, DETAILS[way]) if way in DETAILS else None
        scores = ResultCollector(["run"], library.arena, localizers={"run": localizer})
        began = perf_counter()
        for moment, records in run_together([run], repeated(session, steps)):
            if drawn is not None:
                drawn.see(moment, records["run"])
            if way == LASER_RUN:
                scores.add_steps({"run": (moment, records["run"])})
        took_s = perf_counter() - began
        if drawn is not None:
            drawn.end()
    return took_s / steps * 1e3, _peak_mb()


def _peak_mb() -> float:
    """Return the megabytes of this process at the most.

    Linux counts the process that started this one into `getrusage`, but not into its own list.
    """
    with suppress(OSError):
        peak = re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())
        if peak:
            return int(peak[1]) / 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MB


def _observer(stack: ExitStack, localizer: Localizer, library: mcl.Library, detail: Detail) -> RerunObserver:
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    scene = Scene(SessionInfo("x", library.display_units), library, True)
    view = RunView.of("run", localizer)
    layout = runs_blueprint([view], scene)
    rec = stack.enter_context(sinks.to_file(Path(folder) / "long.rrd", "long", layout))
    return RerunObserver(rec, view, scene, detail)


if __name__ == "__main__":
    gc.set_threshold(*COLLECT_AFTER)
    os.environ[SWITCH] = "0"  # every picture is measured, as in a live session
    print(*one(sys.argv[1], int(sys.argv[2]), *sys.argv[3:]))
