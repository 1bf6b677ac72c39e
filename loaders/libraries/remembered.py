"""What was computed from files or arrays, kept in the user's cache until one of them changes.

A start then asks for sizes and times of ten thousand pictures instead of reading them all.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maurice_mcl.values import Tables

from ..errors import InputError
from ..files.writing import cache_root, write_whole

MOST_BYTES = 256 << 20  # of tables
SETTLED_NS = 2_000_000_000  # no file system in use has coarser times


def remembered(what: str, files: Sequence[str], compute: Callable[[], str]) -> str:
    """Return what `compute` makes of the files, computed again only when one of them has changed.

    A file has changed when its size, its time of writing or its time of any change (ctime) has. A result is
    kept only if all files were left alone for two seconds before: what is written later has later times.
    A file changed in place that keeps all three is not noticed: on Linux and macOS only a clock that was set
    back does that, on Windows also a program that writes the same size and sets the old time.
    """
    about = [what, *(str(Path(file).resolve()) for file in files[:1])]
    where = hashlib.sha256("\n".join(about).encode(errors="surrogateescape")).hexdigest()
    kept_in = cache_root() / "remembered" / f"{where[:32]}.json"
    listing, newest_ns = _listing(files)
    entry = _read(kept_in)
    if entry is not None and entry[0] == listing:
        return entry[1]
    asked_ns = time.time_ns()
    value = compute()
    if newest_ns < asked_ns - SETTLED_NS:
        with suppress(InputError, OSError):  # it is only a cache
            kept_in.parent.mkdir(parents=True, exist_ok=True)
            write_whole(kept_in, json.dumps([listing, value]).encode(), force=True)
    return value


def kept_tables(what: str, of: Sequence[Any], make: Callable[[], Tables]) -> Tables:
    """Return tables that depend on arrays and numbers alone: those in the user's cache, else made and kept.

    A `maurice_mcl.values.Keep`.
    """
    digest = hashlib.sha256(what.encode())
    for value in of:
        array = np.ascontiguousarray(value)
        digest.update(f"{array.dtype} {array.shape}".encode() + array.tobytes())
    file = cache_root() / "tables" / f"{digest.hexdigest()[:32]}.npz"
    arrays = read_arrays(file)
    if arrays is not None:
        return tuple(arrays.values())
    tables = make()
    write_arrays(file, {f"table {number}": table for number, table in enumerate(tables)})
    _keep_newest(file.parent)
    return tables


def read_arrays(file: Path) -> dict[str, NDArray[Any]] | None:
    """Return the arrays of a file in the cache; None where it is not there, or damaged in any way."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
            return dict(arrays)
    except Exception:  # whatever numpy and zipfile raise
        return None


def write_arrays(file: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays to a file in the cache, if that is possible."""
    data = io.BytesIO()
    np.savez(data, allow_pickle=False, **arrays)
    with suppress(InputError, OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, data.getvalue(), force=True)


def _keep_newest(folder: Path) -> None:
    """Remove the oldest half of a folder in the cache that holds more than MOST_BYTES."""
    with suppress(OSError):
        files = sorted(folder.glob("*.npz"), key=lambda file: file.stat().st_mtime_ns)
        if sum(file.stat().st_size for file in files) > MOST_BYTES:
            for file in files[: len(files) // 2]:
                file.unlink(missing_ok=True)


def _listing(paths: Sequence[str]) -> tuple[str, int]:
    """Return a checksum of names, sizes and times, and the latest of the times in nanoseconds."""
    total, newest_ns = hashlib.sha256(), 0
    for path in paths:
        try:
            stat = os.stat(path)  # noqa: PTH116  # a Path takes twice as long
        except (OSError, ValueError):
            total.update(f"{path}\n-\n".encode(errors="surrogateescape"))
            continue
        times = stat.st_mtime_ns, stat.st_ctime_ns
        total.update(f"{path}\n{stat.st_mode} {stat.st_size} {times}\n".encode(errors="surrogateescape"))
        newest_ns = max(newest_ns, *times)
    return total.hexdigest(), newest_ns


def _read(file: Path) -> tuple[str, str] | None:
    try:
        listing, value = json.loads(file.read_bytes())
    except (OSError, ValueError, TypeError):  # not there, or damaged
        return None
    return (listing, value) if isinstance(listing, str) and isinstance(value, str) else None
