"""`maurice-replay library build|show|tune`: reference pictures with poses, made once, used by every run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from maurice_loaders.library_store import build_library, open_library, save_library
from maurice_mcl.library import ChannelIndex, Library

from ..console import note, progress, results
from ..look import units_named
from .failing import one_line_errors
from .library_tune import tune_library
from .options import ForceOption, JsonOption, KeepGoingOption

MOST_HEADINGS = 16  # more than this are counted, not listed

library = typer.Typer(
    help="Build a library of reference pictures from a survey, show one, or tune channels to one.",
    no_args_is_help=True,
)
library.command(name="tune")(tune_library)


@library.command()
def build(
    survey: Annotated[Path, typer.Argument(help="A survey log.", show_default=False)],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="LIBRARY", help="The folder to write.", show_default=False),
    ],
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
) -> None:
    """Measure every picture of a survey and write a library folder that stands alone."""
    with one_line_errors():
        with progress("library") as advance:
            built = build_library(survey, keep_going=keep_going, progress=advance, warn=note)
        save_library(built, output, force=force)
    results.print(f"{output}: {built.size} entries, channels {', '.join(built.index)}", markup=False)


@library.command()
def show(
    path: Annotated[Path, typer.Argument(help="A library folder or a survey log.", show_default=False)],
    json_output: JsonOption = False,
) -> None:
    """Say what a library holds: entries, places, headings, channels, map."""
    with one_line_errors(), progress("library") as advance:
        found = open_library(path, progress=advance, warn=note)
    if json_output:
        results.print_json(json.dumps(_facts(found)))
    else:
        results.print(_table(found))


def _facts(found: Library) -> dict[str, object]:
    """What there is to say about a library, as JSON in metres."""
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
