"""How often the named cause of a laser's failure is right: planted causes (docs/laser.md).

    python -m benchmarks.studies.laser_causes -o out/laser-causes --write
    python -m benchmarks.studies.laser_causes --set develop --kinds mount --show    # while tuning

Nothing was tuned on the drives of the judged set. A planted run counts only where the cause did harm: the run
fails with it after it began, and by the truth. Healthy ones count where the run does not fail.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import joblib
import numpy as np

import maurice_mcl as mcl
from maurice_datasets.trials.drives import RenderedSession
from maurice_mcl.config.build import make_localizer
from maurice_mcl.reasons.causes import AMBIGUITY, Failure
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.values.library import Library

from .causes import (
    MARK_WITHOUT,
    Row,
    asked_of,
    first_of,
    jobs_of,
    keep,
    known,
    named,
    said,
    suspicions,
    table,
    write,
)
from .planted.drives import with_moments
from .planted.laser_ways import HEALTHY, LASER_WAYS, laser_ground
from .planted.places import SETS

DOCS = Path(__file__).parents[2] / "docs" / "laser.md"


def main() -> None:
    asked = asked_of("laser_causes", __doc__ or "", list(LASER_WAYS), "docs/laser.md")
    file = asked.output / f"{asked.set}{'-without-truth' if asked.without_truth else ''}.jsonl"
    if asked.anew and file.exists():
        file.unlink()
    rows = known(file)
    while jobs := jobs_of(rows, asked.kinds, asked.drives):
        run = joblib.delayed(diagnosed)
        parallel = joblib.Parallel(asked.jobs, return_as="generator_unordered", batch_size=1)
        for row in parallel(run(asked.set, kind, number, asked.without_truth) for kind, number in jobs):
            rows.append(row)
            keep(file, row)
            if asked.show:
                print(said(row), flush=True)
    chosen = [row for kind in asked.kinds for row in first_of(rows, kind, asked.drives)]
    left = sum(row["named"] is None for row in chosen)
    if asked.without_truth:
        text = "\n".join([*table(chosen), "", *suspicions(chosen)])
        print(text)
        if asked.write:
            write(text, DOCS, MARK_WITHOUT)
        return
    note = f"{left} more drives did not count: no loss came of the cause, or there was one without it, too."
    text = "\n".join([*table(chosen), "", note])
    print(text)
    if asked.write:
        write(text, DOCS)


def diagnosed(which: str, kind: str, number: int, without_truth: bool = False) -> Row:
    """Make one run and diagnose it; whether it counts the truth says."""
    world, arena = SETS[which].place_of(number)
    ground, seed = laser_ground(world, arena), SETS[which].first + number
    ways = LASER_WAYS[kind]
    way = ways[(number + number // len(SETS[which].places)) % len(ways)]
    planting = way(ground, seed, np.random.default_rng([seed, list(LASER_WAYS).index(kind)]))
    row: Row = {"planted": kind, "number": number, "world": Path(world).stem, "arena": arena, "discarded": 0}
    row |= {"way": planting.way, "since": planting.since}
    failures = failures_of(planting.session, planting.library, planting.settings, number)
    blind = failures
    if without_truth:
        blind = failures_of(_blind(planting.session), planting.library, planting.settings, number)
    if kind == HEALTHY:
        return row | named(blind)
    due = [failure for failure in failures if failure.episode.last >= planting.since]
    if not due or (kind != AMBIGUITY and failures_of(planting.plain, ground.library, planting.usual, number)):
        return row | {"named": None}  # it did no harm, or the filter fails also without it
    return row | named(blind if without_truth else due)


def _blind(session: RenderedSession) -> RenderedSession:
    """Return a drive without its true poses."""
    return with_moments(session, [replace(moment, truth=None) for moment in session.moments()])


def failures_of(
    session: RenderedSession, library: Library, settings: Mapping[str, Any], seed: int
) -> tuple[Failure, ...]:
    """Run AMCL with some settings, and say why it failed."""
    localizer = make_localizer(library, preset="amcl", settings=settings, seed=seed).of_session(session)
    builder = DiagnosisBuilder(localizer)
    for moment, record in mcl.run(localizer, session):
        builder.add(moment, record)
    return builder.result()


if __name__ == "__main__":
    main()
