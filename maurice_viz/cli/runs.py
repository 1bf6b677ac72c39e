"""`maurice-replay events|explain|report|snapshot RUN`: what happened, and why; `budget SESSION`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from maurice_mcl.scoring.events import KINDS, RunEvent

from ..entities import Phase
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, option

ALL_RUNS = "all"  # in a table: an event that every run of a comparison has
MORE, PICTURE, MOVIE = "One more reference", "Picture", "Movie"  # panels of the help
PHASES = " | ".join(phase.name.lower() for phase in Phase)


def events(
    run: opt.Run,
    kinds: Annotated[
        list[str] | None,
        option(
            "--kind",
            f"Only this kind; may be repeated: {', '.join(KINDS)}.",
            metavar="KIND",
            autocompletion=opt.completed(KINDS),
        ),
    ] = None,
    everything: Annotated[bool, option("--all", "List routine events too: resampling, a new floor.")] = False,
    json_output: opt.Json = False,
) -> None:
    """List the events of a saved run."""
    from ..app.events import events as find

    with listening() as listener:
        found = find(run, kinds=kinds or (), routine=everything, listener=listener)
    if json_output:
        print_json(found.to_json())
    elif any(one.events for one in found.runs):
        results.print(_table({one.label: one.events for one in found.runs}, found.session))
    else:
        note(f"{run}: no event{' of that kind' if kinds else ''}")


def _table(by_run: dict[str, Sequence[RunEvent]], title: str) -> Table:
    """Return a table with one row per event, by step, and a column for the run where there are several."""
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    several = len(by_run) > 1
    for name in ("step", "time (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("run", "event") if several else ("event",):
        table.add_column(name, no_wrap=True)
    table.add_column("what")
    for event, labels in _by_event(by_run):
        who = ALL_RUNS if len(labels) == len(by_run) else ", ".join(labels)
        row = [str(event.step), f"{event.time_s:.1f}", *([who] if several else []), event.kind, event.text]
        table.add_row(*map(Text, row))
    return table


def _by_event(by_run: dict[str, Sequence[RunEvent]]) -> list[tuple[RunEvent, list[str]]]:
    """Join equal events of several runs, in the order of steps and kinds."""
    labels: dict[RunEvent, list[str]] = {}
    for label, some in by_run.items():
        for event in dict.fromkeys(some):
            labels.setdefault(event, []).append(label)
    order = list(KINDS)
    return sorted(labels.items(), key=lambda item: (item[0].step, order.index(item[0].kind)))


def explain(
    run: opt.Run,
    step: Annotated[int | None, option("--step", "Which step. [default: the last one]", min=1)] = None,
    at: Annotated[
        str | None,
        option("--at", "Explain this pose too, in display units and degrees.", MORE, metavar="X,Y,HEADING"),
    ] = None,
    entry: Annotated[int | None, option("--entry", "Explain this library entry too.", MORE, min=0)] = None,
    particle: Annotated[
        int | None,
        option("--particle", "Explain this particle too, by its number in the saved cloud.", MORE, min=0),
    ] = None,
    run_label: opt.RunLabel = None,
    output: Annotated[
        Path | None,
        option("-o --output", "Write a picture of the tab explain.", metavar="OUT.png"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Explain why the filter believed what it believed at one update of a saved run."""
    from ..app.explain import explain as explain_run

    with listening() as listener:
        explained = explain_run(
            run,
            step,
            at=at,
            entry=entry,
            particle=particle,
            run_label=run_label,
            to=output,
            force=force,
            listener=listener,
        )
        if json_output:
            print_json(explained.to_json())
        else:
            typer.echo(explained.text)
        if output is not None:
            listener.remark(f"{output} written")


