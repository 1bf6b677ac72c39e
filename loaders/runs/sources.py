"""What a saved run was made from: where it is, a hash of what it held, and how it was read."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from ..formats.cmucam import ENDINGS as DUMPS
from ..formats.registry import ReadingOptions
from ..formats.video import ENDINGS as VIDEOS
from ..io.fields import FieldError, flag, mapping, number, show, text
from ..io.files import PICTURES
from ..libraries.files import MANIFEST, hash_file
from ..transforms.clocks import PER_SECOND

# what a folder is read from, beside pictures
CONTENTS = (".log", ".csv", ".tsv", ".yaml", ".yml", ".db3", ".mcap", ".zstd", *VIDEOS, *DUMPS)
ELSEWHERE = ("table", "keep_going")  # options that a manifest has under names of their own


@dataclass(frozen=True, slots=True)
class Source:
    """A file or folder that a run was made from, and what it held."""

    path: str  # absolute, at the time
    beside: str  # the same seen from the run's folder, for when both were moved together
    sha256: str  # see `source_hash`

    def find(self, folder: Path) -> Path | None:
        """Give where it is now; None when it is in neither place."""
        places = (Path(self.path), folder / self.beside)
        return next((place for place in places if place.exists()), None)


def source_of(path: Path, folder: Path, others: Sequence[Path] = ()) -> Source:
    """Describe a recording, a table or a library folder as seen from a run's folder.

    `others` are files outside that belong to it.
    """
    whole = path.resolve()
    beside = Path(os.path.relpath(whole, folder.resolve())).as_posix()
    return Source(str(whole), beside, source_hash(whole, others))


def source_hash(path: Path, others: Sequence[Path] = ()) -> str:
    """Give the SHA-256 of a file, of a library folder's manifest, or of what a recording's folder holds.

    Of a folder: names and content of all that a recording can be read from, of pictures names and sizes;
    each step of a run has its picture's own hash. A run that is saved in that very folder changes nothing.
    What `others` outside of it hold goes in too.
    """
    if others:
        return sha256("\n".join([source_hash(path), *map(hash_file, others)]).encode()).hexdigest()
    if not path.is_dir():
        return hash_file(path)
    if (path / MANIFEST).is_file():
        return hash_file(path / MANIFEST)
    digest = sha256()
    for file in sorted(path.rglob("*")):
        kind = file.suffix.lower()
        if file.name.startswith(".") or kind not in (*PICTURES, *CONTENTS) or not file.is_file():
            continue
        held = str(file.stat().st_size) if kind in PICTURES else hash_file(file)
        digest.update(f"{file.relative_to(path).as_posix()}\0{held}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()


def reading_to_json(options: ReadingOptions) -> dict[str, Any]:
    """Give the options of reading, all but those that a manifest has under names of their own."""
    kept = {one.name: getattr(options, one.name) for one in fields(options) if one.name not in ELSEWHERE}
    return {name: dict(value) if isinstance(value, Mapping) else value for name, value in kept.items()}


def reading_from_json(value: Any) -> ReadingOptions:
    """Read what `reading_to_json` gave; an option that is not there is as usual. FieldError for others."""
    found, usual = mapping(value, "reading"), ReadingOptions()
    known = {one.name for one in fields(usual)} - set(ELSEWHERE)
    for name in found:
        if name not in known:
            raise FieldError(f"found the option of reading {show(name)}, which is not known here")
    options = replace(usual, **{name: _checked(name, v, getattr(usual, name)) for name, v in found.items()})
    if options.time_unit not in (None, *PER_SECOND):
        raise FieldError(
            f"found time_unit {show(options.time_unit)}, expected one of {', '.join(PER_SECOND)}"
        )
    return options


def _checked(name: str, value: Any, usual: Any) -> Any:
    """Give a value of the same kind as the usual one."""
    if usual is None:
        return None if value is None else text(value, name)
    if isinstance(usual, bool):
        return flag(value, name)
    if isinstance(usual, Mapping):
        return {role: text(column, name) for role, column in mapping(value, name).items()}
    if isinstance(usual, int):
        return whole(value, name)
    return number(value, name)


def whole(value: Any, what: str) -> int:
    """Give a whole number below 2**32."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise FieldError(f"found {what} {show(value)}, expected a whole number from 0")
    return value
