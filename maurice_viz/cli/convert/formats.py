"""`maurice-replay formats`: the formats that can be read, and the one of a file."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ...app.inspect import FormatInfo
from ...app.inspect import formats as find_formats
from ..console import results
from ..errors import one_line_errors
from ..options import JsonOption


def formats(
    path: Annotated[
        Path | None, typer.Argument(help="Detect the format of this file or folder.", show_default=False)
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """List the formats of recordings that can be read, or detect a file's."""
    with one_line_errors():
        found = find_formats(path)
    if json_output:
        results.print_json(json.dumps([asdict(one) for one in found]))
        return
    table = Table(show_header=path is None)
    for title in ("format", "what", "needs"):
        table.add_column(title, overflow="fold")
    for one in found:
        table.add_row(one.name, one.what, _needs(one))
    results.print(table)


def _needs(one: FormatInfo) -> str:
    """Return the command that installs what a format needs; nothing where it is there."""
    return "" if one.installed else f"pip install 'maurice-replay[{one.extra}]'"
