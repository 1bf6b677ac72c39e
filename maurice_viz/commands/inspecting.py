"""`maurice-replay inspect SESSION`: what is in a log, and what is wrong with it."""

from __future__ import annotations

import json
from dataclasses import asdict

from rich.table import Table

from maurice_loaders.inspection import Inspection, inspect_session

from ..console import results
from .failing import one_line_errors
from .options import JsonOption, SessionArgument


def inspect(session: SessionArgument, json_output: JsonOption = False) -> None:
    """Say what a session or survey log holds: counts, rates, spans, pictures, truth or not, problems."""
    with one_line_errors():
        found = inspect_session(session)
    if json_output:
        results.print_json(json.dumps(asdict(found)))
        return
    results.print(_table(found))
    for text in (*found.warnings, *found.problems):
        results.print(text, markup=False)
    if found.problem_count > len(found.problems):
        results.print(f"... and {found.problem_count - len(found.problems)} more problems", markup=False)


def _table(found: Inspection) -> Table:
    table = Table(title=f"{found.kind} {found.name}", title_justify="left", show_header=False)
    for name, value in _rows(found):
        table.add_row(name, value)
    return table


def _rows(found: Inspection) -> list[tuple[str, str]]:
    events = ", ".join(dict.fromkeys(found.events)) or "none"
    survey = "none named" if found.survey is None else found.survey
    return [
        ("file", found.path),
        ("records", ", ".join(f"{count} {kind}" for kind, count in found.records.items()) or "none"),
        ("duration (s)", f"{found.duration_s:.1f}"),
        ("picture rate (Hz)", _number(found.picture_rate_hz, 2)),
        ("odometry rate (Hz)", _number(found.odometry_rate_hz, 2)),
        ("pictures", ", ".join(f"{count} {kind}" for kind, count in found.pictures.items()) or "none"),
        ("cameras", ", ".join(found.cameras) or "none described"),
        ("way by odometry (m)", _number(found.distance_odometry_m, 2)),
        ("way by truth (m)", _number(found.distance_truth_m, 2)),
        ("pictures with truth", "-" if found.truth_share is None else f"{found.truth_share:.0%}"),
        ("kinds of events", events),
        ("survey or library", survey + ("" if found.survey_found is not False else ", which is not there")),
        ("map", "yes" if found.has_map else "no"),
        ("problems", str(found.problem_count)),
    ]


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
