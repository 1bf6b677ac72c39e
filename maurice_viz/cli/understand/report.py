"""`maurice-replay report RUN -o report.html`: one self-contained page about a saved run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..console import listening, results
from ..errors import one_line_errors
from ..options import ForceOption

RunArgument = Annotated[
    Path,
    typer.Argument(metavar="RUN", show_default=False, help="A saved run's folder, or a comparison's."),
]
PageOption = Annotated[Path, typer.Option("-o", "--output", metavar="OUT.html", help="The page to write.")]


def report(run: RunArgument, output: PageOption = Path("report.html"), force: ForceOption = False) -> None:
    """Write one self-contained page about a saved run: summary, map, traces, events, configuration."""
    from ...reports.make import report as write_report  # jinja2 and the drawings are needed only here

    with one_line_errors(), listening() as listener:
        file = write_report(run, output, force=force, listener=listener)
    results.print(str(file), soft_wrap=True)
