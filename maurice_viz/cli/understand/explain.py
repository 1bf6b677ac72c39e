"""`maurice-replay explain RUN`: one update of a saved run, and why its references are believed or not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ..console import listening, results
from ..convert.export import RunArgument, RunLabelOption
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, RrdOption

MORE = "One more reference"


def explain(
    run: RunArgument,
    step: Annotated[
        int | None, typer.Option("--step", min=1, help="Which update. [default: the last one]")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at",
            metavar="X,Y,HEADING",
            help="Explain this pose too, in display units and degrees.",
            rich_help_panel=MORE,
        ),
    ] = None,
    entry: Annotated[
        int | None,
        typer.Option("--entry", min=0, help="Explain this library entry too.", rich_help_panel=MORE),
    ] = None,
    particle: Annotated[
        int | None,
        typer.Option(
            "--particle",
            min=0,
            help="Explain this particle too, by its number in the saved cloud.",
            rich_help_panel=MORE,
        ),
    ] = None,
    run_label: RunLabelOption = None,
    rrd: RrdOption = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="OUT.png", help="Write a picture of the panel to this file."),
    ] = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Explain and show why the filter believed what it believed at one update of a saved run."""
    from ...app.explain import check_picture, record, show
    from ...app.explain import explain as explain_run

    with one_line_errors(), listening() as listener:
        if output is not None:
            check_picture(output, force=force)
        found = explain_run(
            run, step, at=at, entry=entry, particle=particle, run_label=run_label, listener=listener
        )
        if json_output:
            results.print_json(json.dumps(found.to_json()))
        else:
            typer.echo(found.text)
        if output is not None:
            found.save(output, force=force)
            listener.remark(f"{output} written")
        usual = Path(f"{run.absolute().stem}-step-{found.step.step}.rrd")
        if rrd is None and output is None:
            show(found, usual, force=force, listener=listener)
        elif rrd not in (None, "none"):
            record(found, usual if rrd == "auto" else Path(str(rrd)), force=force, listener=listener)
