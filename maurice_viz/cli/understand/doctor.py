"""`maurice-replay doctor SESSION`: what people get wrong in a recording, why, and what mends it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.inspection.doctor import diagnose, mended
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading import ReadingOptions
from maurice_mcl.library import Library

from ...text.doctor import to_json, to_lines
from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import JsonOption, LibraryOption, SessionArgument
from ..reading import reads_recordings, typed

StrictOption = Annotated[
    bool, typer.Option("--strict", help="Exit with status 1 when something is wrong, as CI wants it.")
]
NoLibraryOption = Annotated[
    bool, typer.Option("--no-library", help="Do not look at the pictures: quicker, and finds less.")
]


@reads_recordings
def doctor(
    session: SessionArgument,
    library: LibraryOption = None,
    no_library: NoLibraryOption = False,
    strict: StrictOption = False,
    json_output: JsonOption = False,
    *,
    opening: ReadingOptions,
) -> None:
    """Find wrong signs, units, frames, clocks and cameras in a recording; say why, and what mends it."""
    with one_line_errors():
        references = None if no_library else _library(session, library, opening)
        with progress("pictures") as advance:
            found = diagnose(session, opening, references, advance)
    mending = [mended(opening, [one]) for one in found.complaints]
    beside = [] if library is None else ["--library", str(library)]
    options = [typed(one) if one != opening else [] for one in (*mending, found.mended)]
    if json_output:
        results.print_json(json.dumps(to_json(found, options)))
    else:
        results.print("\n".join(to_lines(found, options, beside)), soft_wrap=True)
    if strict and found.complaints:
        raise typer.Exit(1)


def _library(session: Path, library: Path | None, opening: ReadingOptions) -> Library | None:
    """Open the library that was asked for; the one that the header names only where it is there."""
    path = library or open_recording(session, opening).info.survey
    if path is None or (library is None and not path.exists()):
        return None
    if not path.exists():
        raise InputError(path, "found no such library or survey; say which with --library")
    with progress("library") as advance:
        return open_library(path, progress=advance, warn=note)
