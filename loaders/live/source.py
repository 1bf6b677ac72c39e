"""Live sources: how one is typed, its byte stream (socket, pipe, growing file), its lines, reconnecting."""

from __future__ import annotations

import math
import os
import re
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event
from typing import BinaryIO, Protocol, TypeAlias
from urllib.parse import urlsplit

from ..errors import FieldError, InputError, SourceError
from ..files.text import expect_regular
from ..reading.options import Reading
from ..reading.plane import TURNED
from ..session_log.header import session_in
from ..session_log.records import LogLine

STDIN = "-"
_SCHEME = re.compile(r"^(?:(tcp|wss?):/{1,2}|cmucam:/+)(?=[^/])")  # a path has lost its second slash
WANTED = "expected -, tcp://HOST:PORT, ws://HOST:PORT, cmucam:///dev/NAME, or a file with --follow"


@dataclass(frozen=True, slots=True)
class LiveSource:
    """A source of session-log lines."""

    name: str  # as the user typed it
    connect: Callable[[], ByteStream]  # OSError if it cannot be reached now, InputError if it never can
    once: bool = False  # it cannot be reopened after its end
    peer: bool = False  # a remote program, disconnected when it sends invalid data
    folder: Path | None = None  # of pictures given by their path; None: paths are refused
    waits: bool = True  # loses nothing when it is not read for a while
    is_file: bool = False  # may come to be later


def is_live(text: Path | str) -> bool:
    """Return whether this names a live source that is no file."""
    return str(text) == STDIN or bool(_SCHEME.match(str(text)))


def live_source(text: Path | str, options: Reading | None = None) -> LiveSource:
    """Return the source that was typed; text that is no address is a file. SourceError for a bad address."""
    typed = str(text)
    if options is not None and options.plane in TURNED:
        fault = f"found --reading plane={options.plane}, which is for recordings"
        raise SourceError(typed, f"{fault}: poses from a live source are read in x-y; leave it out")
    if typed == STDIN:
        return LiveSource(
            "standard input", partial(PipeStream, sys.stdin.fileno()), once=True, folder=Path.cwd()
        )
    if (scheme := _SCHEME.match(typed)) is None:
        path = session_in(Path(text))
        return LiveSource(typed, partial(FileStream, path), folder=path.parent, is_file=True)
    if scheme[1] is None:
        from .cmucam import camera_at

        name = f"cmucam:///{typed[scheme.end() :]}"
        return LiveSource(name, camera_at(name, typed[scheme.end() :]), waits=False)
    name = f"{scheme[1]}://{typed[scheme.end() :]}"
    host, port, rest = _parts(name)
    if scheme[1] == "tcp":
        if rest not in ("", "/"):
            raise SourceError(name, f"found {rest!r} behind the port, expected tcp://HOST:PORT")
        return LiveSource(name, partial(SocketStream, host, port), peer=True, waits=False)
    from .websocket import connect_websocket

    connect = partial(connect_websocket, name, options or Reading())
    return LiveSource(name, connect, peer=True, waits=False)


def _parts(name: str) -> tuple[str, int, str]:
    try:
        parts = urlsplit(name)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise SourceError(name, f"found no host, or no port from 1 to 65535, {WANTED}")
    return host, port, parts.path


PORTION = 1 << 16  # bytes read at once
CONNECT_S = 5.0
LOOK_S = 0.05  # interval of looking for more in a file


class ByteStream(Protocol):
    """One connection, from its beginning to its end."""

    def read(self, wait_s: float) -> bytes | None:
        """Return the bytes received within `wait_s`: None for nothing yet, b"" at the end. OSError."""

    def close(self) -> None:
        """Close the connection; closing twice does no harm."""


class SocketStream:
    """A TCP connection that we opened; nothing is ever sent."""

    def __init__(self, host: str, port: int) -> None:
        """Connect. OSError if nothing listens."""
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
        """Open it. OSError if it does not exist, InputError if it is no regular file."""
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
        try:
            now, opened = self._path.stat(), os.fstat(self._file.fileno())
        except OSError:
            return False
        return os.path.samestat(now, opened) and now.st_size >= self._read


MOST_LINE_BYTES = 16 * 2**20  # a picture of 12 megapixels inline; more is no log


class LineCutter:
    """Cuts bytes into lines, which do not depend on the portions that the bytes come in."""

    def __init__(self, most: int = MOST_LINE_BYTES) -> None:
        """Keep at most `most` bytes of a line; the rest is dropped, and the line is marked."""
        self._most = most
        self._line = bytearray()
        self._too_long = False
        self._number = 0

    @property
    def overflowing(self) -> bool:
        """Whether the current line is too long already."""
        return self._too_long

    def feed(self, data: bytes) -> list[LogLine]:
        """Add bytes and return the lines that end within them."""
        lines, begin = [], 0
        while (end := data.find(b"\n", begin)) >= 0:
            self._add(data[begin:end])
            lines.append(self._take(ended=True))
            begin = end + 1
        self._add(data[begin:])
        return lines

    def rest(self) -> LogLine | None:
        """Return the last line if it has no line end; None otherwise."""
        return self._take(ended=False) if self._line else None

    def _add(self, piece: bytes) -> None:
        self._too_long = self._too_long or len(self._line) + len(piece) > self._most
        self._line += piece[: self._most - len(self._line)]

    def _take(self, *, ended: bool) -> LogLine:
        self._number += 1
        line = LogLine(self._number, bytes(self._line).rstrip(b"\r"), ended, self._too_long)
        self._line, self._too_long = bytearray(), False
        return line


