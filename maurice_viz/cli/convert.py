"""`maurice-replay record|convert|export|import|map`: commands that read one format and write another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_loaders.export.tables import PATHS
from maurice_loaders.importing import ImportSummary, import_pictures
from maurice_mcl.library.occupancy_building import CELL_M

from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.errors import status_of
from .shared.options import argument, option
from .shared.values import reading_of

if TYPE_CHECKING:
    from maurice_loaders.live.session import LiveSession

KINDS_OF_FILES = (
    ".tum: the paths, as evo reads them",
    ".csv and .parquet: a row per step",
    ".mcap: ROS 2 messages, with maurice-replay[ros]",
)


def record(
    source: Annotated[
        Path,
        argument(
            "SOURCE",
            "tcp://HOST:PORT, ws://HOST:PORT, cmucam:///dev/NAME, - (standard input), or a file that grows.",
            allow_dash=True,
        ),
    ],
    output: Annotated[Path, opt.writes("DIR", "Write session.log to this folder.")],
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
    reading: opt.ReadingPairs = None,
) -> None:
    """Record a live source into a session log, until it ends or you press Ctrl-C."""
    from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
    from maurice_loaders.live.source import live_source

    from ..running.live import patience_of

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
        problems = f"{session.problem_count} lines made no sense and were left out"
        note(f"{problems}, the first: {session.problems[0]}")
    if info is None:
        note("stopped before a header came; nothing was written")
    if json_output:
        observed = {"pictures": counts.pictures, "scans": counts.scans}
        numbers = {"records": counts.records} | observed | {"broken": counts.broken}
        print_json({"session": session.path, **numbers, "gaps": counts.gaps})
    elif info is not None:
        results.say(f"{session.path}: {counts.records} records, {counts.observed}")


def convert(
    source: Annotated[Path, argument("IN", "A recording of any readable format.")],
    target: Annotated[Path, argument("OUT", "A folder, or a name ending in .log or .mcap.")],
    *,
    pictures: Annotated[
        str,
        option("--pictures", "png: lossless. jpeg: smaller (quality 95).", metavar="png|jpeg"),
    ] = "png",
    reading: opt.ReadingSet,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Write a session as a native log (.log, its pictures beside it) or as MCAP with ROS 2 messages (.mcap).

    The file holds what a replay of IN sees, so that replaying the log gives the same run. Of a recording
    without pictures everything is written. What has no place is counted.
    """
    from ..app.convert import convert as convert_recording

    kind: Any = pictures  # checked by the function
    with listening() as listener:
        converted = convert_recording(
            source,
            target,
            pictures=kind,
            reading=reading.options(),
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(converted)
    else:
        numbers = converted.counts
        counts = f"{numbers.pictures} pictures, {numbers.motions} motions, {numbers.truths} true poses"
        others = f"{numbers.events} events, {numbers.readings} readings, {numbers.scans} scans"
        results.say(f"{converted.file}: {counts}, {others}")


def export(
    run: opt.Run,
    *,
    files: Annotated[
        list[Path],
        opt.writes(
            "FILE",
            f"A file to write, of the kind that its ending says; repeatable. {'. '.join(KINDS_OF_FILES)}.",
        ),
    ],
    only: Annotated[
        str | None,
        option(
            "--only",
            "Only one path for TUM. [default: all three]",
            **opt.one_of(PATHS, "path"),
        ),
    ] = None,
    scored: Annotated[
        bool, option("--scored", "Leave out the first three steps, as the table of scores does.")
    ] = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Write estimate, truth and odometry of a saved run as files for other tools, without filtering again."""
    from ..app.convert import export as export_run

    with listening() as listener:
        exported = export_run(run, files, only=only, scored=scored, force=force, listener=listener)
    if json_output:
        print_json({"runs": [exported]})
        return
    for file in exported.files:
        results.print(str(file), soft_wrap=True)


def build(
    recording: Annotated[Path, argument("RECORDING", "A recording with scans and true poses.")],
    *,
    output: Annotated[Path, opt.writes("DIR", "The folder to write map.yaml and map.pgm to.")],
    until: Annotated[
        float,
        option(
            "--until",
            "Use only this share of the scans, the first ones: what comes after is fair for a filter.",
            metavar="SHARE",
        ),
    ] = 1.0,
    cell: Annotated[
        float, option("--cell", "Side of a cell: larger ones for a large map.", metavar="METERS")
    ] = CELL_M,
    reading: opt.ReadingSet,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Build a map (free, occupied, unknown) from a laser's scans with true poses, as ROS's map.yaml."""
    from ..app.convert import build_map

    with listening() as listener:
        built = build_map(
            recording,
            output,
            until=until,
            cell_m=cell,
            reading=reading.options(),
            force=force,
            listener=listener,
        )
    if json_output:
        print_json(built)
        return
    facts = built.to_json()
    width_m, height_m = facts["size_m"]
    counts = f"{built.scans} of {built.of_scans} scans"
    size = (
        f"{width_m:.1f} x {height_m:.1f} m in cells of {facts['cell_m']:g} m, {facts['free_m2']:.0f} m² free"
    )
    results.print(f"{built.file}: {counts}, {size}", soft_wrap=True)


def pictures(
    folder: Annotated[
        str, argument("FOLDER|VIDEO", "The folder of the table's pictures, or a video: one row per frame.")
    ],
    poses: Annotated[Path, option("--poses", "A table with one row per picture.", metavar="FILE.csv")],
    output: Annotated[Path, opt.writes("DIR", "The folder to write.")],
    reading: opt.ReadingPairs = None,
    map_lines: opt.MapFile = None,
    map_unit: opt.MapUnit = "mm",
    every: Annotated[
        int, option("--every", "Put one in this many runs of equal poses into the session.", min=2)
    ] = 10,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Split pictures with known poses into a survey log and a session log.

    The odometry is made from the steps between poses plus noise; the session's header notes this.
    """
    summary = import_pictures(
        folder,
        poses,
        output,
        reading_of(reading),
        map_lines=map_lines,
        map_unit=map_unit,
        every=every,
        force=force,
    )
    if json_output:
        print_json(summary)
    else:
        _report(summary)


def _report(summary: ImportSummary) -> None:
    lines = [
        f"{summary.session}: a drive of {summary.session_pictures} steps, at {summary.session_runs} of "
        f"{summary.runs} places",
        f"{summary.survey}: {summary.library_pictures} references; {summary.guarded_runs} places left out, "
        "too close to the drive's",
        f"a session picture is {summary.nearest_reference_median_m:.2f} m from the nearest reference "
        f"(median; at most {summary.nearest_reference_max_m:.2f} m)",
    ]
    results.say("\n".join(lines))
    for text in summary.warnings:
        note(f"warning: {text}")
    for text in summary.notes:
        note(f"note: {text}")
    note(f"now try: maurice-replay compare {summary.session}")
