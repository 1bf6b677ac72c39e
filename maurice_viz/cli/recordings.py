"""`maurice-replay inspect|doctor SESSION`: what a recording holds, what is wrong and what fixes it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from maurice_loaders.doctor.examination import Diagnosis, fixed_options, odometry_advice
from maurice_loaders.doctor.inspection import Inspection

from ..app.inspect import doctor as diagnose
from ..app.inspect import inspect as inspect_recording
from ..style import Units, units_named
from ..text.findings import describe, evidence_for, fix_for
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import option, reading_of, typed

Options = Sequence[Sequence[str]]  # as typed: what fixes each finding, and last what fixes all; or nothing


def inspect(session: opt.Session, json_output: opt.Json = False, reading: opt.Reading = None) -> None:
    """Show what a session, a survey log or a recording holds: counts, rates, spans, pictures, problems."""
    inspected = inspect_recording(session, reading=reading_of(reading))
    if json_output:
        print_json(inspected.to_json())
        return
    found = inspected.contents
    table = Table(title=f"{found.kind} {found.name}", title_justify="left", show_header=False)
    for row in (("format", inspected.format), *_rows(found)):
        table.add_row(*row)
    results.print(table)
    for text in (*found.warnings, *found.problems):
        results.print(text)
    if found.problem_count > len(found.problems):
        results.print(f"... and {found.problem_count - len(found.problems)} more problems")


def _rows(found: Inspection) -> list[tuple[str, str]]:
    events = ", ".join(dict.fromkeys(found.events)) or "none"
    survey = "none named" if found.survey is None else found.survey
    units = units_named(found.display_units)
    return [
        ("file", found.path),
        ("records", ", ".join(f"{count} {kind}" for kind, count in found.records.items()) or "none"),
        ("duration (s)", f"{found.duration_s:.1f}"),
        ("picture rate (Hz)", _number(found.picture_rate_hz, 2)),
        ("odometry rate (Hz)", _number(found.odometry_rate_hz, 2)),
        ("pictures", ", ".join(f"{count} {kind}" for kind, count in found.pictures.items()) or "none"),
        ("cameras", ", ".join(found.cameras) or "none described"),
        (f"distance by odometry ({units.name})", _length(found.distance_odometry_m, units)),
        (f"distance by truth ({units.name})", _length(found.distance_truth_m, units)),
        ("pictures with truth", "-" if found.truth_share is None else f"{found.truth_share:.0%}"),
        ("kinds of events", events),
        ("survey or library", survey + ("" if found.survey_found is not False else ", which is not there")),
        ("map", "yes" if found.has_map else "no"),
        ("problems", str(found.problem_count)),
    ]


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
        option(
            "-o --output", "Write the options that fix everything, for --reading.", metavar="READING.toml"
        ),
    ] = None,
    force: opt.Force = False,
    strict: Annotated[
        bool, option("--strict", "Exit with status 1 when something is wrong, for CI.")
    ] = False,
    json_output: opt.Json = False,
    reading: opt.Reading = None,
) -> None:
    """Find wrong signs, units, frames, clocks and cameras in a recording, with the reason and the fix."""
    opening = reading_of(reading)
    with listening() as listener:
        found = diagnose(
            session,
            library,
            pictures=not no_library,
            reading=opening,
            to=output,
            force=force,
            listener=listener,
        )
    fixing = [*(fixed_options(opening, [one]) for one in found.findings), found.fixed]
    options = [typed(one) if one != opening else [] for one in fixing]
    if json_output:
        print_json(_json(found, options))
    else:
        beside = [] if library is None else ["--library", str(library)]
        results.print("\n".join(_lines(found, options, beside)), soft_wrap=True)
    if output is not None and found.fixed != opening:
        words = shlex.join([str(session), "--reading", str(output)])
        note(f"{output} written; now try: maurice-replay {words}")
    elif output is not None:
        note("there is nothing that options fix; no file was written")
    if strict and found.findings:
        raise typer.Exit(1)


def _json(found: Diagnosis, options: Options) -> dict[str, object]:
    """Return everything as JSON, lengths in meters."""
    return {
        "session": str(found.path),
        "name": found.name,
        "odometry": found.odometry,
        "truth": found.truth,
        "pictures": found.pictures,
        "only_the_beginning": found.cut,
        "said": list(found.said),
        "checks": list(found.checks),
        "not_asked": list(found.not_asked),
        "odometry_advice": list(odometry_advice(found)),
        "healthy": not found.findings,
        "findings": [
            {
                "code": one.code,
                "what": describe(one),
                "evidence": evidence_for(one),
                "fix": fix_for(one),
                "options": list(fixing),
                "numbers": dict(one.numbers),
            }
            for one, fixing in zip(found.findings, options, strict=False)
        ],
        "options": list(options[-1]),
    }


def _lines(found: Diagnosis, options: Options, beside: Sequence[str] = ()) -> Iterator[str]:
    """Yield the report, one line per fact; findings come last and are numbered.

    `beside` are further words, such as the library, that are added after the options of each fix.
    """
    counts = f"{found.odometry} odometry, {found.truth} truth, {found.pictures} pictures"
    yield f"{found.name}: {counts}{', of its beginning' if found.cut else ''}"
    yield f"checked: {', '.join(found.checks)}"
    if found.not_asked:
        yield f"could not check: {', '.join(found.not_asked)}"
    for text in found.said:
        yield f"the reader reports: {text}"
    for text in odometry_advice(found):
        yield f"no odometry: {text}"
    for number, (one, fixing) in enumerate(zip(found.findings, options, strict=False), 1):
        yield f"{number}. {describe(one)} [{one.code}]"
        yield f"   why: {evidence_for(one, found.display_units)}"
        if fixing:
            yield f"   fix: {_command('maurice-replay', found.path, [*fixing, *beside])}"
        yield f"   {'or' if fixing else 'fix'}: {fix_for(one)}"
    if options[-1]:
        kept = shlex.join(["FIXED.log", *options[-1]])
        yield f"try: {_command('maurice-replay doctor', found.path, [*options[-1], *beside])}"
        yield f"keep: {_command('maurice-replay convert', found.path)} {kept}"
    yield f"found {len(found.findings)} wrong" if found.findings else "found nothing wrong"


def _command(command: str, path: Path, options: Sequence[str] = ()) -> str:
    return f"{command} {shlex.join([str(path), *options])}"
