"""Where bytes of a live session come from: a socket, standard input, a file that grows."""

from __future__ import annotations

import os
import select
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Protocol

from ..io.files import expect_regular

PORTION = 1 << 16  # bytes read at once
CONNECT_S = 5.0
LOOK_S = 0.05  # how often a file is looked at for more


class Channel(Protocol):
    """One connection, from its beginning to its end."""

    def read(self, wait_s: float) -> bytes | None:
        """Give what has come, waiting at most so long: None for nothing yet, b"" at the end. OSError."""
        ...

    def close(self) -> None:
        """Let go; closing twice does no harm."""
        ...


class SocketChannel:
    """A TCP connection that we opened; nothing is ever sent."""

    def __init__(self, host: str, port: int) -> None:
        """Connect. OSError where nobody answers."""
        self._socket = socket.create_connection((host, port), CONNECT_S)

    def read(self, wait_s: float) -> bytes | None:
        """Give what has come."""
        self._socket.settimeout(wait_s)
        try:
            return self._socket.recv(PORTION)
        except TimeoutError:
            return None

    def close(self) -> None:
        """Hang up."""
        with suppress(OSError):  # is down already
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


class StreamChannel:
    """A pipe or terminal by its descriptor, such as standard input."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def read(self, wait_s: float) -> bytes | None:
        """Give what has come. Windows cannot wait for a pipe with a limit, and waits without one."""
        if os.name != "nt" and not select.select([self._descriptor], [], [], wait_s)[0]:
            return None
        return os.read(self._descriptor, PORTION)

    def close(self) -> None:
        """Leave the descriptor open: it is not ours."""


class FileChannel:
    """A file that somebody else is writing. It ends when it is replaced, cut or gone, not at its end."""

    def __init__(self, path: Path) -> None:
        """Open it. OSError where it is not there, LogError where it is no regular file."""
        expect_regular(path, "a log that grows")
        self._path = path
        self._file: BinaryIO = path.open("rb")
        self._read = 0

    def read(self, wait_s: float) -> bytes | None:
        """Give what was written since the last time."""
        until = time.monotonic() + wait_s
        while not (data := self._file.read(PORTION)):
            if not self._is_the_same():
                return b""
            if time.monotonic() >= until:
                return None
            time.sleep(LOOK_S)
        self._read += len(data)
        return data

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def _is_the_same(self) -> bool:
        """Tell whether the file by that name is still the one that was opened, and no shorter."""
        try:
            now, opened = self._path.stat(), os.fstat(self._file.fileno())
        except OSError:
            return False
        return os.path.samestat(now, opened) and now.st_size >= self._read
