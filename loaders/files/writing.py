"""Files and folders that appear whole or not at all, and the one rule by which `--force` replaces them.

A file is replaced when it was named and is a regular one. A folder is replaced only when a file in it says
that it was written here, and all its files are such as that kind of folder has (`FolderKind`).
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from ..errors import InputError, TakenError

MOST_MARK_BYTES = 64 * 2**20  # of the file that tells whose a folder is; a manifest has some kilobytes
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # an error of these has no file
MAKE_ROOM = "free some space, or write to another disk"
TAKEN = "was written by another process meanwhile; write elsewhere, or replace it with --force"
OUR_PARTS = r"(?:.*/)?\.[^/]+\.part(?:\.\w+)?"  # what a killed process leaves in any folder


@dataclass(frozen=True, slots=True)
class FolderKind:
    """A kind of folder that is written here, and how it is recognized."""

    name: str  # in words: "a library"
    mark: str  # the file, relative to the folder, whose JSON object (or that of its first line) ...
    format: str  # ... has this `format`
    files: str  # regular expression for the path, relative to the folder, of every file that it may hold

    def is_here(self, folder: Path) -> bool:
        """Return whether a folder has the mark of this kind."""
        return format_of(folder / self.mark) == self.format

    def stranger(self, folder: Path) -> str | None:
        """Return the first file, in the order of names, that a folder of this kind does not have."""
        known = re.compile(f"(?:{self.files}|{OUR_PARTS})", re.DOTALL)
        return next((name for name in sorted(files_below(folder)) if not known.fullmatch(name)), None)


def format_of(file: Path) -> str | None:
    """Return the `format` of a JSON file, or of its first line; None if it names none or cannot be read."""
    try:
        if not file.is_file():
            return None
        with file.open("rb") as data:
            text = data.readline(MOST_MARK_BYTES)
            while True:
                with suppress(ValueError, RecursionError):
                    value = json.loads(text)
                    return str(value.get("format")) if isinstance(value, dict) else None
                rest = data.read(MOST_MARK_BYTES - len(text))
                if not rest:
                    return None
                text += rest
    except OSError:
        return None


def files_below(folder: Path) -> Iterator[str]:
    """Yield the paths, relative to a folder, of all files and links below it. InputError if one is hidden."""

    def refuse(problem: OSError) -> None:
        raise InputError(folder, f"cannot be searched: {problem}; nothing was replaced") from None

    for place, folders, names in os.walk(folder, onerror=refuse):
        links = (name for name in folders if Path(place, name).is_symlink())
        yield from (Path(place, name).relative_to(folder).as_posix() for name in (*names, *links))


def expect_absent(file: Path, *, force: bool, form: str | None = None) -> None:
    """Raise InputError if a file to be written exists and may not be overwritten, or is no regular file.

    With `form`, which is for files whose name was not typed, `force` replaces only one of that format.
    """
    if file.is_dir() or not file.name:
        raise InputError(file, "found a folder, expected the name of a file to write")
    if file.exists() and not file.is_file():  # a device would be replaced by a file
        raise InputError(file, "found a device or pipe, expected the name of a file to write")
    if file.exists() and not force:
        raise TakenError(file, "exists already; write elsewhere, or replace it with --force")
    if form is not None and file.exists() and file.stat().st_size and format_of(file) != form:
        raise InputError(file, f"is not replaced: expected a file of format {form!r}; write elsewhere")


def check_target(target: Path, *kinds: FolderKind, force: bool) -> None:
    """Raise InputError for a folder that `new_folder` would not fill: with `force`, one of no such kind."""
    if not target.name:  # ".", which "" means as well, and "/" cannot be put in place
        raise InputError(target, "found no name for a new folder, expected one; name it")
    if not os.path.lexists(target) or (target.is_dir() and not any(target.iterdir())):
        return
    if not force:
        raise TakenError(target, "exists already; write elsewhere, or replace it with --force")
    kind = next((kind for kind in kinds if kind.is_here(target)), None)
    stranger = None if not kinds or not target.is_dir() else (kind or kinds[0]).stranger(target)
    if kind is not None and stranger is None:
        return
    reason = "" if stranger is None else f"found {stranger} in it, "
    kinds_in_words = " or ".join(kind.name for kind in kinds) or "a name that is free"
    advice = "move that away, or write elsewhere" if kind else "write elsewhere, or remove it yourself"
    raise InputError(target, f"is not replaced: {reason}expected {kinds_in_words}; {advice}")


def expect_apart(target: Path, *sources: Path) -> None:
    """Raise InputError if writing `target` would replace a source that is read for it."""
    place = target.resolve()
    for source in sources:
        if source.exists() and (place == source.resolve() or place in source.resolve().parents):
            what = "is" if place == source.resolve() else f"holds {source},"
            raise InputError(target, f"{what} what is read for it; write elsewhere")


# Writing beside a target, and renaming.


@contextmanager
def writing(target: Path) -> Iterator[None]:
    """Convert what the system refuses, such as a full disk, to an InputError."""
    try:
        yield
    except OSError as problem:
        reason = problem.strerror or problem
        raise InputError(target, f"cannot be written: {reason}; choose another place") from None


@contextmanager
def filling(target: Path, *, force: bool, suffix: str = "", form: str | None = None) -> Iterator[Path]:
    """Return a name to fill beside the target, which it becomes when all went well.

    A part that was never written removes the target. InputError if the target exists and `force` is not
    given (`form` as for `expect_absent`), or when it cannot be written. `suffix` ends the name of the part,
    for programs that go by it.
    """
    expect_absent(target, force=force, form=form)
    remove_leftovers(target)
    part = target.with_name(f".{target.name}.{os.getpid()}.part{suffix}")
    try:
        with writing(target):
            yield part
            if part.exists():
                appear(part, target, force=force)
            else:
                target.unlink(missing_ok=True)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def appear(part: Path, target: Path, *, force: bool) -> None:
    """Give a whole file its name. TakenError if another has that name by now and `force` is not given."""
    if not force:
        with suppress(OSError):  # of a file system without a second name for a file
            try:
                os.link(part, target)  # unlike renaming it never replaces
            except FileExistsError:
                raise TakenError(target, TAKEN) from None
            part.unlink()
            return
    part.replace(target)


def write_whole(file: Path, data: bytes, *, force: bool = False) -> None:
    """Write a file completely or not at all. Raises InputError if it exists and `force` is not given."""
    expect_absent(file, force=force)
    remove_leftovers(file)
    with writing(file):
        put(file, data)


def put(file: Path, data: bytes) -> None:
    """Write a file that appears, or is replaced, when it is complete. OSError as the system raises it."""
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(file)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


@contextmanager
def scratch_folder(target: Path, mode: int = 0o777) -> Iterator[Path]:
    """Return a new hidden folder beside a target, gone afterwards, and so is a parent made for nothing."""
    remove_leftovers(target)
    new_parent = not target.parent.exists()
    folder = sibling(target, "part")
    try:  # from before it is made: a request to stop may come between that and the next line
        with writing(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=mode)
        yield folder
    finally:
        try:
            shutil.rmtree(folder, ignore_errors=True)
        finally:  # again, where a second request to stop interrupted that
            shutil.rmtree(folder, ignore_errors=True)
        if new_parent:
            with suppress(OSError):  # it holds the target
                target.parent.rmdir()


@contextmanager
def new_folder(target: Path, *kinds: FolderKind, force: bool = False) -> Iterator[Path]:
    """Return a temporary sibling to fill; it becomes `target` when all went well, and is removed otherwise.

    InputError if `target` exists, unless it is empty or, with `force`, one of these kinds (`check_target`).
    One about a file in the sibling names it as it would have been called.
    """
    check_target(target, *kinds, force=force)
    with scratch_folder(target) as folder:
        try:
            yield folder
        except InputError as problem:
            if problem.file is None or folder not in problem.file.parents:
                raise
            place = target / problem.file.relative_to(folder)
            raise InputError(place, problem.message, problem.line) from None
        except OSError as problem:
            if problem.errno not in FULL:
                raise
            raise InputError(target, f"cannot be written: {problem.strerror}; {MAKE_ROOM}") from None
        check_target(target, *kinds, force=force)  # again: filling may have taken hours
        aside = sibling(target, "old") if os.path.lexists(target) else None
        try:
            if aside is not None:
                target.replace(aside)
            folder.replace(target)
        except OSError:
            if aside is not None and os.path.lexists(aside) and not os.path.lexists(target):
                aside.replace(target)
            raise TakenError(target, TAKEN) from None
        if aside is not None:
            _remove(aside)


@contextmanager
def temporary_folder(name: str) -> Iterator[Path]:
    """Return a folder among the system's temporary files, for this user alone; killed ones go first."""
    with scratch_folder(Path(tempfile.gettempdir()) / name, mode=0o700) as folder:
        yield folder


