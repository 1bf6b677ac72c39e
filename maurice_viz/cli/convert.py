"""`maurice-replay record|convert|export|import|formats`: commands that read one format and write another."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from maurice_loaders.export.tables import PATHS
from maurice_loaders.importing import ImportOptions, ImportSummary, import_pictures

from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.errors import status_of
from .shared.options import MOST_SEED, argument, option, reading_of

if TYPE_CHECKING:
    from maurice_loaders.live.session import LiveSession

FILES = "Files to write"
DEFAULTS = ImportOptions()


def record(
    source: Annotated[
        Path,
        argument(
            "SOURCE",
            "tcp://HOST:PORT, ws://HOST:PORT, - (standard input), or a file that grows.",
            allow_dash=True,
        ),
    ],
    output: Annotated[Path, option("-o --output", "Write session.log to this folder.", metavar="DIR")],
    library: Annotated[
        Path | None,
        option("--library", "Name this survey or library in the recorded header. [default: its own]"),
    ] = None,
    patience: Annotated[
        float | None,
        option(
            "--patience",
            "End after the source was disconnected, or silent, for this long. "
            "[default: 30 disconnected; silent forever]",
            min=0.0,
            metavar="SECONDS",
        ),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
) -> None:
    """Record a live source into a session log, until it ends or you press Ctrl-C."""
    from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
    from maurice_loaders.live.source import live_source

    from ..app.replay import patience_of

    stopped: KeyboardInterrupt | None = None
    listen = ListenOptions(patience=patience_of(patience), only_record=True, library=library)
    recorder = LiveRecorder(output, force=force)
    session = LiveSession(live_source(source, reading_of(reading)), listen, recorder, note)
    try:
        with session, listening(usage=False) as listener:
            session.listen(lambda counts: listener.progress(counts.records, 0, "record"))
    except KeyboardInterrupt as stop:
        stopped = stop
        session.close()  # it may have been stopped while it began
    _tell(session, json_output)
    if stopped is not None:
        raise typer.Exit(status_of(stopped))


def _tell(session: LiveSession, json_output: bool) -> None:
    info, counts = session.info_if_any, session.counts
    for text in (*(info.notes if info else ()), *session.warnings):
        note(text)
    if session.ended:
        note(f"{session.ended}; ended")
    if session.problem_count:
        found = f"{session.problem_count} lines made no sense and were left out"
        note(f"{found}, the first: {session.problems[0]}")
    if info is None:
        note("stopped before a header came; nothing was written")
    if json_output:
        numbers = {"records": counts.records, "pictures": counts.pictures, "broken": counts.broken}
        print_json({"session": session.path, **numbers, "gaps": counts.gaps})
    elif info is not None:
        results.print(f"{session.path}: {counts.records} records, {counts.pictures} of them pictures")


def convert(
    source: Annotated[Path, argument("IN", "A recording of any readable format.")],
    target: Annotated[Path, argument("OUT", "A folder, or a name ending in .log or .mcap.")],
    *,
    pictures: Annotated[str, option("--pictures", "png: lossless. jpeg: smaller (quality 95).")] = "png",
    t_offset: Annotated[
        float, option("--t-offset", "Add this to every time; the clock is that of IN.", metavar="SECONDS")
    ] = 0.0,
    keep_going: opt.KeepGoing = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
) -> None:
    """Write a session as a native log (.log, its pictures beside it) or as MCAP with ROS 2 messages (.mcap).

    The file holds what a replay of IN sees, so that replaying the log gives the same run. Of a recording
    without pictures all odometry, truth, events and readings are written. What has no place is counted.
    """
    from ..app.convert import convert as convert_recording

    kind: Any = pictures  # checked by the function
    how = reading_of(reading, keep_going=keep_going)
    with listening() as listener:
        converted = convert_recording(
            source, target, pictures=kind, t_offset_s=t_offset, reading=how, force=force, listener=listener
        )
    if json_output:
        print_json(converted.to_json())
    else:
        done = converted.counts
        counts = f"{done.pictures} pictures, {done.motions} motions, {done.truths} true poses"
        others = f"{done.events} events, {done.readings} readings"
        results.print(f"{converted.file}: {counts}, {others}", soft_wrap=True)


def _file(name: str, text: str) -> Any:
    return option(name, text, FILES, metavar="FILE")


def export(
    run: opt.Run,
    tum: Annotated[Path | None, _file("--tum", "Paths as TUM: t x y z qx qy qz qw.")] = None,
    kitti: Annotated[Path | None, _file("--kitti", "Paths as KITTI: 12 numbers.")] = None,
    csv: Annotated[Path | None, _file("--csv", "A table with one row per step.")] = None,
    parquet: Annotated[Path | None, _file("--parquet", "The same table as Parquet.")] = None,
    mcap: Annotated[
        Path | None, _file("--mcap", "ROS 2 messages: pictures, poses, clouds. Needs maurice-replay[ros].")
    ] = None,
    evo: Annotated[
        Path | None, _file("--evo", "Position errors as `evo_ape --save_results` has them.")
    ] = None,
    only: Annotated[
        str | None,
        option("--only", f"Only one path for TUM and KITTI: {' | '.join(PATHS)}. [default: all three]"),
    ] = None,
    scored: Annotated[
        bool, option("--scored", "Leave out the first three steps, as the table of scores does.")
    ] = False,
    t_offset: Annotated[
        float, option("--t-offset", "Add this to every time; the clock is the session's.", metavar="SECONDS")
    ] = 0.0,
    run_label: opt.RunLabel = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Write estimate, truth and odometry of a saved run as files for other tools, without filtering again."""
    from ..app.convert import export as export_run

    files = {"tum": tum, "kitti": kitti, "csv": csv, "parquet": parquet, "mcap": mcap, "evo": evo}
    with listening() as listener:
        exported = export_run(
            run,
            **files,
            only=only,
            scored=scored,
            t_offset_s=t_offset,
            run_label=run_label,
            force=force,
            listener=listener,
        )
    if json_output:
        print_json({"runs": [exported.to_json()]})
        return
    for file in exported.files:
        results.print(str(file), soft_wrap=True)


