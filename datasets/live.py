"""The live robot: drives, takes pictures, and sends a session log line by line to its readers."""

from __future__ import annotations

import base64
import errno
import queue
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from maurice_loaders.files.pictures import encode_jpeg
from maurice_loaders.session_log.header import header_to_json
from maurice_loaders.session_log.records import line_of
from maurice_loaders.session_log.writer import LogLines
from maurice_mcl.values import U8, NamedProgress, SessionInfo

from .sessions import play, session_info
from .simulation import SimulationPlan, stage
from .surveys import one_thread

# Lines to readers, over TCP. A reader that connects late, reads slowly or leaves does not disturb the others.

WAITING = 256  # lines kept for one reader: some 20 updates with their pictures, about 4 MB
FAREWELL_S = 5.0  # time that a reader has for the rest after the last line
ACCEPT_S = 0.2  # how often the one who accepts looks whether it is over


@dataclass(frozen=True, slots=True)
class Address:
    """Where to listen."""

    host: str
    port: int  # 0: any that is free

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp://{host}:{self.port}"


def parse_address(text: str) -> Address:
    """Read tcp://HOST:PORT. ValueError for anything else."""
    fault = f"found {text!r}, expected tcp://HOST:PORT, for example tcp://127.0.0.1:5005"
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise ValueError(fault) from None
    extra = parts.path or parts.query or parts.fragment or parts.username
    if parts.scheme != "tcp" or not host or port is None or extra:
        raise ValueError(fault)
    return Address(host, port)


@dataclass(frozen=True, slots=True)
class Tally:
    """How many lines were sent and lost."""

    readers: int = 0  # that ever connected
    dropped: int = 0  # lines left out, for all slow readers together


class ConnectedReader:
    """One who listens: a queue with an end to it, and a thread that empties it into the socket."""

    def __init__(self, connection: socket.socket, header: bytes) -> None:
        self.dropped = 0
        self.gone = False
        self._connection = connection
        self._lines: queue.Queue[bytes | None] = queue.Queue(WAITING)
        self._lines.put(header)
        self._thread = threading.Thread(target=self._send_all, daemon=True)
        self._thread.start()

    def offer(self, line: bytes) -> None:
        """Take a line if there is room; never waits."""
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self.dropped += 1

    def finish(self, until: float) -> None:
        """Send what waits, but only until a moment of the monotonic clock; then hang up."""
        try:
            self._lines.put(None, timeout=max(0.0, until - time.monotonic()))
            self._thread.join(max(0.0, until - time.monotonic()))
        except queue.Full:
            pass
        self.dropped += 0 if self.gone else sum(line is not None for line in self._lines.queue)
        self.gone = True
        _hang_up(self._connection)
        self._thread.join(FAREWELL_S)

    def _send_all(self) -> None:
        try:
            while not self.gone and (line := self._lines.get()) is not None:
                self._connection.sendall(line)
        except OSError:  # went away, which is its right
            pass
        self.gone = True
        _hang_up(self._connection)


class Broadcast:
    """Listens at an address and sends every reader the header, then each line; OSError if it cannot."""

    def __init__(self, address: Address, header: bytes) -> None:
        self._header = header
        self._socket = _listen(address)
        self.address = Address(address.host, int(self._socket.getsockname()[1]))
        self._readers: list[ConnectedReader] = []
        self._tally = Tally()
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def say(self, line: bytes) -> None:
        """Queue a complete line for all readers; never wait for any of them."""
        with self._lock:
            for reader in self._readers:
                reader.offer(line)
            for reader in [r for r in self._readers if r.gone]:
                self._forget(reader)

    def close(self, patience_s: float = FAREWELL_S) -> Tally:
        """Send readers the rest, up to a time limit, and close the connections."""
        self._over.set()
        self._thread.join()
        self._socket.close()
        until = time.monotonic() + patience_s
        for reader in list(self._readers):
            reader.finish(until)
            self._forget(reader)
        return self._tally

    def _forget(self, reader: ConnectedReader) -> None:
        self._readers.remove(reader)
        self._tally = Tally(self._tally.readers, self._tally.dropped + reader.dropped)

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                connection, _ = self._socket.accept()
            except OSError:  # nobody came in time, or went away before being let in
                continue
            connection.settimeout(None)
            with self._lock:
                self._readers.append(ConnectedReader(connection, self._header))
                self._tally = Tally(self._tally.readers + 1, self._tally.dropped)


def _listen(address: Address) -> socket.socket:
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        listening = socket.create_server((address.host, address.port), family=family)
    except OSError as problem:
        advice = "; choose another port, or 0 for any" if problem.errno == errno.EADDRINUSE else ""
        reason = (problem.strerror or str(problem)).partition(" (while")[0]
        raise OSError(problem.errno, f"cannot listen there: {reason}{advice}", str(address)) from None
    listening.settimeout(ACCEPT_S)
    return listening


def _hang_up(connection: socket.socket) -> None:
    with suppress(OSError):  # is down already
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()


# A session log as lines with everything in them: what a live robot speaks.

Say = Callable[[float, bytes], None]  # takes a line and the time it belongs to, in s


def header_line(info: SessionInfo) -> bytes:
    """Return the first line of a session log; a relative survey path stays as it is."""
    return line_of(header_to_json(info, "session", Path()))


class LiveLog(LogLines):
    """Says each record of a session as a line, pictures inline; truth and events only if wanted."""

    def __init__(self, say: Say, *, truth: bool = True) -> None:
        self._say = say
        self._left_out = set() if truth else {"truth", "event"}  # what a real robot would not know

    def image(self, t_s: float, image_rgb: U8, *, camera: str | None = None) -> None:
        """Send a picture: JPEG in base64."""
        data = base64.b64encode(encode_jpeg(image_rgb)).decode("ascii")
        named = {} if camera is None else {"camera": camera}
        self._record(t_s, {"image": {"base64": data}} | named)

    def _record(self, t_s: float, record: dict[str, Any]) -> None:
        if not self._left_out & record.keys():
            self._say(t_s, line_of({"t": float(t_s)} | record))


class Pace:
    """Waits until it is time: session seconds run `rate` times as fast as the clock; 0 never waits."""

    def __init__(self, rate: float, clock: Callable[[], float], sleep: Callable[[float], None]) -> None:
        self._rate, self._clock, self._sleep = rate, clock, sleep
        self._begun = clock()

    def wait(self, t_s: float) -> None:
        """Wait for a session time. What is late is not waited for, and what follows keeps its own time."""
        if self._rate > 0 and (left := self._begun + t_s / self._rate - self._clock()) > 0:
            self._sleep(left)


def serve(
    plan: SimulationPlan,
    address: Address,
    rate: float,
    *,
    truth: bool = True,
    ready: Callable[[Address], None],
    over: Callable[[Tally], None],
    progress: NamedProgress | None = None,
) -> None:
    """Drive a complete session and send its lines at an address.

    `ready` is called with the address as soon as it listens, and `over` with the line counts, also when
    stopped halfway. InputError for worlds and recordings that cannot be used, OSError if the address cannot
    be.
    """
    with one_thread():
        set_up = stage(plan)
        listeners = Broadcast(address, header_line(session_info(set_up)))
        patience_s = 0.0  # of a robot that is switched off
        try:
            ready(listeners.address)
            pace = Pace(rate, time.monotonic, time.sleep)

            def say(t_s: float, line: bytes) -> None:
                pace.wait(t_s)
                listeners.say(line)

            play(set_up, LiveLog(say, truth=truth), progress or (lambda done, total, what: None))
            patience_s = FAREWELL_S
        finally:
            over(listeners.close(patience_s))
