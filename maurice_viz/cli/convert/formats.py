"""`maurice-replay formats`: what can be read, and what a file is taken for."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from maurice_loaders.formats.registry import Format, chosen
from maurice_loaders.formats.registry import formats as all_formats
from maurice_loaders.reading import ReadingOptions

from ..console import results
from ..errors import one_line_errors
from ..options import JsonOption

NEEDED = {"ros": "rosbags"}  # what an extra brings


def formats(
    path: Annotated[
        Path | None, typer.Argument(help="Say what this file or folder is taken for.", show_default=False)
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """List the formats of recordings that can be read, or tell a file's."""
    with one_line_errors():
        found = list(all_formats().values()) if path is None else [chosen(path, ReadingOptions())]
    if json_output:
        results.print_json(json.dumps([_facts(one) for one in found]))
        return
    table = Table(show_header=path is None)
    for title in ("format", "what", "needs"):
        table.add_column(title, overflow="fold")
    for one in found:
        table.add_row(one.name, one.what, _needs(one))
    results.print(table)


def _facts(one: Format) -> dict[str, object]:
    return {"name": one.name, "what": one.what, "extra": one.extra, "installed": not _needs(one)}


def _needs(one: Format) -> str:
    """Say how to install what a format needs; nothing where it is there."""
    if one.extra is None or find_spec(NEEDED.get(one.extra, one.extra)) is not None:
        return ""
    return f"pip install 'maurice-replay[{one.extra}]'"
