"""`maurice-replay import pictures`: a survey and a session from pictures and a table of poses."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.importing.pictures import ImportOptions, ImportSummary, import_pictures
from maurice_loaders.importing.pose_table import Columns

from ..console import note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

imports = typer.Typer(help="Turn other people's data into session and survey logs.", no_args_is_help=True)

DEFAULTS = ImportOptions()
COLUMNS = Columns()


@imports.callback()
def _root() -> None:
    """Keep `pictures` a command of its own, although it is the only one."""


@imports.command()
def pictures(
    folder: Annotated[str, typer.Argument(help="The folder that the table's picture names start from.")],
    poses: Annotated[
        Path, typer.Option("--poses", metavar="FILE.csv", help="A table with one row per picture.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="The folder to write.")],
    image_column: Annotated[str, typer.Option(help="Column of picture names.")] = COLUMNS.image,
    x_column: Annotated[str, typer.Option(help="Column of x in meters.")] = COLUMNS.x,
    y_column: Annotated[str, typer.Option(help="Column of y in meters.")] = COLUMNS.y,
    heading_column: Annotated[
        str, typer.Option(help="Column of headings, counter-clockwise from +x.")
    ] = COLUMNS.heading,
    heading_unit: Annotated[
        str | None, typer.Option(help="deg or rad. [default: by the suffix of the column's name]")
    ] = None,
    map_lines: Annotated[
        Path | None, typer.Option("--map", metavar="FILE", help="Wall segments, x1 y1 x2 y2 per line.")
    ] = None,
    map_unit: Annotated[str, typer.Option(help="Unit of the wall segments: mm or m.")] = DEFAULTS.map_unit,
    name: Annotated[str | None, typer.Option(help="Name of the place. [default: the table's folder]")] = None,
    every: Annotated[
        int, typer.Option(min=2, help="Of this many runs of equal poses one goes to the session.")
    ] = DEFAULTS.session_every,
    guard: Annotated[
        float, typer.Option(min=0.0, help="Meters around session poses without library pictures.")
    ] = DEFAULTS.guard_m,
    session_pictures: Annotated[
        int, typer.Option(min=1, help="Most pictures of a run in the session.")
    ] = DEFAULTS.session_pictures,
    library_pictures: Annotated[
        int, typer.Option(min=1, help="Most pictures of a run in the library.")
    ] = DEFAULTS.library_pictures,
    seed: Annotated[
        int, typer.Option(min=0, max=2**32 - 1, help="Seed of the odometry's noise.")
    ] = DEFAULTS.seed,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Split a folder of pictures with known poses into a survey log and a session log.

    The odometry is made from the steps between poses plus noise; the session's header notes this.
    """
    for value, known, option in (
        (heading_unit, (None, "deg", "rad"), "--heading-unit"),
        (map_unit, ("mm", "m"), "--map-unit"),
    ):
        if value not in known:
            raise typer.BadParameter(f"{option} is {' or '.join(k for k in known if k)}, found {value!r}")
    options = ImportOptions(
        columns=Columns(image_column, x_column, y_column, heading_column, heading_unit),
        name=name,
        map_lines=map_lines,
        map_unit=map_unit,
        session_every=every,
        session_pictures=session_pictures,
        library_pictures=library_pictures,
        guard_m=guard,
        seed=seed,
    )
    with one_line_errors():
        summary = import_pictures(folder, poses, output, options, force=force)
    if json_output:
        results.print_json(json.dumps(asdict(summary), default=str))
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
