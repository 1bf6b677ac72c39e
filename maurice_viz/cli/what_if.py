"""`maurice-replay what-if RUN --from STEP`: a saved run branched at a step, with something changed."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from ..style import Scale, units_named
from ..text.headline import headline
from .replay import to_table
from .shared import options as opt
from .shared.console import TO_CONSOLE, listening, note, print_json, results
from .shared.options import option

if TYPE_CHECKING:
    from ..app.remedies import Remedies
    from ..app.what_if import WhatIf

REMEDIES = "Remedies"


@dataclass(frozen=True, slots=True)
class ChangeSet:
    """What is different from the branch on; what is not given stays as it was in the run."""

    preset: opt.Preset = None
    feature: opt.Feature = None
    particles: opt.Particles = None
    seed: Annotated[
        int | None,
        option(
            "--seed",
            "Other noise from the branch on. [default: the run's]",
            opt.FILTER,
            min=0,
            max=opt.MOST_SEED,
        ),
    ] = None
    start: Annotated[
        str | None,
        option(
            "--start",
            "Begin the branch with particles spread over all free space. [default: where the run has them]",
            opt.FILTER,
            metavar="global",
            **opt.one_of(("global",), "start of a branch"),
        ),
    ] = None
    settings: opt.Set = None
    sensors: opt.Sensors = None

    def arguments(self) -> dict[str, Any]:
        """Return all of it as `maurice_viz.what_if` takes it."""
        return opt.arguments_of(self)


def what_if(
    run: opt.Run,
    change: ChangeSet,
    drawing: opt.DrawingSet,
    from_step: Annotated[
        int | None,
        option(
            "--from",
            "Branch after this step; 0: from the start. [default: before the first loss]",
            metavar="STEP",
            min=0,
        ),
    ] = None,
    remedy: Annotated[
        bool, option("--remedy", "Try the obvious changes, each with many seeds, and rank them.", REMEDIES)
    ] = False,
    seeds: Annotated[
        int, option("--seeds", "Seeds that each remedy is tried with.", REMEDIES, min=1, max=10_000)
    ] = 14,
    json_output: opt.Json = False,
) -> None:
    """Branch a saved run at a step with something changed, and show the branch beside the run.

    The branch draws the same random numbers as the run, so whatever differs comes from the change.
    """
    if remedy:
        if (change, drawing) != (ChangeSet(), opt.DrawingSet()):
            raise typer.BadParameter("--remedy chooses what to change: give only --from, --seeds and --json")
        _remedies(run, from_step, seeds, json_output)
        return
    from ..app.what_if import what_if as branch
    from ..running.output import serving

    drawing = replace(drawing, layout=drawing.layout or "compare")
    output = drawing.output(run.absolute().name)
    with listening(usage=False) as listener, serving(output, listener):
        compared = branch(run, from_step, **change.arguments(), output=output, listener=listener)
    TO_CONSOLE.end()
    if json_output:
        print_json(compared.to_json())
    else:
        _print(compared)


def _remedies(run: Path, from_step: int | None, seeds: int, json_output: bool) -> None:
    from ..app.remedies import remedies

    with listening(usage=False) as listener:
        ranking = remedies(run, from_step, seeds=seeds, listener=listener)
    if json_output:
        print_json(ranking.to_json())
        return
    results.say(ranking.line, style="bold")
    results.print(_remedy_table(ranking))
    best = ranking.proposed
    if best is not None:
        words = ["maurice-replay", "what-if", str(run), "--from", str(ranking.from_step)]
        note(f"see it beside the run: {shlex.join([*words, *best.change.options])}")


def _remedy_table(ranking: Remedies) -> Table:
    """Return a table of remedies, best first below the run as it was, in 80 columns."""
    units = units_named(ranking.display_units)
    seeds = f"{len(ranking.seeds)} seeds each; localized: at the end"
    title = Text(f"{ranking.name}, from step {ranking.from_step}, {seeds}")
    table = Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0)
    )
    table.add_column("from there on", overflow="fold")
    for name in ("localized", f"error ({units.name})"):
        table.add_column(f"{name}, 95 %", justify="right", no_wrap=True)
    table.add_column("against the run", no_wrap=True)
    for result in (ranking.as_it_was, *ranking.tried):
        share, error = result.localized, result.error_m
        cells = [f"{share.text(100, 0)} %", error.text(units.per_m, units.digits)]
        against = "" if result is ranking.as_it_was else result.verdict
        table.add_row(result.name, *cells, against, end_section=result is ranking.as_it_was)
    return table


def _print(compared: WhatIf) -> None:
    """Print when the branch parts from the run, what happened to both, and their scores."""
    scores = compared.scores
    units = units_named(scores.display_units)
    results.say(compared.line, style="bold")
    results.say(headline({run.label: run.verdict for run in scores.runs}, Scale(units)))
    results.print(to_table(scores.runs, units, scores.name, results))
