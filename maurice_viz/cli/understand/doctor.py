"""`maurice-replay doctor SESSION`: what is wrong in a recording, why, and what fixes it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.inspection.doctor import Diagnosis

from ...app.inspect import diagnose, fixes
from ...text.diagnosis import describe, evidence_for, fix_for
from ..console import listening, note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption, LibraryOption, SessionArgument
from ..reading import ReadingOption, reading_of, typed

Options = Sequence[Sequence[str]]  # as typed: what fixes each finding, and last what fixes all; or nothing

StrictOption = Annotated[
    bool, typer.Option("--strict", help="Exit with status 1 when something is wrong, for CI.")
]
NoLibraryOption = Annotated[
    bool, typer.Option("--no-library", help="Do not look at the pictures: quicker, but finds less.")
]

FixOption = Annotated[
    bool, typer.Option("--fix", help="Write the options that fix everything to a reading file.")
]
ReadingFileOption = Annotated[
    Path, typer.Option("-o", "--output", metavar="READING.toml", help="With --fix: the file to write.")
]


def doctor(
    session: SessionArgument,
    library: LibraryOption = None,
    no_library: NoLibraryOption = False,
    fix: FixOption = False,
    output: ReadingFileOption = Path("reading.toml"),
    force: ForceOption = False,
    strict: StrictOption = False,
    json_output: JsonOption = False,
    reading: ReadingOption = None,
) -> None:
    """Find wrong signs, units, frames, clocks and cameras in a recording, with the reason and the fix."""
    opening = reading_of(reading)
    with one_line_errors(), listening() as listener:
        found = diagnose(
            session,
            library,
            pictures=not no_library,
            options=opening,
            to=output if fix else None,
            force=force,
            listener=listener,
        )
    beside = [] if library is None else ["--library", str(library)]
    fixing = [*fixes(found, opening), found.fixed]
    options = [typed(one) if one != opening else [] for one in fixing]
    if json_output:
        results.print_json(json.dumps(_json(found, options)))
    else:
        results.print("\n".join(_lines(found, options, beside)), soft_wrap=True)
    if fix and found.fixed != opening:
        words = shlex.join([str(session), "--reading", str(output)])
        note(f"{output} written; now try: maurice-replay {words}")
    elif fix:
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

    `beside` are words that follow the options wherever a library is asked.
    """
    counts = f"{found.odometry} odometry, {found.truth} truth, {found.pictures} pictures"
    yield f"{found.name}: {counts}{', of its beginning' if found.cut else ''}"
    yield f"checked: {', '.join(found.checks)}"
    if found.not_asked:
        yield f"could not check: {', '.join(found.not_asked)}"
    for text in found.said:
        yield f"the reader reports: {text}"
    for number, (one, fixing) in enumerate(zip(found.findings, options, strict=False), 1):
        yield f"{number}. {describe(one)} [{one.code}]"
        yield f"   why: {evidence_for(one)}"
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
