"""How often "knows where it is" is right on real pictures, and the constants of a camera that was widened.

The drives are a user's own, each with truth and a library: SET=LIBRARY,DRIVE. Drives with one name are one
set: what is fitted on the others is judged on it. Each drive is run by three presets, from a known start and
from anywhere; odometry is made from the truth where there is none (two draws).

Run: python -m benchmarks.studies.real_belief kitchen=survey.csv,drive.csv ... [--seeds N]. It prints the
constants of WIDENED in mcl/reasons/second_opinion.py, and the table of docs/lost-signal.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path

import numpy as np

import maurice_mcl as mcl
from maurice_loaders import open_library, open_session
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.reasons.second_opinion import UNUSED, WIDENED, SecondOpinion, recalibrated
from maurice_mcl.scoring.metrics import score_step
from maurice_mcl.values.arrays import F64
from maurice_viz.running.filters import Filter
from maurice_viz.running.open import make_runs

PRESETS = ("robust", "precise", None)
BINS = (0.0, 0.1, 0.5, 0.9, 1.01)
PULL = 10.0  # steps that speak for keeping the log odds, as one of the fitted constants
STEPS_A_RUN = 60.0  # that each run counts as, however long it is


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A run of one filter over one drive of a set."""

    drives: str  # the name of the set
    widening: float
    raw: F64  # (U,) log odds by channels alone, before they are recalibrated
    said: F64  # (U,) the probability that it stated
    not_lost: F64  # (U,) 1 or 0, by the truth


def judge(name: str, library: Path, drive: Path, seeds: int) -> Iterator[Judged]:
    """Yield the runs of all presets over a drive."""
    for preset, start, seed in product(PRESETS, ("truth", "global"), range(seeds)):
        session = _session(drive, seed)
        (run,) = make_runs(session, open_library(library), [Filter(preset=preset, start=start)])
        opinion, rows = SecondOpinion.of(run.localizer.of_session(session)), list[tuple[float, ...]]()
        for moment, record in mcl.run(run.localizer, session, run.start):
            said, score = opinion.add(record), score_step(record.estimate, moment.truth)
            if said is not None and score.lost is not None:
                rows.append((opinion.raw, said, 1.0 - score.lost))
        if rows:
            yield Judged(name, run.localizer.sensor.parameters.widening, *np.array(rows).T)


def _session(drive: Path, seed: int) -> RecordedSession:
    session = open_session(drive)
    if session.odometry is not None:
        return session
    return open_session(drive, odometry_from_truth=True, odometry_seed=seed)


def fitted(runs: Sequence[Judged]) -> dict[str, float]:
    """Return the constants of WIDENED that describe best which steps of runs were not lost."""
    x = np.concatenate([_terms(run) for run in runs])
    y = np.concatenate([run.not_lost for run in runs])
    weight = np.concatenate([np.full(len(run.raw), STEPS_A_RUN / len(run.raw)) for run in runs])
    usual = np.array([0.0, 1.0, 0.0])
    found = usual.copy()
    for _ in range(100):
        p = 1 / (1 + np.exp(-np.clip(x @ found, -30, 30)))
        square = (x.T * (weight * p * (1 - p))) @ x + PULL * np.eye(3)
        step = np.linalg.solve(square, x.T @ (weight * (y - p)) - PULL * (found - usual))
        found = found + step / max(1.0, float(np.abs(step).max()))
    return dict(zip(WIDENED, found.round(2).tolist(), strict=True))


def _terms(run: Judged) -> F64:
    """Return what WIDENED weighs (U, 3), by its names."""
    one = np.ones(len(run.raw))
    return np.column_stack([one, run.raw, one * np.log(run.widening)])


def row(name: str, runs: Sequence[Judged], said: Sequence[F64]) -> str:
    """Return a line: of each bin of what was said how many steps, and how many of them were not lost."""
    p, right = np.concatenate(said), np.concatenate([run.not_lost for run in runs])
    inside = [(p >= low) & (p < high) for low, high in pairwise(BINS)]
    cells = [f"{100 * right[some].mean():.0f} of {some.sum()}" if some.any() else "-" for some in inside]
    return f"| {name} | {' | '.join(cells)} | {np.mean((p - right) ** 2):.3f} |"


def report(runs: Sequence[Judged]) -> Iterator[str]:
    """Yield the constants, and the table: not lost, % of so many steps, by what was said; Brier score."""
    widened = [run for run in runs if 1 < run.widening < UNUSED]
    yield f"WIDENED = {fitted(widened)}"
    for name in dict.fromkeys(run.drives for run in runs):
        here = [run for run in runs if run.drives == name]
        plain, own = [r for r in here if r.widening == 1], [r for r in widened if r.drives == name]
        others, muted = [r for r in widened if r.drives != name], [r for r in here if r.widening >= UNUSED]
        if plain:
            yield row(f"{name}, not widened", plain, [run.said for run in plain])
        if own:
            yield row(f"{name}, widened, as it was", own, [1 / (1 + np.exp(-run.raw)) for run in own])
        if own and others:
            weights = fitted(others)
            said = [np.array([recalibrated(v, run.widening, weights) for v in run.raw]) for run in own]
            yield row(f"{name}, widened, fitted on the others", own, said)
        if muted:
            yield row(f"{name}, not used", muted, [run.said for run in muted])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.real_belief", description=__doc__)
    parser.add_argument("drives", nargs="+", metavar="SET=LIBRARY,DRIVE")
    parser.add_argument("--seeds", type=int, default=2, help="draws of made odometry")
    asked, runs = parser.parse_args(), list[Judged]()
    for text in asked.drives:
        name, _, files = text.partition("=")
        library, _, drive = files.partition(",")
        runs += judge(name, Path(library), Path(drive), asked.seeds)
    for line in report(runs):
        print(line)


if __name__ == "__main__":
    main()
