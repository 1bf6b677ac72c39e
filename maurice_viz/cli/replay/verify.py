"""`maurice-replay verify RUN`: filter a saved run again and compare it to the last bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ...app.saved import verify as verify_run
from ..console import listening, results
from ..errors import one_line_errors
from ..options import JsonOption

RunArgument = Annotated[
    Path, typer.Argument(help="A saved run's folder, or a comparison's.", show_default=False, metavar="RUN")
]


def verify(run: RunArgument, json_output: JsonOption = False) -> None:
    """Filter a saved run again; exit status 0 when every step is the same to the last bit, else 1."""
    with one_line_errors(), listening() as listener:
        verdicts = verify_run(run, listener=listener)
    if json_output:
        results.print_json(json.dumps({"runs": [verdict.to_json() for verdict in verdicts]}))
    else:
        for verdict in verdicts:
            results.print(str(verdict), soft_wrap=True)
    if not all(verdict.same for verdict in verdicts):
        raise typer.Exit(1)
