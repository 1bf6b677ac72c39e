"""`maurice-replay what-if RUN --from STEP`: a saved run branched at a step, with something changed."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from ..layouts import DETAILS
from ..style import Scale, units_named
from ..text.verdict import verdict_line
from .replay import to_table
from .shared import options as opt
from .shared.console import TO_CONSOLE, listening, note, print_json, results
from .shared.options import option, output_of, settings_of

if TYPE_CHECKING:
    from ..app.remedies import Remedies
    from ..app.what_if import WhatIf

REMEDIES = "Remedies"


def what_if(
    run: opt.Run,
    from_step: Annotated[
        int | None,
        option(
            "--from",
            "Branch after this step; 0: from the start. [default: before the first loss]",
            metavar="STEP",
            min=0,
        ),
    ] = None,
    preset: opt.Preset = None,
    feature: opt.Feature = None,
    particles: opt.Particles = None,
    seed: Annotated[
        int | None,
        option(
            "--seed",
            "Other noise from the branch on. [default: the run's]",
            opt.FILTER,
            min=0,
            max=opt.MOST_SEED,
        ),
    ] = None,
    settings: opt.Set = None,
    anywhere: Annotated[
        bool,
        option("--anywhere", "Begin the branch with particles spread over all free space.", opt.FILTER),
    ] = False,
    remedy: Annotated[
        bool, option("--remedy", "Try the obvious changes, each with many seeds, and rank them.", REMEDIES)
    ] = False,
    seeds: Annotated[
        int, option("--seeds", "Seeds that each remedy is tried with.", REMEDIES, min=1, max=10_000)
    ] = 20,
    run_label: opt.RunLabel = None,
    rrd: opt.Rrd = None,
    web: opt.Web = False,
    layout: opt.Layout = None,
    detail: opt.Detail = DETAILS[0],
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Branch a saved run at a step with something changed, and show the branch beside the run.

    The branch draws the same random numbers as the run, so whatever differs comes from the change.
    """
    from ..app.what_if import what_if as branch
    from ..running.output import serving

    if remedy:
        if preset or feature or particles or seed is not None or settings or anywhere or rrd or web:
            raise typer.BadParameter("--remedy chooses what to change: give only --from, --seeds and --json")
        _remedies(run, from_step, seeds, run_label, json_output)
        return
    stem = run.absolute().name
    output = output_of(stem, rrd, None, layout or "compare", detail, web=web, force=force)
    with listening(usage=False) as listener, serving(output, listener):
        found = branch(
            run,
            from_step,
            preset=preset,
            feature=feature,
            particles=particles,
            seed=seed,
            settings=settings_of(settings),
            anywhere=anywhere,
            run_label=run_label,
            output=output,
            listener=listener,
        )
    TO_CONSOLE.end()
    if json_output:
        print_json(found.to_json())
    else:
        _print(found)


def _remedies(run: Path, from_step: int | None, seeds: int, run_label: str | None, json_output: bool) -> None:
    from ..app.remedies import remedies

    with listening(usage=False) as listener:
        found = remedies(run, from_step, seeds=seeds, run_label=run_label, listener=listener)
    if json_output:
        print_json(found.to_json())
        return
    results.print(Text(found.line, style="bold"))
    results.print(_remedy_table(found))
    best = found.proposed
    if best is not None:
        words = ["maurice-replay", "what-if", str(run), "--from", str(found.from_step), *best.change.options]
        note(f"see it beside the run: {shlex.join(words)}")


def _remedy_table(found: Remedies) -> Table:
    """Return a table of remedies, best first below the run as it was, in 80 columns."""
    units = units_named(found.display_units)
    seeds = f"{len(found.seeds)} seeds each; localized: at the end"
    title = Text(f"{found.name}, from step {found.from_step}, {seeds}")
    table = Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0)
    )
    table.add_column("from there on", overflow="fold")
    for name in ("localized", f"error ({units.name})"):
        table.add_column(f"{name}, 95 %", justify="right", no_wrap=True)
    table.add_column("against the run", no_wrap=True)
    for one in (found.as_it_was, *found.tried):
        share, error = one.localized, one.error_m
        cells = [f"{share.said(100, 0)} %", error.said(units.per_m, units.digits)]
        against = "" if one is found.as_it_was else one.verdict
        table.add_row(one.name, *cells, against, end_section=one is found.as_it_was)
    return table


def _print(found: WhatIf) -> None:
    """Print when the branch parts from the run, what happened to both, and their scores."""
    scores = found.scores
    units = units_named(scores.display_units)
    results.print(Text(found.line, style="bold"))
    results.print(Text(verdict_line({run.label: run.verdict for run in scores.runs}, Scale(units))))
    results.print(to_table(scores.runs, units, scores.name, results))
