"""What a path is, as far as its name, its first bytes and its manifest tell.

The formats of recordings are in `formats.registry`, which says with both what stands where something else was
expected.
"""

from __future__ import annotations

import json
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from shlex import quote
from typing import Any

MOST_BYTES = 1_000_000  # of a manifest
MOST_NAMES = 2000  # in a folder, among which a mistyped one is looked for
A_RUN, RUNS, A_LIBRARY = "a saved run", "a comparison of saved runs", "a library"
OURS = {"maurice-run": A_RUN, "maurice-runs": RUNS, "maurice-library": A_LIBRARY}  # by what the manifest says
TRIALS, RERUN, PICTURE, EMPTY = "trials", "a Rerun recording", "a single picture", "an empty folder"
MAGIC = {b"RRF": RERUN, b"\xff\xd8\xff": PICTURE, b"\x89PNG": PICTURE}
ARCHIVES = {  # by their first bytes
    b"PK\x03\x04": ("a ZIP archive", "unzip {}"),
    b"\x1f\x8b": ("a file packed by gzip", "gunzip {}"),
    b"BZh": ("a file packed by bzip2", "bunzip2 {}"),
    b"\xfd7zXZ": ("a file packed by xz", "unxz {}"),
    b"\x28\xb5\x2f\xfd": ("a file packed by zstd", "zstd -d {}"),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", "7z x {}"),
    b"Rar!": ("a RAR archive", "unrar x {}"),
}
UNPACK = "unpack it"
TAR_NAMES = (".tgz", ".tbz2", ".txz", ".tar.gz", ".tar.bz2", ".tar.xz", ".tar.zst")


def nearest_path(path: Path) -> Path | None:
    """Return what is there and has nearly that name; None where nothing has, or the path itself is there."""
    if path.exists():
        return None
    parent = path.parent if path.parent.is_dir() else nearest_path(path.parent)
    if parent is None:
        return None
    if (parent / path.name).exists():
        return parent / path.name
    try:
        names = [entry.name for entry in islice(parent.iterdir(), MOST_NAMES)]
    except OSError:
        return None
    near = get_close_matches(path.name, names, 1)
    return parent / near[0] if near else None


def look_again(path: Path, otherwise: str = "check the path") -> str:
    """Say what to do about a path that is not there: name the one that was meant, or say `otherwise`."""
    near = nearest_path(path)
    return f"did you mean {near}?" if near else otherwise


def manifest_of(path: Path) -> dict[str, Any]:
    """Return what the manifest in a folder says; nothing where there is none of ours."""
    file = path / "manifest.json"
    try:
        if file.is_file() and file.stat().st_size <= MOST_BYTES:
            values = json.loads(file.read_bytes())
            if isinstance(values, dict) and values.get("format") in OURS:
                return values
    except (OSError, ValueError, RecursionError):
        pass
    return {}


def kind_of(path: Path) -> str | None:
    """Return the kind of a file or folder that is no recording; None for any other."""
    if path.is_dir():
        if (path / "plan.json").is_file() and (path / "rows").is_dir():
            return TRIALS
        ours = OURS.get(str(manifest_of(path).get("format")))
        return ours if ours or any(path.iterdir()) else EMPTY
    begin = first_bytes(path)
    for magic, (what, command) in ARCHIVES.items():
        if begin.startswith(magic):
            command = "tar xf {}" if path.name.lower().endswith(TAR_NAMES) else command
            return f"{what} ({UNPACK}: `{command.format(quote(path.name))}`)"
    if begin[257:262] == b"ustar":
        return f"a tar archive ({UNPACK}: `tar xf {quote(path.name)}`)"
    if not begin:
        return "an empty file"
    return next((what for magic, what in MAGIC.items() if begin.startswith(magic)), None)


def first_bytes(path: Path) -> bytes:
    """Return how a file begins."""
    with path.open("rb") as file:
        return file.read(512)
