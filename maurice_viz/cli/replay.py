"""`maurice-replay replay|compare|demo|verify`: runs of the filter, into the viewer or a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from maurice_loaders.live.source import is_live
from maurice_loaders.session_log.header import drive_name

from ..layouts import DETAILS
from ..style import Scale, Units, units_named
from ..text.summary import paired_rows, score_rows
from ..text.verdict import verdict_line
from .shared import options as opt
from .shared.console import TO_CONSOLE, listening, note, print_json, results
from .shared.options import output_of, reading_of, sensor_pairs, settings_of

if TYPE_CHECKING:
    from ..playback import RunResult
    from ..running.run import Report, RunScores

QUIET = "warn,re_log_encoding=error"  # a live recording has no footer on purpose, of which Rerun warns
KIDNAPPED, FEATURES = STORIES = ("kidnapped", "features")  # of the demo
KIDNAPPING_PRESETS = ("thesis", "robust")


def replay(
    session: opt.Session,
    library: opt.Library = None,
    preset: opt.Preset = None,
    feature: opt.Feature = None,
    particles: opt.Particles = None,
    seed: opt.Seed = 0,
    start: opt.Start = None,
    config: opt.Config = None,
    settings: opt.Set = None,
    sensor: opt.Sensors = None,
    rrd: opt.Rrd = None,
    web: opt.Web = False,
    save_run: opt.SaveRun = None,
    layout: opt.Layout = None,
    detail: opt.Detail = DETAILS[0],
    force: opt.Force = False,
    json_output: opt.Json = False,
    follow: opt.Follow = False,
    capture: opt.Capture = None,
    keep_up: opt.KeepUp = None,
    patience: opt.Patience = None,
    reading: opt.Reading = None,
    keep_going: opt.KeepGoing = False,
    as_recorded: opt.AsRecorded = False,
) -> None:
    """Replay a session of any format, a saved run or a live source, in the viewer or to a file."""
    if follow or is_live(session):
        os.environ.setdefault("RUST_LOG", QUIET)  # before the next lines import rerun, which reads it
    from ..app.replay import LiveOptions
    from ..app.replay import replay as replay_once
    from ..running.output import serving

    output = output_of(drive_name(session), rrd, save_run, layout, detail, web=web, force=force)
    output = replace(output, alone=not json_output)
    with listening(usage=False) as listener, serving(output, listener):
        replay_once(
            session,
            library,
            feature=feature,
            preset=preset,
            particles=particles,
            seed=seed,
            start=start,
            config=config,
            settings=settings_of([*(settings or ()), *sensor_pairs(sensor)]),
            reading=reading_of(reading, keep_going=keep_going),
            live=LiveOptions(follow, capture, keep_up, patience),
            as_recorded=as_recorded,
            output=output,
            report=printed(json_output),
            listener=listener,
        )


def open(  # noqa: A001
    recording: Annotated[Path, opt.argument("FILE.rrd|RUN", "A Rerun recording, or a saved run's folder.")],
    web: opt.Web = False,
    layout: opt.Layout = None,
) -> None:
    """Open a Rerun recording or a saved run in the viewer, as `maurice-replay FILE.rrd` does."""
    replay(recording, web=web, layout=layout)


def compare(
    paths: Annotated[
        list[Path],
        opt.argument(
            "SESSION|RUN...", "A session; or two to four of them, or of saved runs; or a comparison's folder."
        ),
    ],
    library: opt.Library = None,
    preset: opt.Presets = None,
    feature: opt.Features = None,
    particles: opt.ParticleCounts = None,
    seed: opt.Seeds = None,
    start: opt.Starts = None,
    config: opt.Configs = None,
    settings: opt.Set = None,
    sensor: opt.Sensors = None,
    rrd: opt.Rrd = None,
    web: opt.Web = False,
    save_run: opt.SaveRun = None,
    layout: opt.Layout = None,
    detail: opt.Detail = DETAILS[0],
    force: opt.Force = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
    keep_going: opt.KeepGoing = False,
) -> None:
    """Replay two to four runs side by side in one recording, and show how they differ.

    Of one session, give exactly one option of the filter several times, or one key of --set with several
    values; without any, color and blended are compared.
    """
    from ..app.compare import SEVERAL
    from ..app.compare import compare as compare_runs
    from ..running.output import serving

    stem = drive_name(paths[0]) if len(paths) == 1 else SEVERAL
    output = output_of(stem, rrd, save_run, layout, detail, web=web, force=force)
    with listening(usage=False) as listener, serving(output, listener):
        compare_runs(
            paths,
            library,
            features=feature or (),
            presets=preset or (),
            particles=particles or (),
            seeds=seed or (),
            starts=start or (),
            configs=config or (),
            settings=_settings([*(settings or ()), *sensor_pairs(sensor)]),
            reading=reading_of(reading, keep_going=keep_going),
            output=output,
            report=printed(json_output),
            listener=listener,
        )


def _settings(pairs: list[str]) -> list[dict[str, Any]]:
    """Return the settings of each run: a key with several values makes one run per value."""
    values: dict[str, list[Any]] = {}
    for pair in pairs:
        for key, value in settings_of([pair]).items():
            values.setdefault(key, []).append(value)
    once = {key: value[0] for key, value in values.items() if len(value) == 1}
    several = {key: value for key, value in values.items() if len(value) > 1}
    if len(several) > 1:
        raise typer.BadParameter(f"--set gives {' and '.join(several)} several times; vary one key")
    varied = [once | {key: value} for key, some in several.items() for value in some]
    return varied or ([once] if once else [])


def demo(
    story: Annotated[
        str,
        typer.Argument(
            help="kidnapped: a kidnapped robot, two presets; features: color and blended on one drive.",
            **opt.one_of(STORIES, "story"),
        ),
    ] = STORIES[0],
    session_only: Annotated[
        Path | None,
        opt.option("--session-only", "Only write session and survey to this folder.", metavar="DIR"),
    ] = None,
    rrd: opt.Rrd = None,
    web: opt.Web = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Replay a drive through a simulated two-room arena: a kidnapping, or two features side by side."""
    from maurice_datasets.demos import demo_paths, kidnapping_paths

    from ..app.compare import COLOR_AND_BLENDED
    from ..app.compare import compare as compare_runs
    from ..running.output import serving

    with listening(usage=False) as listener:
        if session_only is None:
            features = story == FEATURES
            paths = (demo_paths if features else kidnapping_paths)(progress=listener.progress)
            stem = "demo" if story == STORIES[0] else f"demo-{story}"
            output = replace(output_of(stem, rrd, web=web, force=force), fixed_stem=True)
            with serving(output, listener):
                compare_runs(
                    paths.session,
                    features=COLOR_AND_BLENDED if features else (),
                    presets=() if features else KIDNAPPING_PRESETS,
                    output=output,
                    report=printed(json_output),
                    listener=listener,
                )
            return
        from maurice_datasets.sessions import kidnapping_plan, write_demo, write_simulation

        if story == FEATURES:
            written = write_demo(session_only, force=force, progress=listener.progress)
        else:
            written = write_simulation(
                session_only, kidnapping_plan(), force=force, progress=listener.progress
            )
    if json_output:
        print_json({"session": written.session, "survey": written.survey})
    else:
        results.print(f"{written.session}\n{written.survey}")
    note(f"now try: maurice-replay {written.session}")


