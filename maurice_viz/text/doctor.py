"""What the session doctor found, as text for people and as JSON."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from maurice_loaders.inspection.doctor import Diagnosis

Options = Sequence[Sequence[str]]  # as typed: what mends each complaint, and last what mends all; or nothing


def to_json(found: Diagnosis, options: Options) -> dict[str, object]:
    """Give everything as JSON, lengths in metres."""
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
        "healthy": not found.complaints,
        "complaints": [
            {
                "code": one.code,
                "what": one.what,
                "evidence": one.evidence,
                "mend": one.mend,
                "options": list(mending),
                "numbers": dict(one.numbers),
            }
            for one, mending in zip(found.complaints, options, strict=False)
        ],
        "options": list(options[-1]),
    }


def to_lines(found: Diagnosis, options: Options, beside: Sequence[str] = ()) -> Iterator[str]:
    """Write the report, a line a fact; what is wrong comes last and is numbered.

    `beside` is what has to be typed with the options wherever a library is asked.
    """
    counts = f"{found.odometry} odometry, {found.truth} truth, {found.pictures} pictures"
    yield f"{found.name}: {counts}{', of its beginning' if found.cut else ''}"
    yield f"looked at: {', '.join(found.checks)}"
    if found.not_asked:
        yield f"could not look at: {', '.join(found.not_asked)}"
    for text in found.said:
        yield f"the reader says: {text}"
    for number, (one, mending) in enumerate(zip(found.complaints, options, strict=False), 1):
        yield f"{number}. {one.what} [{one.code}]"
        yield f"   why: {one.evidence}"
        if mending:
            yield f"   mend: {_command('maurice-replay', found.path, [*mending, *beside])}"
        yield f"   {'or' if mending else 'mend'}: {one.mend}"
    if options[-1]:
        kept = shlex.join(["MENDED.log", *options[-1]])
        yield f"try it: {_command('maurice-replay doctor', found.path, [*options[-1], *beside])}"
        yield f"keep it: {_command('maurice-replay convert', found.path)} {kept}"
    yield f"found {len(found.complaints)} wrong" if found.complaints else "found nothing wrong"


def _command(command: str, path: Path, options: Sequence[str] = ()) -> str:
    return f"{command} {shlex.join([str(path), *options])}"
