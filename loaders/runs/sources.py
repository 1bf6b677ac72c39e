"""What a saved run was made from: where it is, a hash of what it held, and how it was read."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from ..formats.cmucam import ENDINGS as DUMPS
from ..formats.video import ENDINGS as VIDEOS
from ..io.files import PICTURES
from ..libraries.files import MANIFEST, hash_file

# what a folder is read from, beside pictures
CONTENTS = (".log", ".csv", ".tsv", ".yaml", ".yml", ".db3", ".mcap", ".zstd", *VIDEOS, *DUMPS)


@dataclass(frozen=True, slots=True)
class Source:
    """A file or folder that a run was made from, and what it held."""

    path: str  # absolute, at the time
    beside: str  # the same seen from the run's folder, for when both were moved together
    sha256: str  # see `source_hash`

    def find(self, folder: Path) -> Path | None:
        """Return where it is now; None when it is in neither place."""
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
    """Return the SHA-256 of a file, of a library folder's manifest, or of what a recording's folder holds.

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
