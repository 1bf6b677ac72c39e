"""`maurice-replay convert IN OUT`: a session of any readable format as a native log, or as ROS 2 messages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from maurice_loaders.errors import LogError
from maurice_loaders.export.drive import convert_to_mcap
from maurice_loaders.export.session import Converted, PictureKind, convert_to_log, records_to_log
from maurice_loaders.formats.registry import OpenOptions
from maurice_loaders.io.findings import Findings
from maurice_loaders.recording import Picture, Recording

from ...app.open import AnySession, as_recorded_session, open_session
from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, KeepGoingOption
from ..reading import reads_recordings

LOG, MCAP = ".log", ".mcap"
PICTURES = ("png", "jpeg")


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be written."""

    target: Path
    pictures: PictureKind
    t_offset_s: float
    force: bool


@reads_recordings
def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", show_default=False, help="A recording of any readable format.")
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", show_default=False, help="A folder, or a name ending in .log or .mcap."
        ),
    ],
    *,
    pictures: Annotated[
        str, typer.Option(help="png: without any loss. jpeg: smaller (quality 95).")
    ] = PICTURES[0],
    t_offset: Annotated[
        float, typer.Option(metavar="SECONDS", help="Add this to every time; the clock is that of IN.")
    ] = 0.0,
    keep_going: KeepGoingOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
    opening: OpenOptions,
) -> None:
    """Write a session as a native log (.log, its pictures beside it) or as MCAP with ROS 2 messages (.mcap).

    What is written is what a replay of IN would see, so that replaying the log gives the same run. Of a
    recording without pictures all odometry, truth and events are written.
    """
    _check(target, pictures, t_offset)
    target = target if target.suffix else target / "session.log"
    wanted = Wanted(target, "jpeg" if pictures == "jpeg" else "png", t_offset, force)
    with one_line_errors():
        opening = replace(opening, keep_going=keep_going)
        session = open_session(source, keep_going=keep_going, opening=opening)
        if target.suffix == MCAP:
            session = as_recorded_session(session, opening)
        findings = Findings(keep_going)
        done = _count(_going(session, wanted, findings, opening), target)
        _remark(session.path, session if done.pictures or target.suffix == MCAP else findings)
    if json_output:
        results.print_json(json.dumps({"file": str(target)} | asdict(done)))
    else:
        counts = f"{done.pictures} pictures, {done.motions} motions, {done.truths} true poses"
        results.print(f"{target}: {counts}, {done.events} events", soft_wrap=True)


def _check(target: Path, pictures: str, t_offset: float) -> None:
    if target.suffix not in (LOG, MCAP, ""):
        raise typer.BadParameter(f"OUT is a folder, or ends in {LOG} or {MCAP}; found {target.name!r}")
    if pictures not in PICTURES:
        raise typer.BadParameter(f"--pictures is {' or '.join(PICTURES)}, found {pictures!r}")
    if not np.isfinite(t_offset):
        raise typer.BadParameter(f"--t-offset is a number of seconds, found {t_offset}")


def _begin(recording: Recording) -> tuple[float, bool]:
    """Give the time of the first record, which a session counts from, and whether any picture comes."""
    first_s: float | None = None
    for record in recording.records(Findings(keep_going=True)):
        first_s = record.t_s if first_s is None else first_s
        if isinstance(record, Picture):
            return first_s, True
    return first_s or 0.0, False


def _going(
    session: AnySession, wanted: Wanted, findings: Findings, opening: OpenOptions
) -> Iterator[Converted]:
    """Convert as a replay sees it, or, where there are no pictures, record by record."""
    target, kind, offset_s, force = wanted.target, wanted.pictures, wanted.t_offset_s, wanted.force
    recorded = as_recorded_session(session, opening)
    if target.suffix == MCAP:
        camera = opening.camera
        return convert_to_mcap(recorded, target, camera=camera, kind=kind, t_offset_s=offset_s, force=force)
    begin_s, pictures = _begin(recorded.recording)
    if not pictures:
        return records_to_log(recorded.recording, target, findings, t_offset_s=offset_s, force=force)
    return convert_to_log(session, target, kind=kind, t_offset_s=begin_s + offset_s, force=force)


def _count(going: Iterator[Converted], target: Path) -> Converted:
    done = Converted()
    try:
        with progress("convert") as advance:
            for done in going:
                advance(done.pictures, done.pictures)
    except ValueError as problem:  # a time that no log may hold, moved too far by --t-offset
        raise LogError(target, str(problem)) from None
    return done


def _remark(path: Path, read: Findings | AnySession) -> None:
    """Say what reading brought to light."""
    for warning in read.warnings:
        note(warning)
    count = read.count if isinstance(read, Findings) else read.problem_count
    if count:
        note(f"{path}: skipped {count} broken records, the first: {read.problems[0]}")
