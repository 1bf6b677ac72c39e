"""Live sources: how one is typed, and the byte streams behind them (socket, pipe, growing file)."""

from __future__ import annotations

import os
import re
import select
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO, Protocol
from urllib.parse import urlsplit

from ..errors import SourceError
from ..io.files import expect_regular
from ..reading import ReadingOptions

STDIN = "-"
_SCHEME = re.compile(r"^(tcp|wss?):/{1,2}(?=[^/])")  # a path has lost its second slash
WANTED = "expected -, tcp://HOST:PORT, ws://HOST:PORT, or a file with --follow"


@dataclass(frozen=True, slots=True)
class LiveSource:
    """A source of session-log lines, and how it behaves."""

    name: str  # as people call it
    connect: Callable[[], ByteStream]  # OSError where it cannot be reached now, InputError where it never can
    once: bool = False  # what ended does not come back
    peer: bool = False  # somebody else, whom we hang up on when he makes no sense
    folder: Path | None = None  # that pictures given by their path lie in; None: there are none
    waits: bool = True  # can be left unread for a while without a loss


def is_live(text: Path | str) -> bool:
    """Tell whether this names a live source, other than a file."""
    return str(text) == STDIN or bool(_SCHEME.match(str(text)))


def live_source(text: Path | str, options: ReadingOptions | None = None) -> LiveSource:
    """Give the source that was typed; what is no address is a file. SourceError for a broken address."""
    typed = str(text)
    if typed == STDIN:
        connect = partial(PipeStream, sys.stdin.fileno())
        return LiveSource("standard input", connect, once=True, folder=Path.cwd())
    if (scheme := _SCHEME.match(typed)) is None:
        path = Path(text)
        return LiveSource(typed, partial(FileStream, path), folder=path.parent)
    name = f"{scheme[1]}://{typed[scheme.end() :]}"
    host, port, rest = _parts(name)
    if scheme[1] == "tcp":
        if rest not in ("", "/"):
            raise SourceError(name, f"found {rest!r} behind the port, expected tcp://HOST:PORT")
        return LiveSource(name, partial(SocketStream, host, port), peer=True, waits=False)
    from .websocket import connect_websocket

    asked = partial(connect_websocket, name, options or ReadingOptions())
    return LiveSource(name, asked, peer=True, waits=False)


def _parts(name: str) -> tuple[str, int, str]:
    """Give host, port and what follows of an address."""
    try:
        parts = urlsplit(name)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise SourceError(name, f"found no host, or no port from 1 to 65535, {WANTED}")
    return host, port, parts.path


# Where bytes of a live session come from: a socket, standard input, a file that grows.

PORTION = 1 << 16  # bytes read at once
CONNECT_S = 5.0
LOOK_S = 0.05  # how often a file is looked at for more


class ByteStream(Protocol):
    """One connection, from its beginning to its end."""

    def read(self, wait_s: float) -> bytes | None:
        """Give what has come, waiting at most so long: None for nothing yet, b"" at the end. OSError."""
        ...

    def close(self) -> None:
        """Let go; closing twice does no harm."""
        ...


class SocketStream:
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


class PipeStream:
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


class FileStream:
    """A file that somebody else is writing. It ends when it is replaced, cut or gone, not at its end."""

    def __init__(self, path: Path) -> None:
        """Open it. OSError where it is not there, InputError where it is no regular file."""
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
