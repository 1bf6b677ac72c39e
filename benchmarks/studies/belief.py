"""Calibration of belief on healthy drives: how often a cloud's regions hold the truth, by sharpness.

Drives of position tracking of 120 updates in `two-rooms`. TO_FIT are fitting seeds, tiers nominal and hard:
there the sharpness is chosen (--fit). TO_JUDGE are test seeds, nominal, in six arenas: nothing was tuned on
them. Intervals are over arenas, as updates of one drive are alike, and drives in one arena. A run that was
lost is left out and counted: its regions cannot hold the truth.

Run: make studies STUDIES=belief (drives and runs are kept, so it goes on where it stopped; a quarter of
an hour the first time).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_datasets.trials.drives import Drive, filter_for
from maurice_datasets.trials.statistics import Clusters, mean
from maurice_loaders.files.writing import cache_root
from maurice_mcl.fitting.belief import FIRST_UPDATE, LEVELS, judge_belief
from maurice_mcl.scoring.batch import compared_once
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.records import Comparison

from .lost_drives import FILTERS, FITTED, UNSEEN, Course, drive_of, put_arrays
from .lost_signal import said

SHARPNESS = (0.25, 0.35, 0.5, 0.7, 1.0, 1.4)  # of `best`, tried on the fitted drives
CHOSEN = 0.7  # by --fit, before any unseen drive was run with it
SEED = 1  # of the filter
MORE = [Course("two-rooms", "nominal", arena, number) for arena in (1000, 1004, 1008) for number in (0, 2)]
TO_FIT = [entry for entry in FITTED if entry.task == "tracking"]
TO_JUDGE = [entry for entry in UNSEEN if entry.task == "tracking" and entry.tier == "nominal"] + MORE

Judged = dict[str, F64]  # arrays (U,) of the updates that count, and whether the run was lost


def sharpened(comparison: Comparison, sharpness: float) -> Comparison:
    """Return a comparison that was made at sharpness 1 as at another: the log-likelihood times it."""
    factor = np.float32(sharpness)
    likelihood, virtual = factor * comparison.log_likelihood, factor * comparison.virtual
    return replace(comparison, log_likelihood=likelihood, virtual=virtual)


def judged_run(
    drive: Drive, settings: Mapping[str, Any], pictures: Sequence[Comparison], sharp: float
) -> Judged:
    """Run a filter over a drive, and judge the belief of every update."""
    localizer = filter_for(drive, settings, SEED)
    state, table, rows = localizer.initialize(drive.start), TableRows(), []
    for moment, picture in zip(drive.session.moments(), pictures, strict=True):
        state, record = localizer.step(state, moment.frame, Compared(sharpened(picture, sharp), 0.0))
        table.add(moment, record)
        if moment.truth is not None and record.frame.step >= FIRST_UPDATE:
            judged_belief = judge_belief(record, moment.truth)
            error_m = float(np.hypot(*(record.estimate.pose[:2] - moment.truth[:2])))
            rows.append([judged_belief.denser, judged_belief.squared_sd, judged_belief.nees, error_m])
    denser, squared_sd, nees, error = np.array(rows).T
    lost = np.full(len(rows), float(score_table(table.table()).lost is True))
    return {"denser": denser, "squared_sd": squared_sd, "nees": nees, "error_m": error, "lost": lost}


def judged(
    courses: Sequence[Course], asked: Sequence[tuple[str, float]], folder: Path
) -> Iterator[dict[tuple[str, float], Judged]]:
    """Yield for each drive what was found under every (filter, sharpness); those kept are not run again."""
    folder.mkdir(parents=True, exist_ok=True)
    for course in courses:
        files = {key: folder / f"{course.name}-{key[0]}-{key[1]:g}.belief.npz" for key in asked}
        missing = [key for key, file in files.items() if not file.exists()]
        if missing:
            drive, pictures = drive_of(course, folder), dict[str, tuple[Comparison, ...]]()
            for name, sharp in missing:
                sensor = filter_for(drive, FILTERS[name], SEED).sensor
                shared = repr(sensor.parameters)
                if shared not in pictures:
                    pictures[shared] = compared_once(sensor, list(drive.session.moments()))
                put_arrays(files[name, sharp], judged_run(drive, FILTERS[name], pictures[shared], sharp))
            print(f"{course.name} done", flush=True)
        yield {key: _read(file, course.arena) for key, file in files.items()}


def _read(file: Path, arena: int) -> Judged:
    with np.load(file) as held:
        return {name: held[name] for name in held} | {"arena": np.full(len(held["nees"]), float(arena))}


def row(name: str, runs: Sequence[Judged]) -> str:
    """Return one line of the table, over the healthy runs."""
    healthy = [run for run in runs if not run["lost"].any()]
    if not healthy:
        return f"| {name} | 0 of {len(runs)} |{' - |' * (len(TITLES) - 1)}"
    sizes = [len(run["nees"]) for run in healthy]
    arenas, drives = (
        np.repeat([run["arena"][0] for run in healthy], sizes),
        np.repeat(range(len(sizes)), sizes),
    )
    clusters = Clusters.of(arenas, drives, drives)
    every = {key: np.concatenate([run[key] for run in healthy]) for key in healthy[0]}
    cells = [said(mean((every["denser"] <= level).astype(float), clusters)) for level in LEVELS]
    nees, error = mean(every["nees"], clusters), mean(100 * every["error_m"], clusters)
    cells += [f"{entry.value:.1f} [{entry.low:.1f}, {entry.high:.1f}]" for entry in (nees, error)]
    return f"| {name} | {len(healthy)} of {len(runs)} | {' | '.join(cells)} |"


TITLES = "healthy runs", *(f"{100 * level:.0f} % region, %" for level in LEVELS), "NEES", "mean error, cm"


def table(asked: Sequence[tuple[str, float]], found: Sequence[dict[tuple[str, float], Judged]]) -> str:
    """Return the table as Markdown."""
    lines = [f"| filter, sharpness | {' | '.join(TITLES)} |", f"|{'---|' * (len(TITLES) + 1)}"]
    lines += [row(f"`{key[0]}`, {key[1]:g}", [drive[key] for drive in found]) for key in asked]
    return "\n".join(lines)


def cost(
    entry: tuple[str, float], other: tuple[str, float], found: Sequence[dict[tuple[str, float], Judged]]
) -> str:
    """Return by how much a filter's mean error on a drive exceeds another's: paired, drives drawn."""
    differences = [
        100 * float(drive[entry]["error_m"].mean() - drive[other]["error_m"].mean()) for drive in found
    ]
    more = mean(np.array(differences), Clusters.of([drive[entry]["arena"][0] for drive in found]))
    change = f"{more.value:+.2f} cm [{more.low:+.2f}, {more.high:+.2f}]"
    return f"`{entry[0]}`, {entry[1]:g} less {other[1]:g}: mean error {change}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=cache_root() / "lost-signal")
    parser.add_argument("--fit", action="store_true", help="try every sharpness on the fitted drives")
    parser.add_argument(
        "--sharpness", type=float, default=CHOSEN, help="judged beside 1 on the unseen drives"
    )
    asked = parser.parse_args()
    if asked.fit:
        tried = [("best", sharp) for sharp in SHARPNESS]
        print(table(tried, list(judged(TO_FIT, tried, asked.folder))))
        return
    tried = [
        (name, sharp)
        for sharp in dict.fromkeys((1.0, asked.sharpness))
        for name in FILTERS
        if name != "thesis"
    ]
    results = list(judged(TO_JUDGE, [*tried, ("thesis", 1.0)], asked.folder))
    print(table([*tried, ("thesis", 1.0)], results))
    for name, sharp in tried:
        if sharp != 1.0:
            print(cost((name, sharp), (name, 1.0), results))


if __name__ == "__main__":
    main()
