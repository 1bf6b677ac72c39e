"""What features and updates cost: one process, works in turn, medians; the thesis's figures 70 to 72.

Trust the ratios: another machine changes the seconds and leaves most ratios as they are.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
import polars as pl

from maurice_datasets.trials.drives import Drive, open_drive
from maurice_datasets.trials.plan import SessionSpec
from maurice_loaders.files.writing import write_whole
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.arrays import F64

FILE = "timing.parquet"
PARTICLES = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 60_000)
FEATURES = ("color", "edges", "blended", "best")
SPEC = SessionSpec("timing", task="global", updates=6, arenas=20)
DRIVES = 8  # whose first picture is timed, each in an arena of its own
DESCRIBE, COMPARE, UPDATE = "describe", "compare", "update"
Work = Callable[[], object]


def in_turn(works: Mapping[str, Work], rounds: int) -> dict[str, F64]:
    """Run each work once a round, the works in turn; return the CPU seconds (rounds,) of each."""
    took: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        work()  # fills the caches
    for _ in range(rounds):
        for name, work in works.items():
            began = process_time()
            work()
            took[name].append(process_time() - began)
    return {name: np.array(seconds) for name, seconds in took.items()}


def measure(folder: Path, rounds: int, drives: int = DRIVES) -> pl.DataFrame:
    """Measure everything and write it as the folder's timing.parquet; see `read_timing` for its columns."""
    cv2.setNumThreads(1)
    rows = _features(open_drive(SPEC, 0), rounds)
    for number in range(drives):
        rows += [row | {"drive": number} for row in _updates(open_drive(SPEC, number), rounds)]
    frame, packed = pl.DataFrame(rows), io.BytesIO()
    frame.write_parquet(packed)
    write_whole(folder / FILE, packed.getvalue(), force=True)
    return frame


def _features(drive: Drive, rounds: int) -> list[dict[str, Any]]:
    """Time describing a picture and comparing it with the library, channel by channel."""
    image = next(iter(drive.session.moments())).frame.image
    library = drive.bench.library
    describe: dict[str, Work] = {}
    compare: dict[str, Work] = {}
    for name in CHANNELS:
        if name in library.index:
            sensor = drive.bench.localizer({"feature": name}).sensor
            describe[name] = partial(CHANNELS[name].describe, image)
            compare[name] = partial(sensor.compare, sensor.measure(image))
    rows: list[dict[str, Any]] = []
    for what, works in ((DESCRIBE, describe), (COMPARE, compare)):
        took = in_turn(works, rounds)
        rows += [_row(what, name, None, seconds, took["color"]) for name, seconds in took.items()]
    return rows


def _updates(drive: Drive, rounds: int) -> list[dict[str, Any]]:
    """Time one update, from picture to belief, over particles and features."""
    frame = next(iter(drive.session.moments())).frame
    works: dict[str, Work] = {}
    for feature in FEATURES:
        for particles in PARTICLES:
            settings = {"feature": feature, "particles": particles}
            localizer = drive.bench.localizer(settings).of_session(drive.session)
            works[f"{feature} {particles}"] = partial(localizer.step, localizer.initialize(None), frame)
    took = in_turn(works, rounds)
    named = [(feature, particles) for feature in FEATURES for particles in PARTICLES]
    return [
        _row(UPDATE, feature, particles, took[f"{feature} {particles}"], took[f"color {particles}"])
        for feature, particles in named
    ]


def _row(what: str, feature: str, particles: int | None, seconds: F64, color: F64) -> dict[str, Any]:
    low, median, high = np.percentile(seconds, (10, 50, 90))
    over = np.percentile(seconds / color, (10, 50, 90))
    return {
        "what": what,
        "feature": feature,
        "particles": particles,
        "drive": 0,
        "median_s": float(median),
        "low_s": float(low),
        "high_s": float(high),
        "of_color": float(over[1]),
        "of_color_low": float(over[0]),
        "of_color_high": float(over[2]),
    }


def read_timing(folder: Path) -> pl.DataFrame | None:
    """Return what `measure` found for a folder of trials; None where nothing was measured.

    Columns: `what` (describe, compare, update), `feature`, `particles` and `drive` (of an update), seconds as
    median and 10 to 90 percent of the rounds, and the ratio to color, round by round.
    """
    return pl.read_parquet(folder / FILE) if (folder / FILE).is_file() else None
