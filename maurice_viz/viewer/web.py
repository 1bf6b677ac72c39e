"""A page for browsers: Rerun's own web viewer, which opens at a place once the recording is complete.

It is served on this machine alone; a browser elsewhere comes in through a tunnel of ssh.
"""

from __future__ import annotations

import getpass
import json
import platform
import shutil
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from functools import partial
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rerun as rr
from rerun.chunk import RrdReader

from maurice_loaders.files.writing import temporary_folder

from ..entities import Place
from ..errors import SinkError
from .open_viewers import (
    HOST,
    LayoutError,
    Tied,
    address,
    free_port,
    start_viewer,
    viewer_binary,
    wait_until_listening,
    with_layout,
)

PAGE_PORT, DATA_PORT = 9090, 9091  # the same every time where they are free, so that a tunnel can stay open
PATIENCE_S = 20.0  # for the viewer's files
LOOKS_EVERY_S = 0.2
RECORDING = "recording.rrd"
VIEWER_FILES = ("re_viewer.js", "re_viewer_bg.wasm")
END_PROPERTY = "end_of_recording"
KINDS = {".js": "text/javascript", ".wasm": "application/wasm", ".json": "application/json"}


@dataclass(slots=True, eq=False)
class WebViewer:
    """A page in which browsers show a recording; nothing is started before `serve`."""

    page: int = 0  # port of the page; 0 before it is served
    data: int = 0  # port of a live recording; 0 for a file, which comes with the page
    is_serving: bool = False  # whether `serve` was called and `close` was not
    _open: ExitStack = field(default_factory=ExitStack)

    @property
    def url(self) -> str:
        """The address to open in a browser."""
        return f"http://{HOST}:{self.page}/"

    @property
    def tunnel(self) -> str:
        """The command to type on another machine, so that the same address can be opened there."""
        ports = " ".join(f"-L {port}:{HOST}:{port}" for port in (self.page, self.data) if port)
        return f"ssh -N {ports} {_user()}@{platform.node() or 'HOST'}"

    def reserve(self) -> int:
        """Choose the port of a live recording, and return it."""
        self.data = _free(DATA_PORT)
        return self.data

    def file(self) -> Path:
        """Return where to write a recording that is only served; it is gone after `close`."""
        return self._open.enter_context(temporary_folder("maurice-web")) / RECORDING

    def serve(
        self,
        recording: Path | None = None,
        place: Place | None = None,
        layout: str | None = None,
        run: str | None = None,
    ) -> None:
        """Serve a page that shows a recording at a place and tab; without one, what comes to the port `data`.

        Raises SinkError when Rerun's web viewer does not come up.
        """
        files = {"": resources.files(__package__).joinpath("page.html").read_bytes()} | _viewer_files()
        shown: dict[str, Any] = {"version": rr.__version__}
        if recording is None:
            shown |= {"live": address(self.data)}
        else:
            store = RrdReader(recording).recordings()[0]
            application = store.application_id.replace("\\", "\\\\").replace(":", "\\:")
            shown |= {"recording": f"Recording:{application}:{store.recording_id}", "layout": layout}
            shown |= {"end": f"/__properties/{END_PROPERTY}"}
            files[RECORDING] = _end_of(store.application_id, store.recording_id)
        if place is not None:
            shown |= {"timeline": place.timeline, "number": place.number}
        files["shown.json"] = json.dumps(shown).encode()
        self.page = _free(PAGE_PORT)
        answers = partial(_Answers, files=files, recording=recording, layout=layout, run=run)
        server = ThreadingHTTPServer((HOST, self.page), answers)
        self._open.callback(server.server_close)
        self._open.callback(server.shutdown)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.is_serving = True

    def remark(self, remark: Callable[[str], None]) -> None:
        """Remark how to look at it, once there is something to see."""
        remark(f"in a browser: {self.url}")
        remark(f"from another machine, first type there, and leave it running: {self.tunnel}")

    def wait(self, remark: Callable[[str], None]) -> None:
        """Serve until Ctrl-C, and say so; other requests to stop go on."""
        try:
            remark("serving it until Ctrl-C")
            # Looking now and then: polars handles Ctrl-C so that the system resumes a wait without an end.
            while self.is_serving:
                time.sleep(LOOKS_EVERY_S)
        except KeyboardInterrupt as stop:
            if type(stop) is not KeyboardInterrupt:
                raise

    def close(self) -> None:
        """End the page, if it is served, and remove what was only served."""
        self._open.close()
        self.is_serving = False