def discard(folder: Path) -> None:
    """Remove a folder; it is renamed first, so that nobody sees it half gone."""
    aside = sibling(folder, "old")
    folder.replace(aside)
    _remove(aside)


def sibling(target: Path, ending: str) -> Path:
    """Return a hidden name of this process's own beside a target, which `remove_leftovers` recognizes."""
    return target.parent / f".{target.name}.{uuid.uuid4().hex}.{os.getpid()}.{ending}"


def remove_leftovers(target: Path) -> None:
    """Remove parts of this target whose process, named in them, was killed; those of a living one stay."""
    name = rf"\.?{re.escape(target.stem)}(?:{re.escape(target.suffix)})?"
    named = re.compile(rf"{name}(?:\.\w{{32}})?\.(\d+)\.(?:part|old)(?:\.\w+)?")
    with suppress(OSError):
        for part in target.parent.iterdir():
            match = named.fullmatch(part.name)
            if match and not _is_alive(int(match[1])):
                _remove(part)


def _remove(part: Path) -> None:
    if part.is_dir() and not part.is_symlink():
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    if os.name == "nt":  # where asking would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # of another user
        return True
    return True


def cache_root() -> Path:
    """Return the folder for what can be made again: MAURICE_CACHE, or the user's cache."""
    named = os.environ.get("MAURICE_CACHE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("maurice-replay"))
