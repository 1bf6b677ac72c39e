"""`maurice-replay library tune`: scales and weights of channels, fitted to a library and its robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ...app.library import TuningResult
from ...app.library import tune as tune_channels
from ..console import listening, note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, KeepGoingOption
from .check import LibraryArgument


def tune(
    library: LibraryArgument,
    session: Annotated[
        list[Path] | None,
        typer.Option("--session", metavar="FIT.log", help="A drive with truth to fit on; may be repeated."),
    ] = None,
    score: Annotated[
        list[Path] | None,
        typer.Option("--score", metavar="TEST.log", help="A drive with truth to score on; may be repeated."),
    ] = None,
    channels: Annotated[
        str | None,
        typer.Option("--channels", metavar="A,B,C", help="Fit these. [default: all of the library]"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="TUNED.toml", help="Write the result here.")
    ] = None,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    json_output: JsonOption = False,
) -> None:
    """Fit scales and weights of channels by log score, on drives with truth or on the library alone."""
    with one_line_errors(), listening() as listener:
        found = tune_channels(
            library,
            sessions=session or (),
            score=score or (),
            channels=None if channels is None else channels.split(","),
            to=output,
            keep_going=keep_going,
            force=force,
            listener=listener,
        )
    if json_output:
        results.print_json(json.dumps(found.to_json()))
        return
    results.print(_table(found))
    if output is None:
        typer.echo(found.to_toml(), nl=False)
    else:
        note(f"{output} written; now try: maurice-replay SESSION --config {output}")


def _table(report: TuningResult) -> Table:
    """Return a table with one row per channel, then the blends."""
    table = Table(title=f"library {report.library}", title_justify="left", caption=report.gain)
    for name in ("", "distance", "scale", "weight", "log score, fitted"):
        table.add_column(name, justify="left" if name in ("", "distance") else "right")
    sets = [report.fitted]
    if report.scored is not None:
        table.add_column("log score, scored", justify="right")
        sets.append(report.scored)
    for k, name in enumerate(report.tuned.channels):
        weight = report.weights.get(name)
        shown = "-" if weight is None else f"{weight:g}"
        cells = [name, report.distances[name], f"{report.scales[name]:g}", shown]
        table.add_row(*cells, *(f"{s.alone[k]:.3f}" for s in sets))
    table.add_section()
    table.add_row("tuned blend", "", "", "", *(f"{s.together:.3f}" for s in sets))
    table.add_row("default blend", "", "", "", *(f"{s.before:.3f}" for s in sets))
    table.add_row("knowing nothing", "", "", "", *(f"{s.blind:.3f}" for s in sets))
    table.add_row("pictures", "", "", "", *(str(s.pictures) for s in sets))
    return table
