"""Files and folders: atomic writes, the cache, and the order of names."""

from __future__ import annotations

import os
import re
import shutil
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs

from ..errors import InputError

# Only regular files are read: a device may never end, a pipe may never begin.


def expect_regular(file: Path, expected: str) -> None:
    """Raise InputError for a device, pipe or socket; what is not there, and folders, are the caller's."""
    if file.exists() and not file.is_file() and not file.is_dir():
        raise InputError(file, f"found no regular file, expected {expected}; save it to a file first")


# The order of file names as people mean it: frame9 before frame10.

_DIGITS = re.compile(r"(\d+)")


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Sort by name, numbers in names by their value."""
    return sorted(files, key=lambda file: _parts(file.name))


def _parts(name: str) -> list[tuple[int, int, str]]:
    parts = _DIGITS.split(name)
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in parts]


# Pictures that lie in a folder: by which endings they are known, and in which order they come.

PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")  # endings, in lower case


def pictures_in(folder: Path) -> list[Path]:
    """Return the pictures of a folder in natural order."""
    return natural_order(one for one in folder.iterdir() if one.suffix.lower() in PICTURES)


# Files that appear completely or not at all.


def write_whole(file: Path, data: bytes, *, force: bool = False) -> None:
    """Write a file completely or not at all. Raises InputError if it exists and `force` is not given."""
    expect_absent(file, force=force)
    filling = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        filling.write_bytes(data)
        filling.replace(file)
    except OSError as problem:
        raise InputError(file, f"cannot be written: {problem.strerror}; choose another place") from None
    finally:
        filling.unlink(missing_ok=True)


def expect_absent(file: Path, *, force: bool) -> None:
    """Raise InputError if a file to be written exists and may not be overwritten, or is no regular file."""
    if file.is_dir() or not file.name:
        raise InputError(file, "found a folder, expected the name of a file to write")
    if file.exists() and not file.is_file():  # a device would be replaced by a file
        raise InputError(file, "found a device or pipe, expected the name of a file to write")
    if file.exists() and not force:
        raise InputError(file, "exists already; write elsewhere, or replace it with --force")


# Folders that appear completely or not at all, and where the cache is.


def cache_root() -> Path:
    """Return the folder for what can be made again: MAURICE_CACHE, or the user's cache."""
    named = os.environ.get("MAURICE_CACHE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("maurice-replay"))


@contextmanager
def new_folder(target: Path, *, force: bool = False, ours: str = "manifest.json") -> Iterator[Path]:
    """Return a temporary sibling to fill; it becomes `target` when all went well, and is removed otherwise.

    Raises InputError if `target` exists already or has no name. With `force` an old folder is replaced, but
    only one that is empty or holds the file `ours`: nobody's home is deleted by a slip of the hand.
    """
    check_target(target, force, ours)
    filling = _sibling(target, "part")
    try:  # from before it is made: a request to stop may come between that and the next line
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            filling.mkdir()
        except OSError as problem:
            raise InputError(target, f"cannot be written: {problem.strerror}; choose another place") from None
        yield filling
        _swap(filling, target, force)
    finally:
        try:
            shutil.rmtree(filling, ignore_errors=True)
        finally:  # again, where a second request to stop interrupted that
            shutil.rmtree(filling, ignore_errors=True)


def begin_folder(target: Path, *, force: bool = False, ours: str = "manifest.json") -> None:
    """Make an empty folder at once, for what grows in it and must be readable after a kill.

    Raises InputError as for `new_folder`; with `force` the old folder is gone from here on.
    """
    check_target(target, force, ours)
    try:
        if target.is_dir() and any(target.iterdir()):
            discard(target)
        target.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(target, f"cannot be written: {problem.strerror}; choose another place") from None


def check_target(target: Path, force: bool, ours: str = "manifest.json") -> None:
    """Raise InputError for a folder that `new_folder` and `begin_folder` would not fill."""
    if not target.name:  # ".", which "" means as well, and "/" cannot be put in place
        raise InputError(target, "found no name for a new folder, expected one; name it")
    if not os.path.lexists(target) or (target.is_dir() and not any(target.iterdir())):
        return
    if not force:
        raise InputError(target, "exists already; write elsewhere, or replace it with --force")
    if not (target / ours).is_file():
        raise InputError(target, f"found no {ours} in it, so it was not made here; remove it yourself")


def _swap(filling: Path, target: Path, force: bool) -> None:
    """Rename into place; what stood there is put aside first, so that it is never half gone."""
    if not force or not target.exists():
        try:
            filling.replace(target)  # onto nothing or an empty folder
        except OSError:
            raise InputError(target, "was written by somebody else meanwhile; write elsewhere") from None
        return
    discard(target)
    filling.replace(target)


def discard(folder: Path) -> None:
    """Remove a folder; it is renamed first, so that nobody sees it half gone."""
    aside = _sibling(folder, "old")
    folder.replace(aside)
    shutil.rmtree(aside, ignore_errors=True)


def _sibling(target: Path, ending: str) -> Path:
    return target.parent / f".{target.name}-{uuid.uuid4().hex}.{ending}"
