"""`maurice-replay diagnose|explain|report|snapshot|what-if RUN`: what happened, and why; `budget SESSION`."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ..entities import PHASE_NAMES
from ..style import Scale, units_named
from ..text.verdict import headline
from .replay import to_table
from .shared import options as opt
from .shared.console import TO_CONSOLE, listening, note, print_json, results
from .shared.options import argument, option

if TYPE_CHECKING:
    from ..app.remedies import Remedies
    from ..app.what_if import WhatIf


MORE, PICTURE, MOVIE = "One more reference", "Picture", "Movie"  # panels of the help
ALL = "all"


def diagnose(
    source: Annotated[
        Path, argument("SESSION|RUN", "A saved run or a comparison, or a session, which is then filtered.")
    ],
    chosen: opt.FilterSet,
    reading: opt.ReadingSet,
    seed: opt.Seed = 0,
    output: Annotated[
        Path | None,
        opt.writes("DIR", "Draw what shows each failure of a saved run into this folder."),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Say why a filter was lost: one cause for each time, with the step and the numbers that decided."""
    from ..app.diagnose import diagnose as diagnose_runs
    from ..app.diagnose import draw, expect_drawable

    with listening(usage=False) as listener:
        if output is not None:
            expect_drawable(source, output, force=force)
        diagnoses = diagnose_runs(
            source, chosen.library, chosen.filter(seed), reading=reading.options(), listener=listener
        )
        if json_output:
            print_json(diagnoses)
        else:
            results.say(diagnoses.text)
        if output is not None:
            for picture in draw(diagnoses, output, force=force, listener=listener):
                listener.remark(f"{picture} written")


