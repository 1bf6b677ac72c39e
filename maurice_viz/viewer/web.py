"""Rerun's own web viewer, served to browsers: one process for the page, and for the recording.

It listens on this machine alone; a browser elsewhere comes in through a tunnel of ssh.
"""

from __future__ import annotations

import getpass
import platform
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import quote

from ..errors import SinkError
from .open_viewers import HOST, Tied, address, free_port, start_viewer, viewer_binary, wait_until_listening

PAGE_PORT, DATA_PORT = 9090, 9091  # the same every time where they are free, so that a tunnel can stay open
PATIENCE_S = 20.0  # for the server to come up
LOOKS_EVERY_S = 0.2
MEMORY = "2GB"  # of recording that is held for browsers that come late; a browser shows no more


@dataclass(slots=True, eq=False)
class WebViewer:
    """A page in which browsers show a recording; nothing is started before `serve`."""

    page: int = 0  # port of the page; 0 before it is served
    data: int = 0  # port of the recording
    _server: Tied | None = None

    @property
    def is_serving(self) -> bool:
        """Whether `serve` was called and `close` was not."""
        return self._server is not None

    @property
    def url(self) -> str:
        """The address to open in a browser."""
        return f"http://{HOST}:{self.page}/?url={quote(address(self.data), safe='')}&theme=dark"

    @property
    def tunnel(self) -> str:
        """The command to type on another machine, so that the same address can be opened there."""
        ports = " ".join(f"-L {port}:{HOST}:{port}" for port in (self.page, self.data))
        return f"ssh -N {ports} {_user()}@{platform.node() or 'HOST'}"

    def reserve(self) -> int:
        """Choose the ports; return that of the recording."""
        self.page, self.data = _free(PAGE_PORT), _free(DATA_PORT)
        return self.data

    def serve(self, sources: Sequence[str] = ()) -> None:
        """Serve the page and a recording: a file, one that is sent to the port `data`, or one served there.

        Raises SinkError when the server does not come up.
        """
        if not self.page:
            self.reserve()
        options = ["--serve-web", "--web-viewer-port", str(self.page), "--server-memory-limit", MEMORY]
        try:  # apart from our Ctrl-C: what was filtered so far is still sent to it
            self._server = Tied(start_viewer(self.data, [*options, *sources]))
        except OSError as error:
            raise SinkError(viewer_binary(), f"does not start ({error.strerror})") from error
        server = self._server.process
        if not all(wait_until_listening(server, port, PATIENCE_S) for port in (self.page, self.data)):
            self.close()
            raise SinkError(viewer_binary(), f"serves no page on the ports {self.page} and {self.data}")

    def remark(self, remark: Callable[[str], None]) -> None:
        """Remark how to look at it, once there is something to see."""
        remark(f"in a browser: {self.url}")
        remark(f"from another machine, first type there, and leave it running: {self.tunnel}")

    def wait(self, remark: Callable[[str], None]) -> None:
        """Serve until Ctrl-C, and say so; other requests to stop go on. SinkError when the server ends."""
        if self._server is None:
            return
        try:
            remark("serving it until Ctrl-C")
            # Looking now and then: polars handles Ctrl-C so that the system resumes a wait without an end.
            while self._server.process.poll() is None:
                time.sleep(LOOKS_EVERY_S)
        except KeyboardInterrupt as stop:
            if type(stop) is not KeyboardInterrupt:
                raise
        else:
            raise SinkError(viewer_binary(), "stopped serving the page; give the command again")

    def close(self) -> None:
        """End the server, if it runs."""
        if self._server is not None:
            self._server.end()
        self._server = None


def _free(port: int) -> int:
    """Return this port where nobody listens on it, else another one."""
    with suppress(OSError), socket.create_server((HOST, port)):
        return port
    return free_port()


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # a user without a name, as in some containers
        return "USER"
