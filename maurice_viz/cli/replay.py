"""`maurice-replay replay|compare|demo|verify`: runs of the filter, into the viewer or a file."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from maurice_loaders.session_log.header import drive_name

from ..entities import Phase, Place
from ..layouts import INSIDE
from ..style import Scale, Units, units_named
from ..text.summary import paired_rows, score_rows, short_rows
from ..text.verdict import account, headline
from .shared import options as opt
from .shared.console import TO_CONSOLE, listening, note, print_json, results
from .shared.live_options import ListenSet

if TYPE_CHECKING:
    from collections.abc import Callable

    from maurice_datasets.folders import SimulationPaths

    from ..playback import RunResult
    from ..running.run import Report, RunScores

ENDED_LOST = 3  # exit status of a live replay with --on-lost whose source ended while a run was lost
KIDNAPPED, FEATURES, LASER = STORIES = ("kidnapped", "features", "laser")  # of the demo
STORY_FILTERS = {
    KIDNAPPED: ("thesis", "robust"),
    FEATURES: ("color", "blended"),
    LASER: ("amcl", "laser"),
}


def replay(
    session: opt.Session,
    chosen: opt.FilterSet,
    drawing: opt.DrawingSet,
    reading: opt.ReadingSet,
    live: ListenSet,
    seed: opt.Seed = 0,
    save_run: opt.SaveRun = None,
    all_rows: opt.AllRows = False,
    json_output: opt.Json = False,
    as_recorded: opt.AsRecorded = False,
) -> None:
    """Replay a session of any format, a saved run or a live source, in the viewer or to a file."""
    listening_to = live.options([session])
    from ..app.replay import replay as replay_once
    from ..running.output import serving

    output = drawing.output(drive_name(session), save_run, alone=not json_output)
    with listening(usage=False) as listener, serving(output, listener):
        scores = replay_once(
            session,
            chosen.library,
            chosen.filter(seed),
            reading=reading.options(),
            live=listening_to,
            as_recorded=as_recorded,
            output=output,
            report=printed(json_output, all_rows=all_rows),
            listener=listener,
        )
    _end_as(scores, live)


def _end_as(scores: RunScores, live: ListenSet) -> None:
    """End with a status of its own where a live run ended lost, and something waits for that."""
    if live.on_lost is not None and scores.ended_lost:
        raise typer.Exit(ENDED_LOST)


def open(  # noqa: A001
    recording: Annotated[Path, opt.argument("FILE.rrd|RUN", "A Rerun recording, or a saved run's folder.")],
    step: Annotated[
        int | None, opt.option("--step", "Where to begin. [default: where the verdict says]", min=1)
    ] = None,
    phase: opt.OnePhase = None,
    run: opt.RunName = None,
    web: opt.Web = False,
    layout: opt.Layout = None,
) -> None:
    """Open a Rerun recording or a saved run in the viewer, at a step or one phase of it."""
    from ..app.replay import replay as replay_once
    from ..running.output import serving

    if phase is not None and step is None:
        raise typer.BadParameter("--phase goes with --step")
    if run is not None and layout is None and phase is None:
        raise typer.BadParameter(opt.RUN_NEEDS)
    tab = layout or (INSIDE if phase is not None else None)
    place = None if step is None else Place(step, None if phase is None else Phase[phase.upper()])
    output = opt.DrawingSet(web=web, layout=tab).output(drive_name(recording), place=place, run=run)
    with listening(usage=False) as listener, serving(output, listener):
        replay_once(recording, output=output, report=printed(json_output=False), listener=listener)


def compare(
    paths: Annotated[
        list[Path],
        opt.argument(
            "SESSION|RUN...",
            "A session or a live source; or two to four sessions, or saved runs; or a comparison's folder.",
        ),
    ],
    chosen: opt.FiltersSet,
    drawing: opt.DrawingSet,
    reading: opt.ReadingSet,
    live: ListenSet,
    save_run: opt.SaveRun = None,
    all_rows: opt.AllRows = False,
    json_output: opt.Json = False,
) -> None:
    """Replay two to four runs side by side in one recording, and show how they differ.

    Of one session or live source, give exactly one option of the filter several times, or one key of --set
    with several values; without any, color and blended are compared.
    """
    listening_to = live.options(paths)
    from ..app.compare import SEVERAL
    from ..app.compare import compare as compare_runs
    from ..running.output import serving

    output = drawing.output(drive_name(paths[0]) if len(paths) == 1 else SEVERAL, save_run)
    with listening(usage=False) as listener, serving(output, listener):
        scores = compare_runs(
            paths,
            chosen.library,
            chosen.filters(len(paths)),
            reading=reading.options(),
            live=listening_to,
            output=output,
            report=printed(json_output, all_rows=all_rows),
            listener=listener,
        )
    _end_as(scores, live)


def demo(
    drawing: opt.DrawingSet,
    story: Annotated[
        str,
        opt.argument(
            "STORY",
            "kidnapped: a kidnapped robot, two presets; features: color and blended on one drive; laser: "
            "a kidnapped robot with a laser, AMCL beside ours. [default: kidnapped]",
            **opt.one_of(STORIES, "story"),
        ),
    ] = KIDNAPPED,
    session_only: Annotated[
        Path | None,
        opt.option("--session-only", "Only write session and survey to this folder.", metavar="DIR"),
    ] = None,
    all_rows: opt.AllRows = False,
    json_output: opt.Json = False,
) -> None:
    """Replay a simulated drive: a kidnapping with a camera or a laser, or two features side by side."""
    from maurice_datasets import demos

    if session_only is not None:
        _write_demo(session_only, story, force=drawing.force, json_output=json_output)
        return
    from ..app.compare import compare as compare_runs
    from ..running.output import serving

    made_by: dict[str, Callable[..., SimulationPaths]] = {
        KIDNAPPED: demos.kidnapping_paths,
        FEATURES: demos.demo_paths,
        LASER: demos.laser_paths,
    }
    with listening(usage=False) as listener:
        paths = made_by[story](progress=listener.progress)
        output = drawing.output("demo" if story == KIDNAPPED else f"demo-{story}", fixed_stem=True)
        with serving(output, listener):
            compare_runs(
                paths.session,
                filters=STORY_FILTERS[story],
                output=output,
                report=printed(json_output, all_rows=all_rows),
                listener=listener,
            )


def _write_demo(folder: Path, story: str, *, force: bool, json_output: bool) -> None:
    from maurice_datasets.sessions import demo_plan, kidnapping_plan, laser_plan, write_simulation

    plan = {KIDNAPPED: kidnapping_plan, FEATURES: demo_plan, LASER: laser_plan}[story]()
    with listening(usage=False) as listener:
        written = write_simulation(folder, plan, force=force, progress=listener.progress)
    if json_output:
        print_json({"session": written.session, "survey": written.survey})
    else:
        results.print(f"{written.session}\n{written.survey}")
    note(f"now try: {shlex.join(['maurice-replay', str(written.session)])}")


def verify(run: opt.Run, json_output: opt.Json = False) -> None:
    """Filter a saved run again; exit status 0 if every step is the same bit by bit, else 1."""
    from ..running.verify import verify as verify_run

    with listening() as listener:
        verdicts = verify_run(run, listener=listener)
    if json_output:
        print_json({"runs": verdicts})
    else:
        for verdict in verdicts:
            results.say(str(verdict))
    if not all(verdict.same for verdict in verdicts):
        raise typer.Exit(1)


def printed(json_output: bool, *, all_rows: bool = False) -> Report:
    """Return a function that prints scores as JSON or as a table, of five rows or of all."""

    def report(scores: RunScores) -> None:
        TO_CONSOLE.end()
        if json_output:
            print_json(scores)
        else:
            units = units_named(scores.display_units)
            verdicts = {run.label: run.verdict for run in scores.runs}
            results.say(headline(verdicts, Scale(units)), style="bold")
            for line in account(verdicts, Scale(units)) if all_rows else ():
                results.say(line)
            results.print(to_table(scores.runs, units, scores.name, results, all_rows=all_rows))
            if not all_rows:
                note("--all prints how and why runs were wrong, and the whole table")

    return report


NAMES_WIDTH = 22  # of the first column of a table that is too wide; the runs share the rest


def to_table(
    runs: Sequence[RunResult], units: Units, title: str, console: Console, *, all_rows: bool = False
) -> Table:
    """Return a table of scores with one column per run, in the session's own units, that fits the console.

    A table that is too wide has no frame and up to two lines per cell: the interval is below the mean.
    """
    parts = [score_rows(runs, units), paired_rows(runs, units)] if all_rows else [short_rows(runs, units)]
    table = _score_table(runs, parts, title)
    if console.measure(table, options=console.options.update(max_width=1000)).maximum <= console.width:
        return table
    return _score_table(runs, parts, title, (console.width - NAMES_WIDTH - 1) // len(runs) - 2)


def _score_table(
    runs: Sequence[RunResult],
    parts: Sequence[Sequence[tuple[str, list[str]]]],
    title: str,
    cell_width: int | None = None,
) -> Table:
    narrow = cell_width is not None
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    if narrow:
        table.box, table.show_edge, table.pad_edge = box.SIMPLE_HEAD, False, False
        table.padding = (0, 1, 0, 0)
    table.add_column("", width=NAMES_WIDTH if narrow else None)
    for result in runs:
        table.add_column(result.label, justify="right", width=cell_width, overflow="fold")
    for rows in parts:
        for name, cells in rows:
            table.add_row(name, *(cell.replace(" [", "\n[") if narrow else cell for cell in cells))
        table.add_section()
    return table
