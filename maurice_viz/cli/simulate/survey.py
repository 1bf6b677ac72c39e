"""`maurice-replay survey`: the reference set of a simulated world, and a sheet of views of it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated

import typer

from ..console import listening, note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

MOST_SEED = 2**32 - 1
METERS = {"in": 0.0254, "ft": 0.3048, "m": 1.0, "cm": 0.01}

OutputOption = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DIR", help="Write the survey to this folder.")
]
WorldOption = Annotated[str, typer.Option("--world", help="A world's name, or the path of a TOML file.")]
TierOption = Annotated[str, typer.Option("--tier", help="nominal | dim | hard.")]
SeedOption = Annotated[
    int,
    typer.Option(
        "--arena-seed", min=0, max=MOST_SEED, help="Seed of textures, furniture, lights and the survey."
    ),
]
SpacingOption = Annotated[
    str | None,
    typer.Option("--spacing", help="Distance between nodes, like 18in or 0.6m. [default: the world's]"),
]
HeadingsOption = Annotated[
    int | None,
    typer.Option("--headings", min=1, max=360, help="References per node. [default: the world's]"),
]
HalfOption = Annotated[
    bool,
    typer.Option("--half-resolution", help="Read only every other column, as the CMUcam2 does."),
]
SheetOption = Annotated[
    Path | None,
    typer.Option("--contact-sheet", metavar="OUT.png", help="Draw 24 views of the world (.png or .jpg)."),
]


def read_length(text: str) -> float:
    """Read a length like 18in, 0.6m, 45cm or 1.5ft in meters; ValueError for other words."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(in|ft|cm|m)\s*", text)
    length = float(found[1]) * METERS[found[2]] if found else 0.0
    if not 0.02 <= length <= 1000:
        raise ValueError(f"--spacing is a length from 2 cm like 18in, 45cm, 0.6m or 1.5ft, found {text!r}")
    return length


def survey(
    output: OutputOption = None,
    world: WorldOption = "two-rooms",
    tier: TierOption = "nominal",
    arena_seed: SeedOption = 0,
    spacing: SpacingOption = None,
    headings: HeadingsOption = None,
    contact_sheet: SheetOption = None,
    half_resolution: HalfOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Take the reference pictures of a simulated world, and some with the lens covered."""
    if output is None and contact_sheet is None:
        raise typer.BadParameter("give -o DIR, or --contact-sheet OUT.png, or both")
    if contact_sheet is not None and contact_sheet.suffix not in (".png", ".jpg"):
        raise typer.BadParameter(f"--contact-sheet ends in .png or .jpg, found {str(contact_sheet)!r}")
    try:
        spacing_m = None if spacing is None else read_length(spacing)
    except ValueError as problem:
        raise typer.BadParameter(str(problem)) from None
    from maurice_datasets.surveys import surveyed_world, write_survey_folder

    from ...plots.sheets import write_contact_sheet

    made: dict[str, object] = {}
    with one_line_errors(), listening() as listener:
        drawn = surveyed_world(world, arena_seed, tier, spacing_m, headings)
        if contact_sheet is not None:
            write_contact_sheet(
                contact_sheet,
                drawn,
                arena_seed,
                half_resolution=half_resolution,
                force=force,
                progress=listener.progress,
            )
            made["contact_sheet"] = str(contact_sheet)
        if output is not None:
            log = write_survey_folder(
                output,
                drawn,
                arena_seed,
                half_resolution=half_resolution,
                force=force,
                progress=listener.progress,
            )
            made |= {"survey": str(log), "references": len(drawn.nodes) * drawn.headings}
    if json_output:
        results.print_json(json.dumps(made))
        return
    results.print("\n".join(str(path) for key, path in made.items() if key != "references"))
    if output is not None:
        note(f"now try: maurice-replay library build {made['survey']} -o LIBRARY")
