"""What is said of a path that is no recording: what it is, and what was probably meant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from shlex import quote

DEPTH = 2  # folders below that are looked into, as KITTI's sequences need
MOST_LOOKED_AT = 200  # files and folders of a level
MOST_NAMED = 3
MOST_LISTED = 4
ARCHIVES = {  # by their first bytes
    b"PK\x03\x04": ("a ZIP archive", "unzip {}"),
    b"\x1f\x8b": ("a file packed by gzip", "gunzip {}"),
    b"BZh": ("a file packed by bzip2", "bunzip2 {}"),
    b"\xfd7zXZ": ("a file packed by xz", "unxz {}"),
    b"\x28\xb5\x2f\xfd": ("a file packed by zstd", "zstd -d {}"),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", "7z x {}"),
    b"Rar!": ("a RAR archive", "unrar x {}"),
}
TAR_NAMES = (".tgz", ".tbz2", ".txz", ".tar.gz", ".tar.bz2", ".tar.xz", ".tar.zst")

Known = Callable[[Path], str | None]  # the name of the format that a path looks like


def describe(path: Path, known: Known, bare: Sequence[str]) -> str:
    """Say what a path is. Formats that are `bare` are not meant where a folder holds others."""
    if not path.is_dir():
        return _describe_file(path)
    names = sorted((entry.name for entry in path.iterdir()), key=lambda name: (name.startswith("."), name))
    if not names:
        return "an empty folder"
    found = _below(path, known)
    meant = [one for one, name in found.items() if name not in bare]
    hint = _did_you_mean(meant) or table_hint(path) or _did_you_mean(list(found))
    return f"a folder with {', '.join(names[:MOST_LISTED])}{hint}"


def _describe_file(path: Path) -> str:
    with path.open("rb") as file:
        begin = file.read(512)
    for magic, (what, command) in ARCHIVES.items():
        if begin.startswith(magic):
            command = "tar xf {}" if path.name.lower().endswith(TAR_NAMES) else command
            return f"{what} (unpack it: `{command.format(quote(path.name))}`)"
    if begin[257:262] == b"ustar":
        return f"a tar archive (unpack it: `tar xf {quote(path.name)}`)"
    return f"a file that begins with {begin[:16]!r}{table_hint(path)}" if begin else "an empty file"


def _below(path: Path, known: Known) -> dict[Path, str]:
    """Give what looks like a recording in a folder, or in the folders there, and its format."""
    level = [path]
    for _ in range(DEPTH):
        inside = sorted(islice((one for folder in level for one in _entries(folder)), MOST_LOOKED_AT))
        if found := {one: name for one in inside if (name := known(one)) is not None}:
            return found
        level = [one for one in inside if one.is_dir()]
    return {}


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from (entry for entry in folder.iterdir() if not entry.name.startswith("."))
    except OSError:
        return


def _did_you_mean(found: Sequence[Path]) -> str:
    if not found:
        return ""
    named = ", ".join(map(str, found[:MOST_NAMED])) + (", ..." if len(found) > MOST_NAMED else "")
    return f" (did you mean {named}?)" if len(found) == 1 else f" (did you mean one of {named}?)"


def table_hint(path: Path) -> str:
    """Say how a table is read whose columns have names of its own; empty where there is none."""
    tables = sorted(path.glob("*.[ct]sv")) if path.is_dir() else [path]
    if not tables or tables[0].suffix.lower() not in (".csv", ".tsv"):
        return ""
    return f" (if {tables[0].name} is a table, say what its columns are with --columns)"