def report(
    run: opt.Run,
    output: Annotated[Path, option("-o --output", "The page to write.", metavar="OUT.html")] = Path(
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
        option(
            "-o --output",
            "The picture or movie to write.",
            metavar="OUT.png|OUT.mp4|OUT.gif",
            show_default=False,
        ),
    ],
    step: Annotated[int | None, option("--step", "Which step. [default: the last]", PICTURE, min=1)] = None,
    phase: Annotated[
        str | None,
        option(
            "--phase",
            f"One phase of it: {PHASES}.",
            PICTURE,
            autocompletion=opt.completed(PHASES.split(" | ")),
        ),
    ] = None,
    first: Annotated[
        int | None, option("--from", "Its first step. [default: the first]", MOVIE, min=1)
    ] = None,
    last: Annotated[int | None, option("--to", "Its last step. [default: the last]", MOVIE, min=1)] = None,
    fps: Annotated[float, option("--fps", "Its pictures per second.", MOVIE, min=0.1, max=50)] = 4.0,
    phases: Annotated[
        bool, option("--phases", "Six pictures per step, one per phase, instead of one.", MOVIE)
    ] = False,
    view: Annotated[
        str | None, option("--view", "Only this view, by its title or the beginning of its title.")
    ] = None,
    layout: opt.Layout = None,
    size: Annotated[str, option("--size", "Size of the window in pixels.", metavar="WxH")] = "1600x1000",
    force: opt.Force = False,
) -> None:
    """Write a picture or a movie of the viewer with a saved run or a recording; no screen is needed."""
    from ..app import snapshot as app
    from ..viewer.movie import SUFFIXES

    is_movie = output.suffix in SUFFIXES
    if not is_movie and output.suffix != ".png":
        raise typer.BadParameter(f"-o ends in .png, {' or '.join(SUFFIXES)}, found {str(output)!r}")
    if not is_movie and (first is not None or last is not None or phases):
        raise typer.BadParameter("--from, --to and --phases go with a movie: -o OUT.mp4")
    if is_movie and (step is not None or phase is not None):
        raise typer.BadParameter(
            "--step and --phase go with a picture; a movie has --from, --to and --phases"
        )
    window = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", size)  # the functions check its limits
    if window is None:
        raise typer.BadParameter(f"--size is like 1600x1000, found {size!r}")
    shown: dict[str, Any] = {"view": view, "layout": layout, "size": (int(window[1]), int(window[2]))}
    with listening() as listener:
        shown |= {"force": force, "listener": listener}
        if is_movie:
            made = app.movie(source, to=output, first=first, last=last, phases=phases, fps=fps, **shown)
        else:
            made = app.snapshot(source, to=output, step=step, phase=phase, **shown)
    results.print(str(made), soft_wrap=True)


def budget(
    source: Annotated[
        Path, argument("SESSION|TRIALS", "A session with truth, or a folder that `trials run` has made.")
    ],
    library: opt.Library = None,
    preset: opt.Preset = None,
    feature: opt.Feature = None,
    particles: opt.Particles = None,
    start: opt.Start = None,
    config: opt.Config = None,
    settings: opt.Set = None,
    seeds: Annotated[int, option("--seeds", "Runs of every part.", min=2, max=1000)] = 5,
    reading: opt.Reading = None,
    json_output: opt.Json = False,
) -> None:
    """Find which part costs most accuracy: odometry, sensor, distance between references, or particles.

    Each part in turn is made perfect by the truth, on the same seeds; what that takes off the error is what
    the part costs.
    """
    from ..app.budget import error_budget
    from ..text.what_if import budget_rows, say_budget

    with listening() as listener:
        found = error_budget(
            source,
            library,
            preset=preset,
            feature=feature,
            particles=particles,
            start=start,
            config=config,
            settings=opt.settings_of(settings) or None,
            reading=opt.reading_of(reading),
            seeds=seeds,
            listener=listener,
        )
    if json_output:
        print_json(found.to_json())
        return
    drives = f"{found.drives} drives" if found.drives > 1 else f"{found.parts[0].error.count} seeds"
    title = Text(f"{found.name}: {found.filter}, {drives}, 95 % intervals")
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    units = found.display_units
    for name in ("with", f"error ({units})", "lost", "so this part", f"costs ({units})"):
        table.add_column(name, no_wrap="(" in name)  # figures
    for row in budget_rows(found):
        table.add_row(*row)
    results.print(table)
    results.print(say_budget(found), soft_wrap=True)
