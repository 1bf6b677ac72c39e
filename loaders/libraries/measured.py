"""Descriptors of pictures that were measured before, in the user's cache: a second replay measures nothing.

A descriptor is known by the checksum of its picture's pixels, and of the channel: code, parameters, version
of OpenCV. So are landmarks that were matched in a picture, and the poses that they agree on. One SQLite file
holds them all, so that processes may share it. It is only a cache: whatever is damaged, locked or cannot be
written is measured again.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sqlite3
import sys
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors.registry import CHANNELS, OUR_NAMES
from maurice_mcl.values import F32, F64, U8, Frame

from ..files.writing import cache_root

FILE = "descriptors.sqlite"
SWITCH = "MAURICE_DESCRIPTORS"  # "0": measure every picture
MOST_BYTES = 256 << 20  # of the file: some 80,000 pictures by `best`
AT_ONCE = 64  # pictures that are written together
WAIT_S = 2.0  # for another process that writes
# Channels that are measured in the time in which a picture's checksum is made, or in twice that: see
# docs/performance.md. Where only these are in use, nothing is kept.
CHEAP = frozenset({"color", "smoothed", "cumulative", "color_grid", "tiny"})
SCHEMA = "CREATE TABLE IF NOT EXISTS kept (id INTEGER PRIMARY KEY, name BLOB UNIQUE, held BLOB)"

Found = TypeVar("Found")


def known_descriptors() -> MeasuredPictures | None:
    """Return the user's descriptors, or None where they are switched off (MAURICE_DESCRIPTORS=0)."""
    return None if os.environ.get(SWITCH) == "0" else MeasuredPictures(cache_root() / FILE)


