"""What live sources there are, and how one is typed."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

from ..errors import LogError
from ..formats.registry import OpenOptions
from .channels import Channel, FileChannel, SocketChannel, StreamChannel

STDIN = "-"
_SCHEME = re.compile(r"^(tcp|wss?):/{1,2}(?=[^/])")  # a path has lost its second slash
WANTED = "expected -, tcp://HOST:PORT, ws://HOST:PORT, or a file with --follow"


class LiveError(LogError):
    """As LogError, of a source that is no file: its name is kept as it was typed."""

    def __init__(self, name: str, message: str, line: int | None = None) -> None:
        super().__init__(Path(name), message, line)
        self.args = (f"{name}{'' if line is None else f':{line}'}: {self.message}",)


@dataclass(frozen=True, slots=True)
class LiveSource:
    """A source of session-log lines, and how it behaves."""

    name: str  # as people call it
    connect: Callable[[], Channel]  # OSError where it cannot be reached now, LogError where it never can
    once: bool = False  # what ended does not come back
    peer: bool = False  # somebody else, whom we hang up on when he makes no sense
    folder: Path | None = None  # that pictures given by their path lie in; None: there are none
    waits: bool = True  # can be left unread for a while without a loss


def is_live(text: Path | str) -> bool:
    """Tell whether this names a live source, other than a file."""
    return str(text) == STDIN or bool(_SCHEME.match(str(text)))


def live_source(text: Path | str, options: OpenOptions | None = None) -> LiveSource:
    """Give the source that was typed; what is no address is a file. LiveError for a broken address."""
    typed = str(text)
    if typed == STDIN:
        connect = partial(StreamChannel, sys.stdin.fileno())
        return LiveSource("standard input", connect, once=True, folder=Path.cwd())
    if (scheme := _SCHEME.match(typed)) is None:
        path = Path(text)
        return LiveSource(typed, partial(FileChannel, path), folder=path.parent)
    name = f"{scheme[1]}://{typed[scheme.end() :]}"
    host, port, rest = _parts(name)
    if scheme[1] == "tcp":
        if rest not in ("", "/"):
            raise LiveError(name, f"found {rest!r} behind the port, expected tcp://HOST:PORT")
        return LiveSource(name, partial(SocketChannel, host, port), peer=True, waits=False)
    from .websocket import connect_websocket

    asked = partial(connect_websocket, name, options or OpenOptions())
    return LiveSource(name, asked, peer=True, waits=False)


def _parts(name: str) -> tuple[str, int, str]:
    """Give host, port and what follows of an address."""
    try:
        parts = urlsplit(name)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise LiveError(name, f"found no host, or no port from 1 to 65535, {WANTED}")
    return host, port, parts.path
