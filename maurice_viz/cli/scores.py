"""Printing scores: a table for people, JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from ..app.run import Report, RunScores
from ..playback import RunResult
from ..style import Units, units_named
from ..text.summary import paired_rows, score_rows
from .console import TO_CONSOLE, results


def printed(json_output: bool) -> Report:
    """Return what prints scores as JSON or as a table."""

    def report(scores: RunScores) -> None:
        TO_CONSOLE.end()
        if json_output:
            results.print_json(json.dumps(scores.to_json()))
        else:
            results.print(to_table(scores.runs, units_named(scores.display_units), scores.name))

    return report


def to_table(results: Sequence[RunResult], units: Units, title: str) -> Table:
    """Return a table of scores with one column per run, in the session's own units."""
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    table.add_column("")
    for result in results:
        table.add_column(result.label, justify="right")
    for rows in (score_rows(results, units), paired_rows(results, units)):
        for name, cells in rows:
            table.add_row(name, *cells)
        table.add_section()
    return table