def formats(
    path: Annotated[Path | None, argument(None, "Detect the format of this file or folder.")] = None,
    json_output: opt.Json = False,
) -> None:
    """List the formats of recordings that can be read, or detect a file's."""
    from ..app.inspect import formats as find_formats

    found = find_formats(path)
    if json_output:
        print_json([asdict(one) for one in found])
        return
    table = Table(show_header=path is None)
    for title in ("format", "what", "needs"):
        table.add_column(title, overflow="fold")
    for one in found:
        needs = "" if one.installed else f"pip install 'maurice-replay[{one.extra}]'"
        table.add_row(one.name, one.what, needs)
    results.print(table)


def pictures(
    folder: Annotated[str, typer.Argument(help="The folder that the table's picture names are relative to.")],
    poses: Annotated[Path, option("--poses", "A table with one row per picture.", metavar="FILE.csv")],
    output: Annotated[Path, option("-o --output", "The folder to write.", metavar="DIR")],
    reading: opt.Reading = None,
    map_lines: opt.MapFile = None,
    map_unit: opt.MapUnit = DEFAULTS.map_unit,
    name: Annotated[str | None, option("--name", "Name of the place. [default: the table's folder]")] = None,
    camera_fov: Annotated[
        float | None,
        option(
            "--camera-fov",
            "The camera's horizontal field of view in degrees, for landmarks. [default: fitted, else 60]",
            min=1,
            max=170,
        ),
    ] = None,
    every: Annotated[
        int, option("--every", "Put one in this many runs of equal poses into the session.", min=2)
    ] = DEFAULTS.session_every,
    guard: Annotated[
        float | None,
        option(
            "--guard",
            "Radius in meters around session poses without library pictures. "
            "[default: 0.5, or less in a small place]",
            min=0.0,
        ),
    ] = None,
    seed: Annotated[
        int, option("--seed", "Seed of the odometry's noise.", min=0, max=MOST_SEED)
    ] = DEFAULTS.seed,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Split a folder of pictures with known poses into a survey log and a session log.

    The odometry is made from the steps between poses plus noise; the session's header notes this.
    """
    options = ImportOptions(
        reading=reading_of(reading),
        name=name,
        map_lines=map_lines,
        map_unit=map_unit,
        camera_fov_rad=None if camera_fov is None else math.radians(camera_fov),
        session_every=every,
        guard_m=guard,
        seed=seed,
    )
    summary = import_pictures(folder, poses, output, options, force=force)
    if json_output:
        print_json(asdict(summary))
    else:
        _report(summary)


def _report(summary: ImportSummary) -> None:
    lines = [
        f"{summary.session}: {summary.session_pictures} pictures of {summary.session_runs} runs",
        f"{summary.survey}: {summary.library_pictures} pictures; {summary.guarded_runs} of {summary.runs} "
        "runs left out, too close to the session's",
        f"a session picture is {summary.nearest_reference_median_m:.2f} m from the nearest reference "
        f"(median; at most {summary.nearest_reference_max_m:.2f} m)",
    ]
    results.print("\n".join(lines))
    for text in summary.notes:
        note(f"note: {text}")
    note(f"now try: maurice-replay compare {summary.session}")
