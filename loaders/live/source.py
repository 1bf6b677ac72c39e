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
    """A source of session-log lines."""

    name: str  # as the user typed it
    connect: Callable[[], ByteStream]  # OSError where it cannot be reached now, InputError where it never can
    once: bool = False  # it cannot be reopened after its end
    peer: bool = False  # a remote program, disconnected when it sends invalid data
    folder: Path | None = None  # of pictures given by their path; None: paths are refused
    waits: bool = True  # loses nothing when it is not read for a while


def is_live(text: Path | str) -> bool:
    """Return whether this names a live source that is no file."""
    return str(text) == STDIN or bool(_SCHEME.match(str(text)))


def live_source(text: Path | str, options: ReadingOptions | None = None) -> LiveSource:
    """Return the source that was typed; text that is no address is a file. SourceError for a bad address."""
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
    """Return host, port and path of an address."""
    try:
        parts = urlsplit(name)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise SourceError(name, f"found no host, or no port from 1 to 65535, {WANTED}")
    return host, port, parts.path


# Byte streams of live sources: a socket, standard input, a growing file.

PORTION = 1 << 16  # bytes read at once
CONNECT_S = 5.0
LOOK_S = 0.05  # interval of looking for more in a file


class ByteStream(Protocol):
    """One connection, from its beginning to its end."""

    def read(self, wait_s: float) -> bytes | None:
        """Return the bytes received within `wait_s`: None for nothing yet, b"" at the end. OSError."""
        ...

    def close(self) -> None:
        """Close the connection; closing twice does no harm."""
        ...


class SocketStream:
    """A TCP connection that we opened; nothing is ever sent."""

    def __init__(self, host: str, port: int) -> None:
        """Connect. OSError where nothing listens."""
        self._socket = socket.create_connection((host, port), CONNECT_S)

    def read(self, wait_s: float) -> bytes | None:
        """Return the bytes received."""
        self._socket.settimeout(wait_s)
        try:
            return self._socket.recv(PORTION)
        except TimeoutError:
            return None

    def close(self) -> None:
        """Close the connection."""
        with suppress(OSError):  # is down already
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


class PipeStream:
    """A pipe or terminal by its descriptor, such as standard input."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def read(self, wait_s: float) -> bytes | None:
        """Return the bytes received. Windows cannot wait for a pipe with a limit, so it waits without one."""
        if os.name != "nt" and not select.select([self._descriptor], [], [], wait_s)[0]:
            return None
        return os.read(self._descriptor, PORTION)

    def close(self) -> None:
        """Leave the descriptor open: it is not ours."""


class FileStream:
    """A file that another program writes. The stream ends when it is replaced, cut or deleted."""

    def __init__(self, path: Path) -> None:
        """Open it. OSError where it does not exist, InputError where it is no regular file."""
        expect_regular(path, "a growing log")
        self._path = path
        self._file: BinaryIO = path.open("rb")
        self._read = 0

    def read(self, wait_s: float) -> bytes | None:
        """Return what was written since the last call."""
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
        """Return whether the path still names the opened file, and the file is no shorter."""
        try:
            now, opened = self._path.stat(), os.fstat(self._file.fileno())
        except OSError:
            return False
        return os.path.samestat(now, opened) and now.st_size >= self._read
