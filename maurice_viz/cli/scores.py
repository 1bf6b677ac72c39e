"""Printing scores: a table for people, JSON for programs."""

from __future__ import annotations

import json

from ..app.run import Report, RunScores
from ..style import units_named
from ..text.summary import to_table
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
