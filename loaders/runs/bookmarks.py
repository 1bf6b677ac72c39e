"""Bookmarks of a user, kept beside a saved run as `bookmarks.jsonl`: one JSON object per line.

A line is added with one write, so that a process that is killed breaks at most the line it was writing. Lines
that cannot be read are reported and left as they are, also when others are removed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.fields import read_json, show
from ..io.files import write_whole

BOOKMARKS = "bookmarks.jsonl"


@dataclass(frozen=True, slots=True)
class Bookmark:
    """A note at one step of a run."""

    step: int  # from 1
    note: str  # one line, not empty


@dataclass(frozen=True, slots=True)
class Bookmarks:
    """What one file holds."""

    kept: tuple[Bookmark, ...]  # by step, those of one step in the order in which they were added
    problem: str | None = None  # the broken lines, in one line


def bookmarks_file(folder: Path) -> Path:
    """Return the file of a saved run's bookmarks; it need not be there."""
    return folder / BOOKMARKS


def read_bookmarks(folder: Path) -> Bookmarks:
    """Read a run's bookmarks; none where there is no file.

    Raises InputError if the file cannot be read at all.
    """
    kept, broken = list[Bookmark](), list[InputError]()
    for number, line in enumerate(_lines(folder), start=1):
        try:
            bookmark = _parsed(line)
        except ValueError as found:
            broken.append(InputError(bookmarks_file(folder), str(found), number))
        else:
            if bookmark is not None:
                kept.append(bookmark)
    others = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
    problem = f"{broken[0]}; left as it is{others}" if broken else None
    return Bookmarks(tuple(sorted(kept, key=lambda one: one.step)), problem)


def add_bookmark(folder: Path, bookmark: Bookmark) -> None:
    """Add one at the end of the file. Raises InputError if it cannot be written."""
    line = json.dumps({"step": bookmark.step, "note": bookmark.note}, ensure_ascii=False) + "\n"
    file = bookmarks_file(folder)
    try:
        with file.open("ab+", buffering=0) as out:
            end = out.seek(0, os.SEEK_END)
            out.seek(max(end - 1, 0))
            torn = out.read(1) not in (b"", b"\n")  # a line that was cut off must not swallow this one
            out.write(b"\n" * torn + line.encode())
    except OSError as problem:
        raise InputError(file, f"cannot be written: {problem.strerror}; is the run's folder yours?") from None


def remove_bookmarks(folder: Path, unwanted: Iterable[Bookmark]) -> int:
    """Take out all that equal one of these; all other lines stay, byte for byte. Gives how many went."""
    gone, lines = set(unwanted), _lines(folder)
    kept = [line for line in lines if _or_none(line) not in gone]
    if len(kept) < len(lines):
        write_whole(bookmarks_file(folder), b"".join(kept), force=True)
    return len(lines) - len(kept)


def _lines(folder: Path) -> list[bytes]:
    file = bookmarks_file(folder)
    try:
        return file.read_bytes().splitlines(keepends=True) if file.exists() else []
    except OSError as problem:
        raise InputError(file, f"cannot be read: {problem.strerror}") from None


def _parsed(line: bytes) -> Bookmark | None:
    """Read one line; None for an empty one. ValueError says what was found."""
    if not line.strip():
        return None
    try:
        found: Any = read_json(line)
    except ValueError:
        raise ValueError(
            f"found {show(line.decode(errors='replace').strip())}, expected a bookmark"
        ) from None
    step, note = (found.get("step"), found.get("note")) if isinstance(found, dict) else (None, None)
    if not isinstance(step, int) or isinstance(step, bool) or step < 1:
        raise ValueError(f"found step {show(step)}, expected a number from 1")
    if not isinstance(note, str) or not note.strip():
        raise ValueError(f"found note {show(note)}, expected a text")
    return Bookmark(step, " ".join(note.split()))


def _or_none(line: bytes) -> Bookmark | None:
    try:
        return _parsed(line)
    except ValueError:
        return None
