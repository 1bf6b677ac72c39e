"""`maurice-replay inspect|doctor`: what a recording or a saved run holds, what is wrong and what fixes it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from maurice_loaders.doctor.examination import Examination, odometry_advice
from maurice_loaders.doctor.fixing import fixed_options
from maurice_loaders.doctor.inspection import Inspection
from maurice_loaders.files.ros_maps import ENDINGS
from maurice_loaders.runs.manifest import is_saved
from maurice_mcl.scoring.events import KINDS, RunEvent

from ..app.inspect import doctor as diagnose
from ..app.inspect import events, formats
from ..app.inspect import inspect as inspect_recording
from ..style import Units, units_named
from ..text.findings import describe, evidence_for, fix_for
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import option
from .shared.values import reading_of

ALL_RUNS = "all"  # in a table: an event that every run of a comparison has
Options = Sequence[Sequence[str]]  # as typed: what fixes each finding, and last what fixes all; or nothing


def inspect(
    path: Annotated[
        Path | None,
        opt.argument(
            "SESSION|SURVEY|RUN",
            "A recording of any format, a survey log, or a saved run, whose events are listed. "
            "[default: lists the formats that can be read]",
        ),
    ] = None,
    json_output: opt.Json = False,
    reading: opt.ReadingPairs = None,
) -> None:
    """List what a recording holds: format, counts, rates, pictures, problems; or a saved run's events."""
    if path is None:
        _print_formats(json_output)
    elif is_saved(path):
        _print_events(path, json_output)
    else:
        _print_contents(path, json_output, reading)


def _print_formats(json_output: bool) -> None:
    readable = formats()
    if json_output:
        print_json(readable)
        return
    table = Table()
    for title in ("format", "what", "needs"):
        table.add_column(title, overflow="fold")
    for format_info in readable:
        needs = "" if format_info.installed else f"pip install 'maurice-replay[{format_info.extra}]'"
        table.add_row(format_info.name, format_info.what, needs)
    results.print(table)


def _print_contents(path: Path, json_output: bool, reading: list[str] | None) -> None:
    inspected = inspect_recording(path, reading=reading_of(reading))
    if json_output:
        print_json(inspected)
        return
    contents = inspected.contents
    table = Table(title=f"{contents.kind} {contents.name}", title_justify="left", show_header=False)
    for row in (("format", inspected.format), *_rows(contents)):
        table.add_row(*row)
    results.print(table)
    for text in (*contents.warnings, *contents.problems):
        results.say(text)
    if contents.problem_count > len(contents.problems):
        results.print(f"... and {contents.problem_count - len(contents.problems)} more problems")


def _print_events(run: Path, json_output: bool) -> None:
    """Print what happened in a saved run; JSON has routine events too: resampling, a new floor."""
    happened = events(run, routine=json_output)
    if json_output:
        print_json(happened)
    elif any(each.events for each in happened.runs):
        results.print(_event_table({each.label: each.events for each in happened.runs}, happened.session))
    else:
        note(f"{run}: nothing happened but routine")


