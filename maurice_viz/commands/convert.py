"""`maurice-replay convert IN OUT`: a session of any readable format as a native log, or as ROS 2 messages."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
import typer

from maurice_loaders.export_session import Converted, PictureKind, convert_to_log, convert_to_mcap
from maurice_loaders.findings import Findings
from maurice_loaders.formats import OpenOptions, open_recording, open_session
from maurice_loaders.recorded_session import RecordedSession
from maurice_loaders.session_log import SessionLog

from ..console import note, progress, results
from .failing import one_line_errors
from .options import ForceOption, JsonOption, KeepGoingOption

WRITERS: dict[str, Callable[..., Iterator[Converted]]] = {".log": convert_to_log, ".mcap": convert_to_mcap}
PICTURES = ("png", "jpeg")


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", show_default=False, help="A recording of any readable format.")
    ],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", show_default=False, help="A name ending in .log or .mcap.")
    ],
    format_name: Annotated[
        str | None, typer.Option("--format", help="The format of IN, where the guess is wrong.")
    ] = None,
    camera: Annotated[
        str | None, typer.Option(help="Whose pictures, where there are several cameras.")
    ] = None,
    pictures: Annotated[
        str, typer.Option(help="png: without any loss. jpeg: smaller (quality 95).")
    ] = PICTURES[0],
    t_offset: Annotated[
        float, typer.Option(metavar="SECONDS", help="Add this to every time; the clock is that of IN.")
    ] = 0.0,
    keep_going: KeepGoingOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Write a session as a native log (.log, its pictures beside it) or as MCAP with ROS 2 messages (.mcap).

    What is written is what a replay of IN would see, so that replaying the log gives the same run.
    """
    _check(target, pictures, t_offset)
    options = OpenOptions(format=format_name, camera=camera, keep_going=keep_going)
    with one_line_errors():
        session = open_session(source, options)
        offset_s = t_offset + first_time(source, options)
        kind = cast(Literal["png", "jpeg"], pictures)
        done = _convert(session, target, kind, offset_s, force)
        _remark(session)
    if json_output:
        results.print_json(json.dumps({"file": str(target)} | asdict(done)))
    else:
        counts = f"{done.pictures} pictures, {done.motions} motions, {done.truths} true poses"
        results.print(f"{target}: {counts}, {done.events} events", markup=False, soft_wrap=True)


def _check(target: Path, pictures: str, t_offset: float) -> None:
    if target.suffix not in WRITERS:
        raise typer.BadParameter(f"OUT ends in {' or '.join(WRITERS)}, found {target.name!r}")
    if pictures not in PICTURES:
        raise typer.BadParameter(f"--pictures is {' or '.join(PICTURES)}, found {pictures!r}")
    if not np.isfinite(t_offset):
        raise typer.BadParameter(f"--t-offset is a number of seconds, found {t_offset}")


def first_time(source: Path, options: OpenOptions) -> float:
    """Give the time of a recording's first record, which a session counts from; 0 when there is none."""
    records = open_recording(source, options).records(Findings(keep_going=True))
    return next((record.t_s for record in records), 0.0)


def _convert(
    session: SessionLog | RecordedSession, target: Path, kind: PictureKind, offset_s: float, force: bool
) -> Converted:
    done = Converted()
    options: dict[str, Any] = {"kind": kind, "t_offset_s": offset_s, "force": force}
    with progress("convert") as advance:
        for done in WRITERS[target.suffix](session, target, **options):
            advance(done.pictures, done.pictures)
    return done


def _remark(session: SessionLog | RecordedSession) -> None:
    """Say what reading brought to light."""
    for warning in session.warnings:
        note(warning)
    if session.problem_count:
        first = session.problems[0]
        note(f"{session.path}: skipped {session.problem_count} broken records, the first: {first}")
