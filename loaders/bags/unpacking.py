"""Unpacking within limits: kilobytes can hold gigabytes, and the libraries that read bags have no limit.

What is unpacked at once (a message, a chunk) may take `MOST_BYTES`, a compressed file the gigabytes on the
disk that `MAURICE_MAX_UNPACKED_GB` allows.
"""

from __future__ import annotations

import bz2
import math
import os
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from types import SimpleNamespace
from typing import Any, BinaryIO

MOST_BYTES = 2**28  # writers close chunks after some megabytes; four pictures of 4K take 100
LIMIT, USUAL_GB = "MAURICE_MAX_UNPACKED_GB", 4.0  # environment variable, and what holds without it
FOLDER = "maurice-replay-bag-"  # of unpacked files: this, the process, and what makes it unique


class TooLarge(ValueError):
    """What is compressed takes more room than it may."""


def whole(make: Callable[[], Any], data: bytes) -> bytes:
    """Return what a decompressor makes of bytes. TooLarge; ValueError for bytes that are cut."""
    parts, left = list[bytes](), MOST_BYTES
    while data:
        unpacker = make()
        parts.append(unpacker.decompress(data, max_length=left))
        left -= len(parts[-1])
        if not unpacker.eof:
            if left <= 0:
                raise TooLarge(f"found a chunk that takes more than {MOST_BYTES / 1e6:.0f} MB unpacked")
            raise ValueError("a compressed chunk is cut")
        data = unpacker.unused_data or b""
    return b"".join(parts)


def _zstd() -> Any:
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd


def unpack_zstd(data: bytes, _: int = 0) -> bytes:
    """Unpack Zstandard. TooLarge; ValueError for what is damaged."""
    try:
        return whole(_zstd().ZstdDecompressor, data)
    except _zstd().ZstdError as problem:
        raise ValueError(str(problem)) from None


def unpack_lz4(data: bytes, _: int = 0) -> bytes:
    """Unpack LZ4 frames."""
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]  # it has none

    return whole(LZ4FrameDecompressor, data)


def unpack_bz2(data: bytes) -> bytes:
    """Unpack bzip2."""
    return whole(bz2.BZ2Decompressor, data)


def most_on_disk() -> float:
    """Return how many bytes an unpacked file may take. TooLarge for a variable that is no such number."""
    text = os.environ.get(LIMIT) or str(USUAL_GB)
    with suppress(ValueError):
        if 0 < float(text) < math.inf:
            return float(text) * 1e9
    raise TooLarge(f"found {LIMIT}={text!r}, expected a number of gigabytes above 0")


class _Unpacked:
    """A compressed file, read unpacked, up to the limit."""

    def __init__(self, file: Any) -> None:
        self._file, self._left = file, most_on_disk()

    def read(self, size: int) -> bytes:
        data: bytes = self._file.read(size)
        self._left -= len(data)
        if self._left < 0:
            most = most_on_disk() / 1e9
            raise TooLarge(f"found a file that takes more than {most:g} GB unpacked; {LIMIT}=... allows more")
        return data

    def __enter__(self) -> _Unpacked:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def own_folder() -> TemporaryDirectory[str]:
    """Return a temporary folder for unpacked files; those that killed processes left are removed."""
    for left in Path(gettempdir()).glob(f"{FOLDER}*"):
        process = left.name.removeprefix(FOLDER).partition("-")[0]
        if process.isdigit() and not _is_alive(int(process)):
            shutil.rmtree(left, ignore_errors=True)
    return TemporaryDirectory(prefix=f"{FOLDER}{os.getpid()}-")


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's
        return True
    return True


@cache
def limit_libraries() -> None:
    """Let `rosbags` and `mcap` unpack by the functions above: they have no limits that could be set."""
    import mcap.stream_reader as mcap_stream
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import reader as ros2
    from rosbags.rosbag2 import storage_mcap

    def opened(file: BinaryIO, mode: str) -> _Unpacked:
        return _Unpacked(_zstd().open(file, mode))

    ros1.decompressors |= {"bz2": unpack_bz2, "lz4": unpack_lz4}
    storage_mcap.DECOMPRESSORS |= {"lz4": unpack_lz4, "zstd": unpack_zstd}
    # A message is unpacked when it is decoded, so that of a damaged one the others can be read.
    later = SimpleNamespace(open=opened, decompress=lambda data: data)
    vars(ros2).update(zstd=later, TemporaryDirectory=own_folder)
    vars(mcap_stream).update(
        zstandard=SimpleNamespace(decompress=unpack_zstd), lz4=SimpleNamespace(decompress=unpack_lz4)
    )