def verify(run: opt.Run, json_output: opt.Json = False) -> None:
    """Filter a saved run again; exit status 0 if every step is the same bit by bit, else 1."""
    from ..running.saved import verify as verify_run

    with listening() as listener:
        verdicts = verify_run(run, listener=listener)
    if json_output:
        print_json({"runs": [verdict.to_json() for verdict in verdicts]})
    else:
        for verdict in verdicts:
            results.print(str(verdict), soft_wrap=True)
    if not all(verdict.same for verdict in verdicts):
        raise typer.Exit(1)


def printed(json_output: bool) -> Report:
    """Return a function that prints scores as JSON or as a table."""

    def report(scores: RunScores) -> None:
        TO_CONSOLE.end()
        if json_output:
            print_json(scores.to_json())
        else:
            units = units_named(scores.display_units)
            line = verdict_line({run.label: run.verdict for run in scores.runs}, Scale(units))
            results.print(Text(line, style="bold"))
            results.print(to_table(scores.runs, units, scores.name, results))

    return report


NAMES_WIDTH = 22  # of the first column of a table that is too wide; the runs share the rest


def to_table(runs: Sequence[RunResult], units: Units, title: str, console: Console) -> Table:
    """Return a table of scores with one column per run, in the session's own units, that fits the console.

    A table that is too wide has no frame and up to two lines per cell: the interval is below the mean.
    """
    table = _score_table(runs, units, title)
    if console.measure(table, options=console.options.update(max_width=1000)).maximum <= console.width:
        return table
    return _score_table(runs, units, title, (console.width - NAMES_WIDTH - 1) // len(runs) - 2)


def _score_table(runs: Sequence[RunResult], units: Units, title: str, cell_width: int | None = None) -> Table:
    narrow = cell_width is not None
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    if narrow:
        table.box, table.show_edge, table.pad_edge = box.SIMPLE_HEAD, False, False
        table.padding = (0, 1, 0, 0)
    table.add_column("", width=NAMES_WIDTH if narrow else None)
    for result in runs:
        table.add_column(result.label, justify="right", width=cell_width, overflow="fold")
    for rows in (score_rows(runs, units), paired_rows(runs, units)):
        for name, cells in rows:
            table.add_row(name, *(cell.replace(" [", "\n[") if narrow else cell for cell in cells))
        table.add_section()
    return table
