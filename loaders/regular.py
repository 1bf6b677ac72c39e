"""Only regular files are read: a device may never end, a pipe may never begin."""

from __future__ import annotations

from pathlib import Path

from .errors import LogError


def expect_regular(file: Path, expected: str) -> None:
    """Raise LogError for a device, pipe or socket; what is not there, and folders, are the caller's."""
    if file.exists() and not file.is_file() and not file.is_dir():
        raise LogError(file, f"found no regular file, expected {expected}; save it to a file first")
