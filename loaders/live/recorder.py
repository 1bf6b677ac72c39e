"""Recording a live session as it comes: one session log, a line at a time, whole whenever it stops."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from maurice_mcl.session import SessionInfo

from ..errors import LogError
from ..io.files import expect_absent
from ..session_log.header import header_to_json

NAME = "session.log"


class LiveRecorder:
    """Writes `session.log` into a folder, pictures inline; every line is handed to the system at once."""

    def __init__(self, folder: Path, *, force: bool = False) -> None:
        """Claim the folder. LogError where it holds a session already, or cannot be written to."""
        self.path = folder / NAME
        self._file: BinaryIO | None = None
        self._made = not folder.exists()
        if folder.exists() and not folder.is_dir():
            raise LogError(folder, "found a file, expected a folder to record to; choose another name")
        expect_absent(self.path, force=force)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise self._cannot(problem) from None

    def begin(self, info: SessionInfo) -> None:
        """Write the header. LogError where that does not work."""
        header = json.dumps(header_to_json(info, "session", self.path.parent), ensure_ascii=False)
        try:
            self._file = self.path.open("wb", buffering=0)
        except OSError as problem:
            raise self._cannot(problem) from None
        self.add(header.encode() + b"\n")

    def add(self, line: bytes) -> None:
        """Write a line with its end. LogError when the disk is full or gone."""
        try:
            rest = memoryview(line)
            while self._file is not None and rest:
                rest = rest[self._file.write(rest) :]
        except OSError as problem:
            raise self._cannot(problem) from None

    def close(self) -> None:
        """Close the file; a folder made for it that stayed empty goes. Closing twice does no harm."""
        if self._file is not None:
            self._file.close()
        elif self._made:
            with suppress(OSError):
                self.path.parent.rmdir()

    def _cannot(self, problem: OSError) -> LogError:
        return LogError(self.path, f"cannot be recorded to: {problem.strerror or problem}")
