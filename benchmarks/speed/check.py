"""A few ratios for CI: how many times sooner ours is than a stable yardstick that runs in turn with it.

    python -m benchmarks check

takes two to three minutes and fails where a ratio is less than half of what is expected. Times are those of
the processor, of this process and of those that it waits for, so that other work on the machine matters less;
a ratio that falls short is measured once more.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import rerun as rr

from maurice_datasets.demos import demo_paths
from maurice_mcl.sensor.distances import DISTANCES
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import Detail, RunView
from maurice_viz.viewer import sinks

from . import filter_step, many_runs, pictures, recording, replays
from .measure import Table, Work, interleaved

UPDATES = 40
LONG_ROUNDS = 12  # times the same updates are drawn into one recording
FALLS = 0.5  # of what is expected
FELL = "fell by half"


def filtering() -> float:
    """Compare a step of 5,000 particles with the same one as one writes it first."""
    world = filter_step.World.make()
    plain, ours = (make(world, 5000, "systematic") for make in (filter_step.naively, filter_step.ours))
    return _ratio(plain, ours, 60)


def comparing(name: str) -> float:
    """Compare a picture against 4,272 references with broadcasting in float64."""
    index = filter_step.random_index(np.random.default_rng(3), 4272, pictures.COMPARED[name])
    sample = index.references[300] + np.float32(0.25)
    plain = partial(pictures.broadcast, name, sample.astype(np.float64), index)
    return _ratio(plain, partial(DISTANCES[name], sample, index), 8)


def trials() -> float:
    """Compare sixteen runs of 500 particles as one array with two of them one by one, eight times."""
    alone, together = (
        partial(many_runs.one_by_one, "color", range(2)),
        partial(many_runs.together, "color", range(16)),
    )
    return 8 * _ratio(alone, together, 3)


def drawing(detail: Detail) -> float:
    """Compare drawing steps with logging clouds, a picture, three charts and twenty numbers one by one."""
    with tempfile.TemporaryDirectory() as folder, _observed(Path(folder), detail) as draw:
        plain = rr.RecordingStream("plain")
        plain.save(Path(folder) / "plain.rrd")
        return _ratio(partial(_draw_plainly, plain), draw, 4)


def long_drive() -> float:
    """Compare steps late in a long recording with early ones."""
    with tempfile.TemporaryDirectory() as folder, _observed(Path(folder), Detail.LIGHT) as draw:
        took = [_cpu_of(draw) for _ in range(LONG_ROUNDS)]
    third = LONG_ROUNDS // 3
    return min(took[:third]) / min(took[-third:])


def helping() -> float:
    """Compare `--help` with Python's own start."""
    return _ratio(partial(_python, "pass"), partial(replays.run, ["--help"]), 8)


def starting() -> float:
    """Compare a replay of the demo's drive into a file with importing what it cannot do without."""
    with tempfile.TemporaryDirectory() as folder:
        words = [str(demo_paths().session), "-o", f"{folder}/out.rrd", "--force"]
        plain = partial(_python, "import numpy, cv2, scipy.spatial, rerun.blueprint")
        return _ratio(plain, partial(replays.run, words), 4)


# what is compared: how, and the ratio on two shared cores of an x86-64
RATIOS: dict[str, tuple[Callable[[], float], float]] = {
    "filter step, 5,000 particles: naive float64 / ours": (filtering, 2.2),
    "4,272 references, hellinger: broadcasting / ours": (partial(comparing, "hellinger"), 22.0),
    "4,272 references, thesis: broadcasting / ours": (partial(comparing, "thesis"), 4.0),
    "16 runs of 500 particles: one by one / as one array": (trials, 4.2),
    "drawing a step in full: some of it call by call / ours": (partial(drawing, Detail.FULL), 0.4),
    "drawing a step, light: some of it call by call / ours": (partial(drawing, Detail.LIGHT), 1.2),
    "a long recording: an early step / a late one": (long_drive, 1.0),
    "--help: starting Python / ours": (helping, 0.4),
    "a replay into a file: importing numpy, scipy, Rerun / ours": (starting, 0.2),
}


def check(quick: bool) -> Table:
    """Measure all ratios, and mark those that fell; such a one is measured twice."""
    del quick  # it is short
    rows = []
    for name, (measure, expected) in RATIOS.items():
        value = measure()
        if value < FALLS * expected:
            value = max(value, measure())
        rows.append([name, f"{value:.2f}", f"{expected:.2f}", FELL if value < FALLS * expected else ""])
    return Table(
        "check", "How many times sooner than a yardstick", ["yardstick / ours", "now", "expected", ""], rows
    )


def _ratio(plain: Work, ours: Work, rounds: int) -> float:
    """Return how many times longer the yardstick takes; the first round of each is left out."""
    took = interleaved({"plain": partial(_cpu_of, plain), "ours": partial(_cpu_of, ours)}, rounds + 1)
    return min(took["plain"].seconds[1:]) / min(took["ours"].seconds[1:])


def _cpu_of(work: Work) -> float:
    """Return the seconds of the processor that a work took, with those of processes that it waited for."""

    def spent() -> float:
        usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(part.ru_utime + part.ru_stime for part in usage)

    began = spent()
    work()
    return spent() - began


def _python(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True)


@contextmanager
def _observed(folder: Path, detail: Detail) -> Iterator[Work]:
    """Open a recording; yield the work of drawing some updates of a drive into it, once drawn already."""
    drive = recording.drive_of(UPDATES)
    view, scene = RunView.of("run", drive.localizer), recording.scene_of(drive)
    with sinks.to_file(folder / "ours.rrd", "ours", runs_blueprint([view], scene)) as rec:
        observer = RerunObserver(rec, view, scene, detail)

        def draw() -> None:
            for moment, record in drive.updates:
                observer.see(moment, record)
            rec.flush()

        draw()
        yield draw
        observer.end()


def _draw_plainly(rec: rr.RecordingStream) -> None:
    for step, (moment, record) in enumerate(recording.drive_of(UPDATES).updates):
        rec.set_time("step", sequence=step)
        for name, cloud in (("predicted", record.predicted), ("weighted", record.weighted)):
            colors = cv2.applyColorMap((255 * cloud.weights / cloud.weights.max()).astype(np.uint8), 16)[:, 0]
            rec.log(name, rr.Points2D(cloud.world_poses[:, :2], colors=colors))
        rec.log("camera", rr.Image(moment.frame.image).compress())
        for number in range(3):
            rec.log(f"chart/{number}", rr.BarChart(np.arange(84.0)))
        for number in range(20):
            rec.log(f"number/{number}", rr.Scalars(float(number)))
    rec.flush()