def _event_table(by_run: dict[str, Sequence[RunEvent]], title: str) -> Table:
    """Return a table with one row per event, by step, and a column for the run where there are several."""
    shown = Text(title, no_wrap=True, overflow="ignore")
    table = Table(
        title=shown,
        title_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    several = len(by_run) > 1
    for name in ("step", "time (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("run", "event") if several else ("event",):
        table.add_column(name, no_wrap=True)
    table.add_column("what")
    for event, labels in _by_event(by_run):
        who = ALL_RUNS if len(labels) == len(by_run) else ", ".join(labels)
        row = [str(event.step), f"{event.time_s:.1f}", *([who] if several else []), event.kind, event.text]
        table.add_row(*map(Text, row))
    return table


def _by_event(by_run: dict[str, Sequence[RunEvent]]) -> list[tuple[RunEvent, list[str]]]:
    """Join equal events of several runs, in the order of steps and kinds."""
    labels: dict[RunEvent, list[str]] = {}
    for label, some in by_run.items():
        for event in dict.fromkeys(some):
            labels.setdefault(event, []).append(label)
    order = list(KINDS)
    return sorted(labels.items(), key=lambda item: (item[0].step, order.index(item[0].kind)))


OF_CAMERAS = (
    "picture rate (Hz)",
    "pictures",
    "cameras",
)  # rows that say nothing of a robot with a laser alone


def _rows(contents: Inspection) -> list[tuple[str, str]]:
    events = ", ".join(dict.fromkeys(contents.events)) or "none"
    survey = "none named" if contents.survey is None else contents.survey
    units = units_named(contents.display_units)
    is_laser = bool(contents.scans) and not contents.pictures
    rows = [
        ("file", contents.path),
        ("records", ", ".join(f"{count} {kind}" for kind, count in contents.records.items()) or "none"),
        ("duration (s)", f"{contents.duration_s:.1f}"),
        ("picture rate (Hz)", _number(contents.picture_rate_hz, 2)),
        ("odometry rate (Hz)", _number(contents.odometry_rate_hz, 2)),
        ("pictures", ", ".join(f"{count} {kind}" for kind, count in contents.pictures.items()) or "none"),
        *([("scans", _scans(contents))] if contents.scans else []),
        ("cameras", ", ".join(contents.cameras) or "none described"),
        (f"distance by odometry ({units.name})", _length(contents.distance_odometry_m, units)),
        (f"distance by truth ({units.name})", _length(contents.distance_truth_m, units)),
        (
            f"{'scans used' if is_laser else 'pictures'} with truth",
            "-" if contents.truth_share is None else f"{contents.truth_share:.0%}",
        ),
        ("kinds of events", events),
        (
            "survey, library or map",
            survey + ("" if contents.survey_found is not False else ", which is not there"),
        ),
        ("map", "yes" if contents.has_map else "no"),
        ("problems", str(contents.problem_count)),
    ]
    return [row for row in rows if not (is_laser and row[0] in OF_CAMERAS)]


def _scans(contents: Inspection) -> str:
    lasers = ", ".join(contents.scans)
    return f"{contents.scans_used or 0} scans used of {contents.records['scan']}; {lasers}"


def _length(value_m: float | None, units: Units) -> str:
    return _number(None if value_m is None else value_m * units.per_m, units.digits)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def doctor(
    session: opt.Session,
    library: opt.Library = None,
    no_library: Annotated[
        bool, option("--no-library", "Do not look at the pictures: quicker, but finds less.")
    ] = False,
    output: Annotated[
        Path | None,
        opt.writes("READING.toml", "Write the options that fix everything, for --reading."),
    ] = None,
    force: opt.Force = False,
    strict: Annotated[
        bool, option("--strict", "Exit with status 1 when something is wrong, for CI.")
    ] = False,
    json_output: opt.Json = False,
    reading: opt.ReadingPairs = None,
) -> None:
    """Find what is wrong in a recording: signs, units, frames, clocks, cameras; and what fixes it."""
    read_by = reading_of(reading)
    with listening() as listener:
        examination = diagnose(
            session,
            library,
            pictures=not no_library,
            reading=read_by,
            to=output,
            force=force,
            listener=listener,
        )
    fixing = [
        *(fixed_options(read_by, [finding]) for finding in examination.findings),
        examination.fixed,
    ]
    options = [list(fix.words) if fix != read_by else [] for fix in fixing]
    if json_output:
        print_json(_json(examination, options))
    else:
        map_or_library = "--map" if library is not None and library.suffix.lower() in ENDINGS else "--library"
        beside = [] if library is None else [map_or_library, str(library)]
        results.say("\n".join(_lines(examination, options, beside)))
    if output is not None and examination.fixed != read_by:
        words = shlex.join([str(session), "--reading", str(output)])
        note(f"{output} written; now try: maurice-replay {words}")
    elif output is not None:
        note("there is nothing that options fix; no file was written")
    if strict and examination.findings:
        raise typer.Exit(1)


def _json(examination: Examination, options: Options) -> dict[str, object]:
    """Return everything as JSON, lengths in meters."""
    return {
        "session": str(examination.path),
        "name": examination.name,
        "odometry": examination.odometry,
        "truth": examination.truth,
        "pictures": examination.pictures,
        "scans": examination.scans,
        "only_the_beginning": examination.cut,
        "said": list(examination.remarks),
        "checks": list(examination.checks),
        "not_asked": list(examination.not_asked),
        "odometry_advice": list(odometry_advice(examination)),
        "healthy": not examination.findings,
        "findings": [
            {
                "code": finding.code,
                "what": describe(finding),
                "evidence": evidence_for(finding),
                "fix": fix_for(finding),
                "options": list(fixing),
                "numbers": dict(finding.numbers),
            }
            for finding, fixing in zip(examination.findings, options, strict=False)
        ],
        "options": list(options[-1]),
    }


def _lines(examination: Examination, options: Options, beside: Sequence[str] = ()) -> Iterator[str]:
    """Yield the report, one line per fact; findings come last and are numbered.

    `beside` are further words, such as the library, that are added after the options of each fix.
    """
    counts = f"{examination.odometry} odometry, {examination.truth} truth, {examination.pictures} pictures"
    counts += f", {examination.scans} scans" if examination.scans else ""
    yield f"{examination.name}: {counts}{', of its beginning' if examination.cut else ''}"
    yield f"checked: {', '.join(examination.checks)}"
    if examination.not_asked:
        yield f"could not check: {', '.join(examination.not_asked)}"
    for text in examination.remarks:
        yield f"the reader reports: {text}"
    for text in odometry_advice(examination):
        yield f"no odometry: {text}"
    for number, (finding, fixing) in enumerate(zip(examination.findings, options, strict=False), 1):
        yield f"{number}. {describe(finding)} [{finding.code}]"
        yield f"   why: {evidence_for(finding, examination.display_units)}"
        if fixing:
            yield f"   fix: {_command('maurice-replay', examination.path, [*fixing, *beside])}"
        yield f"   {'or' if fixing else 'fix'}: {fix_for(finding)}"
    if options[-1]:
        arguments = shlex.join(["FIXED.log", *options[-1]])
        yield f"try: {_command('maurice-replay doctor', examination.path, [*options[-1], *beside])}"
        yield f"keep: {_command('maurice-replay convert', examination.path)} {arguments}"
    unasked = " in what could be checked" if examination.not_asked else ""
    yield f"found {len(examination.findings) or 'nothing'} wrong{unasked}"


def _command(command: str, path: Path, options: Sequence[str] = ()) -> str:
    return f"{command} {shlex.join([str(path), *options])}"