@dataclass(slots=True)
class MeasuredPictures:
    """Descriptors in a file. For one reader at a time, on any thread; any number of these may share the file.

    >>> import numpy as np
    >>> from maurice_loaders.libraries.measured import known_descriptors
    >>> known, image = known_descriptors(), np.zeros((24, 32, 3), np.uint8)
    >>> known.keep(image, {"edges": np.ones(84, np.float32)})
    >>> known.flush()
    >>> len(known.find(image, ["edges"])["edges"])
    84
    >>> known.flush()
    """

    file: Path
    most_bytes: int = MOST_BYTES
    _open: sqlite3.Connection | None = None
    _last: tuple[U8, bytes] | None = None  # the last picture, and its checksum
    _new: dict[bytes, bytes] = field(default_factory=dict)

    def find(self, image: U8, channels: Iterable[str]) -> dict[str, F32]:
        """Return the descriptors of a picture (H, W, 3) that are known, by channel."""
        names = {self._name(image, channel_checksum(channel)): channel for channel in _worth(channels)}
        contents = self._kept(list(names)) if names else {}
        return {
            names[name]: np.frombuffer(content, "<f4").astype(np.float32)
            for name, content in contents.items()
        }

    def keep(self, image: U8, descriptors: Mapping[str, F32]) -> None:
        """Keep descriptors of a picture, by channel; they are on disk after `flush` at the latest."""
        for channel in _worth(descriptors):
            name = self._name(image, channel_checksum(channel))
            self._new[name] = _packed(name, np.asarray(descriptors[channel], "<f4"))
        if len(self._new) >= AT_ONCE:
            self._write()

    def reading(self, sensor: Any, frame: Frame) -> Any:
        """Return what a pose sensor reads in a frame: one with `checksum`, `to_numbers` and `of_numbers`."""
        name = self._name(frame.image, sensor.checksum + _code_checksum(type(sensor).__module__))
        contents = self._kept([name])
        if contents:
            return sensor.of_numbers(np.frombuffer(contents[name], "<f8").astype(np.float64), frame)
        reading = sensor.read(frame)
        self._new[name] = _packed(name, np.asarray(sensor.to_numbers(reading), "<f8"))
        return reading

    def flush(self) -> None:
        """Write what is new, and close the file."""
        self._write()
        if self._open is not None:
            self._open.close()
            self._open = None

    def _name(self, image: U8, checksum: bytes) -> bytes:
        """Return what is measured in a picture is known by (32 bytes), by a checksum of what measures it."""
        if self._last is None or self._last[0] is not image:
            pixels = hashlib.sha256(str(image.shape).encode())
            pixels.update(np.ascontiguousarray(image).data)
            self._last = image, pixels.digest()
        return hashlib.sha256(self._last[1] + checksum).digest()

    def _kept(self, names: Sequence[bytes]) -> dict[bytes, bytes]:
        """Return what is in the file and not damaged."""
        query = f"SELECT name, held FROM kept WHERE name IN ({', '.join('?' * len(names))})"
        rows = self._tried(lambda db: db.execute(query, names).fetchall()) or []
        parts = ((name, blob[:-4], blob[-4:]) for name, blob in rows if name in names)
        return {name: content for name, content, check in parts if check == _check(name, content)}

    def _write(self) -> None:
        new, self._new = self._new, {}
        if new:
            self._tried(lambda db: self._written(db, new))

    def _written(self, db: sqlite3.Connection, new: Mapping[bytes, bytes]) -> None:
        """Add rows, and drop the oldest ones of a file that is full: all of it or nothing."""
        with db:
            db.executemany("INSERT OR REPLACE INTO kept (name, held) VALUES (?, ?)", new.items())
            pages, free, size = (
                db.execute(f"PRAGMA {what}").fetchone()[0]
                for what in ("page_count", "freelist_count", "page_size")
            )
            if (pages - free) * size > self.most_bytes:
                count, newest = db.execute("SELECT count(*), max(id) FROM kept").fetchone()
                db.execute("DELETE FROM kept WHERE id <= ?", (newest - count // 2,))

    def _tried(self, ask: Callable[[sqlite3.Connection], Found]) -> Found | None:
        """Ask the file; None where it cannot be read or written. One that is no database begins anew."""
        try:
            if self._open is None:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                self._open = sqlite3.connect(self.file, WAIT_S, check_same_thread=False)
                self._open.execute("PRAGMA synchronous = OFF")  # a cut of power may damage it
                self._open.execute(SCHEMA)
            return ask(self._open)
        except sqlite3.OperationalError:  # locked, or not writable
            return None
        except (sqlite3.Error, OSError):
            if self._open is not None:
                self._open.close()
                self._open = None
            with suppress(OSError):
                self.file.unlink(missing_ok=True)
            return None


def _worth(channels: Iterable[str]) -> tuple[str, ...]:
    """Return channels, if one of them takes longer to measure than a picture's checksum."""
    names = tuple(channels)
    return names if set(names) - CHEAP else ()


def channel_checksum(name: str) -> bytes:
    """Return a checksum of all that a channel's descriptors depend on, but the picture."""
    channel = CHANNELS[name]
    about = json.dumps([name, channel.parameters()], sort_keys=True)
    return _code_checksum(type(channel).__module__, name in OUR_NAMES, about)


@cache
def _code_checksum(module: str, whole_folder: bool = True, about: str = "") -> bytes:
    """Return a checksum of a module's file, or of its folder, and of all else that it depends on."""
    parts = about, cv2.__version__, np.__version__, platform.machine()
    total = hashlib.sha256("\n".join(parts).encode())
    code = Path(getattr(sys.modules[module], "__file__", None) or "")
    for file in sorted(code.parent.glob("*.py")) if whole_folder else [code]:
        with suppress(OSError):  # a channel that was typed into an interpreter
            total.update(file.read_bytes())
    return total.digest()


def _packed(name: bytes, numbers: F32 | F64) -> bytes:
    content = numbers.tobytes()
    return content + _check(name, content)


def _check(name: bytes, content: bytes) -> bytes:
    return zlib.crc32(name + content).to_bytes(4, "little")
