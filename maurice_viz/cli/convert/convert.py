"""`maurice-replay convert IN OUT`: a session of any readable format as a native log, or as ROS 2 messages."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from ...app.convert import convert as convert_recording
from ..console import listening, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, KeepGoingOption
from ..reading import ReadingOption, reading_of


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
    pictures: Annotated[str, typer.Option(help="png: lossless. jpeg: smaller (quality 95).")] = "png",
    t_offset: Annotated[
        float, typer.Option(metavar="SECONDS", help="Add this to every time; the clock is that of IN.")
    ] = 0.0,
    keep_going: KeepGoingOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
    reading: ReadingOption = None,
) -> None:
    """Write a session as a native log (.log, its pictures beside it) or as MCAP with ROS 2 messages (.mcap).

    The file holds what a replay of IN sees, so that replaying the log gives the same run. Of a recording
    without pictures all odometry, truth and events are written.
    """
    kind: Any = pictures  # checked by the function
    opening = reading_of(reading, keep_going=keep_going)
    with one_line_errors(), listening() as listener:
        file, done = convert_recording(
            source,
            target,
            pictures=kind,
            t_offset_s=t_offset,
            options=opening,
            force=force,
            listener=listener,
        )
    if json_output:
        results.print_json(json.dumps({"file": str(file)} | asdict(done)))
    else:
        counts = f"{done.pictures} pictures, {done.motions} motions, {done.truths} true poses"
        results.print(f"{file}: {counts}, {done.events} events", soft_wrap=True)
