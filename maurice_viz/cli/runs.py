"""`maurice-replay diagnose|explain|report|snapshot RUN`: what happened, and why; `budget SESSION`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ..entities import PHASE_NAMES
from .shared import options as opt
from .shared.console import listening, print_json, results
from .shared.options import argument, option

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
            source, **chosen.arguments(), seed=seed, reading=reading.options(), listener=listener
        )
        if json_output:
            print_json(diagnoses.to_json())
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
            print_json(explained.to_json())
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
            metavar="NAME",
            **opt.one_of((*PHASE_NAMES, ALL), "phase"),
        ),
    ] = None,
    first: Annotated[
        int | None, option("--from", "Its first step. [default: the first]", MOVIE, min=1)
    ] = None,
    last: Annotated[int | None, option("--to", "Its last step. [default: the last]", MOVIE, min=1)] = None,
    fps: Annotated[float, option("--fps", "Its pictures per second.", MOVIE, min=0.1, max=50)] = 4.0,
    view: Annotated[
        str | None, option("--view", "Only this view, by its title or the beginning of its title.")
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
    from ..text.what_if import budget_rows, say_budget

    with listening() as listener:
        shares = error_budget(
            source, **chosen.arguments(), reading=reading.options(), seeds=seeds, listener=listener
        )
    if json_output:
        print_json(shares.to_json())
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
