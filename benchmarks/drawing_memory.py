"""Memory over a long session: megabytes held after every thousand fully drawn updates.

    .venv/bin/python benchmarks/drawing_memory.py [UPDATES]

The demo's first hundred updates are drawn again and again under growing numbers, with a thousand particles.
Caches of reference pictures fill first; after that the figures must stay where they are. The recording
grows to about 90 kB per update in the temporary folder, and is removed.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.sessions import demo_paths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.observer import RerunObserver
from maurice_viz.scene import RunView, SceneInfo
from maurice_viz.style import scale_for
from maurice_viz.viewer import sinks

EVERY, STEPS, PARTICLES = 1000, 100, 1000


def held_mb() -> float:
    """Return what this process holds in memory (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Draw, and print."""
    cv2.setNumThreads(1)
    updates = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    paths = demo_paths()
    library, session = ml.build_library(paths.survey), ml.open_session(paths.session)
    localizer = mcl.make_localizer(library, feature="blended", particles=PARTICLES)
    pairs = [pair for pair, _ in zip(mcl.run(localizer, session, None), range(STEPS), strict=False)]
    distances = localizer.sensor.distances
    shown = SceneInfo(library.arena, scale_for(library.display_units, library.arena), True)
    layout = runs_blueprint([RunView("blended", tuple(distances))], shown)
    with (
        tempfile.TemporaryDirectory() as folder,
        sinks.to_file(Path(folder) / "long.rrd", "long", layout) as rec,
    ):
        observer = RerunObserver(rec, "blended", distances, sensor=localizer.sensor)
        observer.begin(session.info, library)
        for number in range(1, updates + 1):
            moment, record = pairs[(number - 1) % STEPS]
            frame = replace(moment.frame, step=number, time_s=float(number))
            observer.see(replace(moment, frame=frame), replace(record, frame=frame))
            if number % EVERY == 0:
                print(f"after {number:6} updates: {held_mb():6.0f} MB", flush=True)
        observer.end()


if __name__ == "__main__":
    main()