class _Answers(BaseHTTPRequestHandler):
    """Answers one request of a browser."""

    protocol_version = "HTTP/1.1"

    def __init__(
        self,
        *request: Any,
        files: dict[str, bytes],
        recording: Path | None,
        layout: str | None,
        run: str | None,
    ) -> None:
        self._files, self._recording, self._layout, self._run = files, recording, layout, run
        with suppress(ConnectionError):  # the browser left
            super().__init__(*request)

    def do_GET(self) -> None:
        """Give one of the files, or the recording."""
        name = urlsplit(self.path).path.removeprefix("/")
        if name == RECORDING and self._recording is not None:
            end = self._files[name]
            with self._recording.open("rb") as file:
                self._begin(200, name, self._recording.stat().st_size + len(end))
                shutil.copyfileobj(file, self.wfile)
                self.wfile.write(end)
        elif name in self._files:
            self._give(200, self._files[name], name)
        else:
            self._give(404, b"")

    def do_POST(self) -> None:
        """Take a layout and give it back with the wanted tab in front."""
        layout = json.loads(self.rfile.read(int(self.headers.get("Content-Length", 0))))
        try:
            changed = with_layout(layout, str(self._layout), self._run)
        except LayoutError as problem:
            self._give(404, str(problem).encode())
        else:
            self._give(200, json.dumps(changed).encode(), ".json")

    def log_message(self, *_: Any) -> None:
        """Say nothing."""

    def _give(self, status: int, body: bytes, name: str = "") -> None:
        self._begin(status, name, len(body))
        self.wfile.write(body)

    def _begin(self, status: int, name: str, size: int) -> None:
        self.send_response(status)
        self.send_header("Content-Type", KINDS.get(Path(name).suffix, "text/html"))
        self.send_header("Content-Length", str(size))
        caching = (
            "max-age=604800" if urlsplit(self.path).query else "no-store"
        )  # such an address has the version
        self.send_header("Cache-Control", caching)
        self.end_headers()


def _viewer_files() -> dict[str, bytes]:
    """Return the files of the web viewer, which the installed viewer contains and can serve. SinkError."""
    page, data = free_port(), free_port()
    try:
        server = Tied(start_viewer(data, ["--serve-web", "--web-viewer-port", str(page)]))
    except OSError as error:
        raise SinkError(viewer_binary(), f"does not start ({error.strerror})") from error
    try:
        if not wait_until_listening(server.process, page, PATIENCE_S):
            raise SinkError(viewer_binary(), "gives no web viewer")
        return {name: _read(page, name) for name in VIEWER_FILES}
    except (OSError, HTTPException) as error:
        raise SinkError(viewer_binary(), f"gives no web viewer ({error})") from error
    finally:
        server.end()


def _read(port: int, name: str) -> bytes:
    with closing(
        HTTPConnection(HOST, port, timeout=PATIENCE_S)
    ) as connection:  # unlike urlopen asks no proxy
        connection.request("GET", f"/{name}")
        return connection.getresponse().read()


def _end_of(application: str, recording: str) -> bytes:
    """Return a piece of a recording that is sent after it: the page shows the viewer once that has come."""
    rec = rr.RecordingStream(application, recording_id=recording, send_properties=False)
    piece = rr.binary_stream(rec)
    rec.send_property(END_PROPERTY, rr.AnyValues(reached=True))
    return bytes(piece.read(flush=True) or b"")


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
