"""`maurice-replay library build|show|tune|check`: reference pictures with poses, used by every run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from maurice_loaders.libraries.store import open_library
from maurice_mcl.library import ChannelIndex, Library

from ...app.library import build_library
from ...listener import progress_of
from ...style import scale_for, units_named
from ..console import listening, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, KeepGoingOption
from ..reading import ReadingOption, reading_of
from .check import LibraryArgument, check, coverage_lines
from .tune import tune

MOST_HEADINGS = 16  # more than this are counted, not listed

library = typer.Typer(
    help="Build a library of reference pictures, show or check one, or tune channels to one.",
    no_args_is_help=True,
)
library.command()(tune)
library.command()(check)


@library.command()
def build(
    survey: Annotated[
        Path,
        typer.Argument(help="A survey log, or any recording of a drive with truth.", show_default=False),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="LIBRARY", help="The folder to write.", show_default=False),
    ],
    every: Annotated[
        str | None,
        typer.Option(
            "--every",
            metavar="LENGTH,ANGLE",
            help="Distance or turn between the entries of a drive: 0.4m,45deg. "
            "[default: that for a drive, and all of a survey log]",
        ),
    ] = None,
    yaw: Annotated[
        float,
        typer.Option(
            "--yaw",
            min=-180,
            max=180,
            help="Yaw of the robot's camera from the survey's camera, in degrees, counter-clockwise.",
        ),
    ] = 0.0,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    reading: ReadingOption = None,
) -> None:
    """Measure every picture of a survey, or some of a drive, and write a self-contained library."""
    opening = reading_of(reading, keep_going=keep_going)
    with one_line_errors(), listening() as listener:
        built, covered = build_library(
            survey,
            output,
            every=every,
            yaw_rad=float(np.radians(yaw)),
            options=opening,
            force=force,
            listener=listener,
        )
    results.print(f"{output}: {built.size} entries, channels {', '.join(built.index)}", soft_wrap=True)
    if covered is not None:
        for line in coverage_lines(covered, scale_for(built.display_units, built.arena)):
            results.print(line, soft_wrap=True)


@library.command()
def show(path: LibraryArgument, json_output: JsonOption = False) -> None:
    """Show what a library holds: entries, places, headings, channels, map."""
    with one_line_errors(), listening() as listener:
        found = open_library(path, progress=progress_of(listener, "library"), warn=listener.warning)
    if json_output:
        results.print_json(json.dumps(_facts(found)))
    else:
        results.print(_table(found))


def _facts(found: Library) -> dict[str, object]:
    """Return what a library holds as JSON, in meters."""
    width_m, depth_m = found.arena.size_m
    places = np.unique(np.round(found.poses[:, :2], 3), axis=0)
    headings = np.unique(np.round(np.rad2deg(found.poses[:, 2]) % 360, 1))
    return {
        "name": found.name,
        "entries": found.size,
        "places": len(places),
        "headings_deg": headings.tolist() if len(headings) <= MOST_HEADINGS else len(headings),
        "pictures_kept": sum(picture is not None for picture in found.pictures),
        "display_units": found.display_units,
        "width_m": width_m,
        "depth_m": depth_m,
        "walls": len(found.arena.walls),
        "obstacles": [region.name for region in found.arena.obstacles],
        "floors": list(dict.fromkeys(region.name for region in found.arena.floors)),
        "channels": {name: _channel_facts(index) for name, index in found.index.items()},
    }


def _channel_facts(index: ChannelIndex) -> dict[str, float]:
    return {
        "length": len(index.relevance),
        "noise_floor_peak": float(index.noise_floor.max()),
        "relevance_peak": float(index.relevance.max()),
    }


def _table(found: Library) -> Table:
    facts, units = _facts(found), units_named(found.display_units)
    table = Table(title=f"library {found.name}", title_justify="left", show_header=False)
    headings = facts["headings_deg"]
    named = ", ".join(f"{h:g}" for h in headings) if isinstance(headings, list) else str(headings)
    width, depth = (length * units.per_m for length in found.arena.size_m)
    table.add_row("entries", f"{found.size} pictures with a pose, {facts['pictures_kept']} of them kept here")
    table.add_row("places", str(facts["places"]))
    table.add_row("headings (deg)", named)
    table.add_row(f"map ({units.name})", f"{width:.{units.digits}f} x {depth:.{units.digits}f}")
    table.add_row("walls", str(facts["walls"]))
    table.add_row("obstacles", ", ".join(region.name for region in found.arena.obstacles) or "none")
    table.add_row("floors", ", ".join(dict.fromkeys(r.name for r in found.arena.floors)) or "none named")
    for name, index in found.index.items():
        channel = _channel_facts(index)
        table.add_row(
            f"channel {name}",
            f"{channel['length']:.0f} bins, noise floor up to {channel['noise_floor_peak']:.1f}, "
            f"relevance up to {channel['relevance_peak']:.1f} (256 x share of pixels)",
        )
    return table
