"""What recording costs: milliseconds and kilobytes per step, per run, every panel on.

    .venv/bin/python benchmarks/recording.py [PARTICLES [DETAIL]]

The embedded session is localized first, then drawn from memory, so that only drawing is timed. The first
pass reads the reference pictures; the second has them, as a long session would.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import perf_counter, thread_time

import cv2
import numpy as np
from rerun.chunk import RrdReader

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.observer import Detail, RerunObserver
from maurice_viz.scene import RunView, SceneInfo
from maurice_viz.style import scale_for
from maurice_viz.viewer import sinks

GOAL_MS, GOAL_KB = 1.0, 100
STEPS = 100


def measure(
    library: mcl.Library, session: mcl.Session, feature: str, particles: int, detail: Detail, path: Path
) -> None:
    localizer = mcl.make_localizer(library, feature=feature, particles=particles)
    pairs = [pair for pair, _ in zip(mcl.run(localizer, session, None), range(STEPS), strict=False)]
    distances = localizer.sensor.distances
    shown = SceneInfo(library.arena, scale_for(library.display_units, library.arena), True)
    layout = runs_blueprint([RunView(feature, tuple(distances))], shown)
    with sinks.to_file(path, feature, layout, force=True) as rec:
        observer = RerunObserver(rec, feature, distances, detail=detail, sensor=localizer.sensor)
        observer.begin(session.info, library)
        for name in ("first pass", "second pass"):
            took, worked = [], []
            for moment, record in pairs:
                began, before = perf_counter(), thread_time()
                observer.see(moment, record)
                took.append((perf_counter() - began) * 1000)
                worked.append((thread_time() - before) * 1000)
            times = f"median {np.median(took):.2f} ms, of its own thread's work {np.median(worked):.2f} ms"
            print(f"{feature:8} {name:12} {times}")
        observer.end()
    size = path.stat().st_size / len(pairs) / 2000
    print(f"{feature:8} {size:.0f} kB per step (goals {GOAL_MS} ms, {GOAL_KB} kB)")
    sizes(path, 2 * len(pairs))


def sizes(path: Path, steps: int) -> None:
    """Print which entities take most room, in kB per step before compression."""
    room: Counter[str] = Counter()
    for chunk in RrdReader(path).stream():
        if not chunk.is_static:
            room[chunk.entity_path] += chunk.to_record_batch().nbytes
    for entity, held in room.most_common(12):
        print(f"  {held / steps / 1000:6.1f} kB {entity}")


def main() -> None:
    cv2.setNumThreads(1)
    particles = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    detail = Detail(sys.argv[2]) if len(sys.argv) > 2 else Detail.FULL
    paths = demo_paths()
    library = ml.build_library(paths.survey)
    session = ml.open_session(paths.session)
    with tempfile.TemporaryDirectory() as folder:
        for feature in ("color", "blended"):
            measure(library, session, feature, particles, detail, Path(folder) / f"{feature}.rrd")


if __name__ == "__main__":
    main()
