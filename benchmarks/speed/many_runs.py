"""Runs a second, for trials: many seeds as one array or one by one, on one worker and on two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from multiprocessing import get_context
from typing import Any

import cv2

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.batch import compared_once, run_batch
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.records import Comparison

from .measure import Table, Times, Work, interleaved, ratio

UPDATES, PARTICLES = 60, 500
FILTERS: Mapping[str, Mapping[str, Any]] = {
    "color": {"feature": "color"},
    "best": {"feature": "best"},
    "thesis": {"preset": "thesis"},
}


@dataclass(frozen=True, slots=True, eq=False)
class ManyRuns:
    """One filter over the demo's drive, with comparisons made before."""

    localizer: Localizer
    moments: Sequence[mcl.Moment]
    comparisons: Sequence[Comparison]
    start: F64 | None

    @classmethod
    def of(cls, name: str) -> ManyRuns:
        """Open library and drive, and compare every picture."""
        cv2.setNumThreads(1)
        paths = demo_paths()
        library, session = ml.build_library(paths.survey), ml.open_session(paths.session)
        moments = [moment for moment, _ in zip(session.moments(), range(UPDATES), strict=False)]
        localizer = mcl.make_localizer(library, particles=PARTICLES, **FILTERS[name]).of_session(session)
        return cls(localizer, moments, compared_once(localizer.sensor, moments), session.info.start)


many_runs = cache(ManyRuns.of)  # once in every process


def together(name: str, seeds: Sequence[int]) -> None:
    """Run all seeds as one array."""
    many = many_runs(name)
    run_batch(many.localizer, many.moments, seeds, many.start, many.comparisons)


def one_by_one(name: str, seeds: Sequence[int]) -> None:
    """Run every seed by the filter itself."""
    many = many_runs(name)
    for seed in seeds:
        localizer = replace(many.localizer, seed=seed)
        state = localizer.initialize(many.start)
        for moment, comparison in zip(many.moments, many.comparisons, strict=True):
            state, _ = localizer.step(state, moment.frame, Compared(comparison, 0.0))


def runs_a_second(quick: bool) -> Table:
    """Measure the same seeds by one worker and by two, in turn; one by one, an eighth of them."""
    runs, rounds, rows = (16, 2, []) if quick else (64, 3, list[list[str]]())
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:

        def by_two(name: str) -> None:
            list(pool.map(partial(together, name), [range(runs // 2), range(runs // 2, runs)]))

        for name in FILTERS:
            works: dict[str, Work] = {
                "together": partial(together, name, range(runs)),
                "two": partial(by_two, name),
                "alone": partial(one_by_one, name, range(runs // 8)),
            }
            interleaved(works, 2)  # opens the library in every process
            took = interleaved(works, rounds)
            alone = Times(tuple(seconds * 8 for seconds in took["alone"].seconds))
            speeds = [f"{runs / times.median:.0f}" for times in (alone, took["together"], took["two"])]
            rows.append([name, *speeds, ratio(alone, took["together"])])
    return Table(
        "trials",
        f"Runs a second: {UPDATES} updates, {PARTICLES} particles, from comparisons made before",
        ["filter", "one by one", "as one array", "by two workers", "array / one by one"],
        rows,
    )