# Connecting to a live source, and again at growing intervals when it goes away.

POLL_S = 0.25  # interval of checking whether to stop
FIRST_WAIT_S, LONGEST_WAIT_S = 0.1, 5.0  # between two attempts
AWAY_S = 30.0  # most time that a source other than a file may be away
SENSE_S = 10.0  # after a connection, in which a peer must send something valid


@dataclass(frozen=True, slots=True)
class Connected:
    """A connection was made."""


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The source is away, or was never reached."""

    why: str
    hung_up: bool = False  # by us, because of what it sent


@dataclass(frozen=True, slots=True)
class Malformed:
    """Input that could not be converted to a line."""

    why: str


Arrival: TypeAlias = LogLine | Malformed | Connected | Disconnected | None  # None: nothing came yet


@dataclass(frozen=True, slots=True)
class Patience:
    """When listening ends by itself."""

    away_s: float | None = None  # most time that a source may be away; None: 30 s, and a file forever
    silent_s: float | None = None  # most time that a connected source may be silent; None: forever


class Listening:
    """Yields what arrives, over any number of connections, until stopped or out of patience."""

    def __init__(self, source: LiveSource, stop: Event, patience: Patience | None = None) -> None:
        self.ended = ""  # why, when it has ended by itself
        self._source, self._stop = source, stop
        self._patience = patience or Patience()
        self._wait_s = FIRST_WAIT_S
        self._heard_s = time.monotonic()
        self._begun_s = 0.0
        self._sense = False  # made since the connection began
        self._ever = False  # made at all
        self._hung_up = ""

    @property
    def stopped(self) -> bool:
        """Whether it was asked to stop."""
        return self._stop.is_set()

    def greeted(self) -> None:
        """Note a valid header, which does not extend patience."""
        self._sense = self._ever = True

    def heard(self) -> None:
        """Note that the last line was a valid record."""
        self._heard_s = time.monotonic()
        self._sense = self._ever = True
        self._wait_s = FIRST_WAIT_S

    def hang_up(self, why: str) -> None:
        """End this connection; another one is tried after a while."""
        self._hung_up = why

    def __iter__(self) -> Iterator[Arrival]:
        while not self._stop.is_set():
            try:
                channel = self._source.connect()
            except OSError as problem:
                yield Disconnected(self._why_not(problem))
            else:
                yield Connected()
                yield from self._connection(channel)
                if self._source.once:
                    return
            if self._out_of_patience():
                return
            self._stop.wait(self._wait_s)
            self._wait_s = min(2 * self._wait_s, LONGEST_WAIT_S)

    def _why_not(self, problem: OSError) -> str:
        awaited = self._source.is_file and isinstance(problem, FileNotFoundError)
        return "is not there yet" if awaited else _reason(problem)

    def _connection(self, channel: ByteStream) -> Iterator[Arrival]:
        cutter = LineCutter()
        why = "was replaced, cut or deleted" if self._source.is_file else "has hung up"
        self._begun_s, self._sense, self._hung_up = time.monotonic(), False, ""
        try:
            while not self._stop.is_set():
                try:
                    data = channel.read(POLL_S)
                except FieldError as problem:
                    yield Malformed(str(problem))
                except InputError as problem:  # it can never be read; unless it could before
                    if not self._ever:
                        raise
                    self.hang_up(problem.message)
                else:
                    if data == b"":
                        break
                    yield from [None] if data is None else cutter.feed(data)
                self._judge(cutter)
                if self._hung_up or self._silent_too_long():
                    break
            if not self._hung_up and (rest := cutter.rest()) is not None:
                yield rest
        except OSError as problem:
            why = _reason(problem)
        finally:
            channel.close()
        if not self._stop.is_set() and not self._source.once and not self.ended:
            yield Disconnected(self._hung_up or why, bool(self._hung_up))

    def _judge(self, cutter: LineCutter) -> None:
        if not self._source.peer:
            return
        if cutter.overflowing:
            self.hang_up(f"sent a line of more than {MOST_LINE_BYTES // 2**20} MiB; hung up")
        elif not self._sense and time.monotonic() - self._begun_s > SENSE_S:
            self.hang_up(f"sent nothing valid for {SENSE_S:g} s; hung up")

    def _silent_too_long(self) -> bool:
        limit = self._patience.silent_s
        if limit is not None and time.monotonic() - self._heard_s > limit:
            self.ended = f"{self._source.name} has been silent for {limit:g} s"
        return bool(self.ended)

    def _out_of_patience(self) -> bool:
        usual_s = math.inf if self._source.is_file else AWAY_S
        limit_s = usual_s if self._patience.away_s is None else self._patience.away_s
        if not self.ended and time.monotonic() - self._heard_s > limit_s:
            self.ended = f"{self._source.name} was away for {limit_s:g} s"
        return bool(self.ended)


def _reason(problem: OSError) -> str:
    return str(problem.strerror or problem or type(problem).__name__)
