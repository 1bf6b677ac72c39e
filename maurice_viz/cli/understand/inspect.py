"""`maurice-replay inspect SESSION`: what a recording holds, and its problems."""

from __future__ import annotations

import json
from dataclasses import asdict

from rich.table import Table

from maurice_loaders.inspection.overview import Inspection

from ...app.inspect import inspect as inspect_recording
from ..console import results
from ..errors import one_line_errors
from ..options import JsonOption, SessionArgument
from ..reading import ReadingOption, reading_of


def inspect(session: SessionArgument, json_output: JsonOption = False, reading: ReadingOption = None) -> None:
    """Show what a session, a survey log or a recording holds: counts, rates, spans, pictures, problems."""
    opening = reading_of(reading)
    with one_line_errors():
        format_name, found = inspect_recording(session, options=opening)
    if json_output:
        results.print_json(json.dumps({"format": format_name} | asdict(found)))
        return
    results.print(_table(found, format_name))
    for text in (*found.warnings, *found.problems):
        results.print(text)
    if found.problem_count > len(found.problems):
        results.print(f"... and {found.problem_count - len(found.problems)} more problems")


def _table(found: Inspection, format_name: str) -> Table:
    table = Table(title=f"{found.kind} {found.name}", title_justify="left", show_header=False)
    table.add_row("format", format_name)
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
        ("distance by odometry (m)", _number(found.distance_odometry_m, 2)),
        ("distance by truth (m)", _number(found.distance_truth_m, 2)),
        ("pictures with truth", "-" if found.truth_share is None else f"{found.truth_share:.0%}"),
        ("kinds of events", events),
        ("survey or library", survey + ("" if found.survey_found is not False else ", which is not there")),
        ("map", "yes" if found.has_map else "no"),
        ("problems", str(found.problem_count)),
    ]


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
