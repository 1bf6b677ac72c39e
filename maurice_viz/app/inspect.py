"""What a recording holds, what is wrong with it and what fixes it, and which formats can be read."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from maurice_loaders.doctor.examination import Examination, examine
from maurice_loaders.doctor.inspection import Inspection, inspect_file
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent
from maurice_loaders.formats.registry import chosen, open_recording
from maurice_loaders.formats.registry import formats as all_formats
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import ReadingOptions, write_reading
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.values import Library

from ..listener import SILENT, Listener, progress_of
from ..running.open import library_at
from .library_check import say_default


@dataclass(frozen=True, slots=True)
class FormatInfo:
    """A format of recordings."""

    name: str
    what: str  # in a few words
    extra: str | None  # of this package, that reading it needs
    installed: bool  # whether it can be read here


def formats(path: str | Path | None = None) -> list[FormatInfo]:
    """Return the formats that can be read, or the one that a file or folder is detected as.

    Raises InputError if there is no such file, or it has no known format.

        >>> import maurice_viz as mv
        >>> [found] = mv.formats("session.log")
        >>> found.name
        'session-log'
    """
    forms = list(all_formats().values()) if path is None else [chosen(Path(path), ReadingOptions())]
    return [FormatInfo(form.name, form.what, form.extra, form.installed) for form in forms]


@dataclass(frozen=True, slots=True)
class InspectedRecording:
    """What is in a recording."""

    format: str  # its name
    contents: Inspection

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        return {"format": self.format} | asdict(self.contents)


def inspect(session: str | Path, *, reading: ReadingOptions | None = None) -> InspectedRecording:
    """Return a recording's format and what it holds: counts, rates, distances, problems.

    Distances are in meters, rates in Hz; broken records are counted, not raised. Raises InputError if the
    recording cannot be read at all.

        >>> import maurice_viz as mv
        >>> inspected = mv.inspect("session.log")
        >>> inspected.contents.records["image"]
        14
    """
    path, options = Path(session), replace(reading or ReadingOptions(), keep_going=True)
    form, contents = chosen(path, options), inspect_file(path, options)
    return InspectedRecording(
        form.name, replace(contents, warnings=(*_about_places(path, contents), *contents.warnings))
    )


def _about_places(path: Path, inspection: Inspection) -> list[str]:
    """Return what there is to say of the recording's library: whether its places can be told apart."""
    named = inspection.survey if inspection.survey_found else None
    library = path if inspection.kind == "survey" else None if named is None else Path(named)
    if library is None:
        return []
    try:
        return list(say_default(open_library(library, list(FEATURES["blended"]), keep_going=True)))
    except (InputError, ValueError):  # another command says what is wrong with it
        return []


def doctor(
    session: str | Path,
    library: str | Path | None = None,
    *,
    pictures: bool = True,
    reading: ReadingOptions | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> Examination:
    """Find wrong signs, units, frames, clocks and cameras in a recording, and the options that fix them.

    Pictures are compared with the `library`, or the one that the recording names if there is one, unless
    `pictures` is False. `Examination.fixed` are the options that fix everything; `to` writes them to a
    reading file (.toml), if there is anything to fix. Raises InputError if the recording or the library
    cannot be read, or the file exists (unless `force`).

        >>> import maurice_viz as mv
        >>> examination = mv.doctor("session.log")
        >>> len(examination.findings)
        0
    """
    path, options = Path(session), reading or ReadingOptions()
    if to is not None:
        expect_absent(Path(to), force=force)
    references = _library(path, library, options, listener) if pictures else None
    examination = examine(path, options, references, progress_of(listener, "pictures"))
    if to is not None and examination.fixed != options:
        write_reading(to, examination.fixed, force=force)
    return examination


def _library(
    session: Path, library: str | Path | None, options: ReadingOptions, listener: Listener
) -> Library | None:
    """Open the library that was asked for; the one that the header names only where it is there."""
    path = Path(library) if library else open_recording(session, options).info.survey
    if path is None or (library is None and not path.exists()):
        return None
    if not path.exists():
        raise InputError(path, "found no such library or survey; name it with --library")
    return library_at(path, listener)
