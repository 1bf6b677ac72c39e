"""Finished folders, marked by a checksum, and a cache of such folders."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import FolderKind, cache_root, discard
from maurice_loaders.libraries.remembered import remembered
from maurice_loaders.session_log.header import SESSION_LOG

from .tasks import MAP, SURVEY

NOTE, FORMAT = "simulation.json", "maurice-simulation"  # written last: a folder without it is not finished
_SURVEY = r"survey\.log|pictures/survey-\d{5,}\.jpg"
_SESSION = r"session\.log|pictures/session-\d{5,}\.(?:jpg|png)"
_MAP = r"map/map\.(?:yaml|pgm)"
SIMULATION = FolderKind("a simulation", NOTE, FORMAT, rf"{NOTE}|{_SESSION}|survey/(?:{_SURVEY})|{_MAP}")
SIMULATED_SURVEY = FolderKind("a simulated survey", NOTE, FORMAT, rf"{NOTE}|{_SURVEY}")


@dataclass(frozen=True, slots=True)
class SimulationPaths:
    """Where the session's log is, and its survey's: of a robot with a laser its map."""

    session: Path
    survey: Path


def paths_in(folder: Path) -> SimulationPaths:
    """Return where the session's log and survey of a simulation's folder are."""
    return SimulationPaths(folder / SESSION_LOG, folder / (MAP if (folder / MAP).exists() else SURVEY))


def seal(folder: Path, key: str) -> None:
    """Mark a folder as finished: write its key and the checksum of its files."""
    (folder / NOTE).write_text(note_of(folder, key), encoding="utf-8")


def is_whole(folder: Path, key: str) -> bool:
    """Return whether a folder is finished and its files are as they were written."""
    files = [str(folder / NOTE), *sorted(map(str, _files_in(folder)))]

    def whole() -> str:
        try:
            return json.dumps((folder / NOTE).read_text(encoding="utf-8") == note_of(folder, key))
        except OSError:
            return json.dumps(False)

    return bool(json.loads(remembered(f"whole {key}", files, whole)))


def note_of(folder: Path, key: str) -> str:
    """Return the note of a folder: its key, and a checksum of its other files' names and contents."""
    total = hashlib.sha256()
    for file in sorted(_files_in(folder)):
        total.update(file.relative_to(folder).as_posix().encode())
        total.update(file.read_bytes())
    return json.dumps({"format": FORMAT, "made": key, "sha256": total.hexdigest()}) + "\n"


def _files_in(folder: Path) -> list[Path]:
    """Return all files of a folder but its note."""
    files = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    return [path for path in files if path != folder / NOTE and path.is_file()]


def cached(kind: str, key: str, make: Callable[[Path], object]) -> Path:
    """Return a finished folder from the user's cache; `make` makes it when absent or damaged."""
    folder = cache_root() / kind / key
    if folder.exists() and not is_whole(folder, key):
        discard(folder)
    if not folder.exists():
        try:
            make(folder)
        except InputError:
            if not is_whole(folder, key):  # otherwise another process was faster
                raise
    return folder


def copy_whole(source: Path, target: Path) -> None:
    """Copy a finished folder without its note. InputError at the first file that cannot be written."""
    for file in sorted(source.rglob("*")):
        copy = target / file.relative_to(source)
        try:
            if file.is_dir():
                copy.mkdir(parents=True)
            elif file != source / NOTE:
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copy)
        except OSError as problem:
            raise InputError(copy, f"cannot be written: {problem.strerror}; choose another place") from None


def fingerprint(value: Any) -> str:
    """Return a checksum of plain data: dataclasses, arrays, tuples, and values by their repr."""
    total = hashlib.sha256()
    _feed(total.update, value)
    return total.hexdigest()


def _feed(add: Callable[[bytes], None], value: Any) -> None:
    add(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        add(f"{value.dtype}{value.shape}".encode())
        add(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            _feed(add, getattr(value, field.name))
    elif isinstance(value, (tuple, list)):
        for item in value:
            _feed(add, item)
    else:
        add(repr(value).encode())
