"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import LogError


def write_whole(file: Path, data: bytes, *, force: bool = False) -> None:
    """Write a file whole or not at all. LogError when it exists and `force` is not given."""
    expect_absent(file, force=force)
    filling = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        filling.write_bytes(data)
        filling.replace(file)
    except OSError as problem:
        raise LogError(file, f"cannot be written: {problem.strerror}; choose another place") from None
    finally:
        filling.unlink(missing_ok=True)


def expect_absent(file: Path, *, force: bool) -> None:
    """Raise LogError where a file to be written exists and may not be overwritten, or is no regular file."""
    if file.is_dir() or not file.name:
        raise LogError(file, "found a folder, expected the name of a file to write")
    if file.exists() and not file.is_file():  # a device would be replaced by a file
        raise LogError(file, "found a device or pipe, expected the name of a file to write")
    if file.exists() and not force:
        raise LogError(file, "exists already; write elsewhere, or replace it with --force")
