"""`maurice-replay report RUN -o report.html`: one page about a saved run that stands alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.io.files import expect_absent, write_whole

from ..console import results
from ..errors import one_line_errors
from ..options import ForceOption

RunArgument = Annotated[
    Path,
    typer.Argument(metavar="RUN", show_default=False, help="A saved run's folder, or a comparison's."),
]
PageOption = Annotated[Path, typer.Option("-o", "--output", metavar="OUT.html", help="The page to write.")]


def report(folder: RunArgument, output: PageOption = Path("report.html"), force: ForceOption = False) -> None:
    """Write one self-contained page about a saved run: summary, map, traces, events, configuration."""
    if output.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"{output.name!r} should end in .html")
    with one_line_errors():
        expect_absent(output, force=force)
        from ...app.saved import open_saved
        from ...reports.make import html_report

        page = html_report(open_saved(folder), folder)
        write_whole(output, page.encode(), force=force)
    results.print(str(output), soft_wrap=True)