def explain(
    run: opt.Run,
    step: Annotated[int | None, option("--step", "Which step. [default: the last one]", min=1)] = None,
    name: opt.RunName = None,
    at: Annotated[
        str | None,
        option("--at", "Explain this pose too, in display units and degrees.", MORE, metavar="X,Y,HEADING"),
    ] = None,
    entry: Annotated[int | None, option("--entry", "Explain this library entry too.", MORE, min=0)] = None,
    particle: Annotated[
        int | None,
        option("--particle", "Explain this particle too, by its number in the saved cloud.", MORE, min=0),
    ] = None,
    output: Annotated[
        Path | None,
        opt.writes("OUT.png", "Write a picture of the tab explain."),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Explain why the filter believed what it believed at one step of a saved run."""
    from ..app.explain import explain as explain_run

    with listening() as listener:
        explained = explain_run(
            run,
            step,
            label=name,
            at=at,
            entry=entry,
            particle=particle,
            to=output,
            force=force,
            listener=listener,
        )
        if json_output:
            print_json(explained)
        else:
            results.say(explained.text)
        if output is not None:
            listener.remark(f"{output} written")


def report(
    run: opt.Run,
    output: Annotated[Path, opt.writes("OUT.html", "The page to write. [default: report.html]")] = Path(
        "report.html"
    ),
    force: opt.Force = False,
) -> None:
    """Write one self-contained page about a saved run: summary, map, traces, events, configuration."""
    from ..reports.make import report as write_report  # jinja2 and the drawings are needed only here

    with listening() as listener:
        file = write_report(run, output, force=force, listener=listener)
    results.print(str(file), soft_wrap=True)


def snapshot(
    source: Annotated[Path, argument("RUN|FILE.rrd", "A saved run's folder, or a Rerun recording.")],
    output: Annotated[
        Path,
        opt.writes("OUT.png|OUT.mp4|OUT.gif", "The picture or movie to write."),
    ],
    step: Annotated[int | None, option("--step", "Which step. [default: the last]", PICTURE, min=1)] = None,
    phase: Annotated[
        str | None,
        option(
            "--phase",
            f"One phase of it: {', '.join(PHASE_NAMES)}; in a movie `all`: six pictures a step.",
            PICTURE,
            **opt.one_of((*PHASE_NAMES, ALL), "phase"),
        ),
    ] = None,
    first: Annotated[
        int | None, option("--from", "Its first step. [default: the first]", MOVIE, min=1)
    ] = None,
    last: Annotated[int | None, option("--to", "Its last step. [default: the last]", MOVIE, min=1)] = None,
    fps: Annotated[float, option("--fps", "Its pictures per second.", MOVIE, min=0.1, max=50)] = 4.0,
    view: Annotated[
        str | None,
        option("--view", "Only this view, by its title or the beginning of its title.", metavar="TITLE"),
    ] = None,
    layout: opt.Layout = None,
    run: opt.RunName = None,
    size: Annotated[str, option("--size", "Size of the window in pixels.", metavar="WxH")] = "1600x1000",
    force: opt.Force = False,
) -> None:
    """Write a picture or a movie of the viewer with a saved run or a recording; no screen is needed."""
    from ..app import snapshot as app
    from ..viewer.movie import SUFFIXES

    is_movie = output.suffix in SUFFIXES
    if not is_movie and output.suffix != ".png":
        raise typer.BadParameter(f"-o ends in .png, {' or '.join(SUFFIXES)}, found {str(output)!r}")
    if not is_movie and (first is not None or last is not None or phase == ALL):
        raise typer.BadParameter("--from, --to and --phase all go with a movie: -o OUT.mp4")
    if is_movie and (step is not None or phase not in (None, ALL)):
        raise typer.BadParameter(
            "--step and one --phase go with a picture; a movie has --from, --to and --phase all"
        )
    window = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", size)  # the functions check its limits
    if window is None:
        raise typer.BadParameter(f"--size is like 1600x1000, found {size!r}")
    if run is not None and layout is None:
        raise typer.BadParameter(opt.RUN_NEEDS)
    with listening() as listener:
        shown: dict[str, Any] = {"to": output, "view": view, "layout": layout, "label": run, "force": force}
        shown |= {"size": (int(window[1]), int(window[2])), "listener": listener}
        if is_movie:
            app.movie(source, first=first, last=last, phases=phase == ALL, fps=fps, **shown)
        else:
            app.snapshot(source, step=step, phase=phase, **shown)
    results.print(str(output), soft_wrap=True)


def budget(
    source: Annotated[
        Path, argument("SESSION|TRIALS", "A session with truth, or a folder that `trials run` has made.")
    ],
    chosen: opt.FilterSet,
    reading: opt.ReadingSet,
    seeds: Annotated[int, option("--seeds", "Runs of every part.", min=2, max=1000)] = 5,
    json_output: opt.Json = False,
) -> None:
    """Find which part costs most accuracy: odometry, sensor, distance between references, or particles.

    Each part in turn is made perfect by the truth, on the same seeds; what that takes off the error is what
    the part costs.
    """
    from ..app.budget import error_budget
    from ..text.comparison import budget_rows, say_budget

    with listening() as listener:
        shares = error_budget(
            source, chosen.library, chosen.filter(), reading=reading.options(), seeds=seeds, listener=listener
        )
    if json_output:
        print_json(shares)
        return
    drives = f"{shares.drives} drives" if shares.drives > 1 else f"{shares.parts[0].error.count} seeds"
    title = Text(f"{shares.name}: {shares.filter}, {drives}, 95 % intervals")
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.padding = (0, 1, 0, 0)
    units = shares.display_units
    for name in ("with", f"error ({units})", "lost", "so this part", f"costs ({units})"):
        table.add_column(name, no_wrap="(" in name)  # figures
    for row in budget_rows(shares):
        table.add_row(*row)
    results.print(table)
    results.say(say_budget(shares))


# A saved run branched at a step, with something changed.

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
            **opt.one_of(("global",), "start of a branch"),
        ),
    ] = None
    settings: opt.Set = None
    sensors: opt.Sensors = None


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
        compared = branch(
            run, from_step, opt.filter_from(change), seed=change.seed, output=output, listener=listener
        )
    TO_CONSOLE.end()
    if json_output:
        print_json(compared)
    else:
        _print(compared)


def _remedies(run: Path, from_step: int | None, seeds: int, json_output: bool) -> None:
    from ..app.remedies import remedies

    with listening(usage=False) as listener:
        ranking = remedies(run, from_step, seeds=seeds, listener=listener)
    if json_output:
        print_json(ranking)
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
        share, error = result.localized, result.error_mean_m
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
