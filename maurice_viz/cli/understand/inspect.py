"""`maurice-replay inspect SESSION`: what is in a log, and what is wrong with it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

from rich.table import Table

from maurice_loaders.formats.registry import NATIVE, chosen, open_recording
from maurice_loaders.inspection.overview import Inspection, inspect_recording, inspect_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recorded_session import RecordedSession

from ..console import results
from ..errors import one_line_errors
from ..options import JsonOption, SessionArgument
from ..reading import reads_recordings


@reads_recordings
def inspect(session: SessionArgument, *, json_output: JsonOption = False, opening: ReadingOptions) -> None:
    """Say what a session, a survey log or a recording holds: counts, rates, spans, pictures, problems."""
    with one_line_errors():
        format_name, found = _inspected(session, replace(opening, keep_going=True))
    if json_output:
        results.print_json(json.dumps({"format": format_name} | asdict(found)))
        return
    results.print(_table(found, format_name))
    for text in (*found.warnings, *found.problems):
        results.print(text)
    if found.problem_count > len(found.problems):
        results.print(f"... and {found.problem_count - len(found.problems)} more problems")


def _inspected(path: Path, opening: ReadingOptions) -> tuple[str, Inspection]:
    """Look a file over by its format, and name that."""
    one = chosen(path, opening)
    if one.name == NATIVE and opening.as_it_is:
        return one.name, inspect_session(path)
    recording = open_recording(path, replace(opening, format=one.name))
    return one.name, inspect_recording(RecordedSession(recording, opening))


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
