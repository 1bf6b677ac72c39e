"""Lines to whoever listens, over TCP. Who connects late, reads slowly or goes away disturbs nobody else."""

from __future__ import annotations

import errno
import queue
import socket
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import urlsplit

WAITING = 256  # lines kept for one reader: some 20 updates with their pictures, about 4 MB
FAREWELL_S = 5.0  # what a reader gets to read the rest when all is said
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
    wanted = f"found {text!r}, expected tcp://HOST:PORT, for example tcp://127.0.0.1:5005"
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise ValueError(wanted) from None
    extra = parts.path or parts.query or parts.fragment or parts.username
    if parts.scheme != "tcp" or not host or port is None or extra:
        raise ValueError(wanted)
    return Address(host, port)


@dataclass(frozen=True, slots=True)
class Tally:
    """What became of the lines."""

    readers: int = 0  # that ever connected
    dropped: int = 0  # lines left out, for all slow readers together


class Reader:
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
    """Listens at an address and sends every reader the header, then each line said from then on.

    OSError, naming the address, where one cannot listen there.
    """

    def __init__(self, address: Address, header: bytes) -> None:
        self._header = header
        self._socket = _listen(address)
        self.address = Address(address.host, int(self._socket.getsockname()[1]))
        self._readers: list[Reader] = []
        self._tally = Tally()
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def say(self, line: bytes) -> None:
        """Offer a whole line to all readers; never waits for any of them."""
        with self._lock:
            for reader in self._readers:
                reader.offer(line)
            for reader in [r for r in self._readers if r.gone]:
                self._forget(reader)

    def close(self, patience_s: float = FAREWELL_S) -> Tally:
        """Let readers have the rest, as long as they do not take too long, and hang up."""
        self._over.set()
        self._thread.join()
        self._socket.close()
        until = time.monotonic() + patience_s
        for reader in list(self._readers):
            reader.finish(until)
            self._forget(reader)
        return self._tally

    def _forget(self, reader: Reader) -> None:
        self._readers.remove(reader)
        self._tally = Tally(self._tally.readers, self._tally.dropped + reader.dropped)

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                connection, _ = self._socket.accept()
            except TimeoutError:
                continue
            except OSError:  # it went away before it was let in
                continue
            connection.settimeout(None)
            with self._lock:
                self._readers.append(Reader(connection, self._header))
                self._tally = Tally(self._tally.readers + 1, self._tally.dropped)


def _listen(address: Address) -> socket.socket:
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # or a port rests for minutes
        listening.bind((address.host, address.port))
        listening.listen()
    except OSError as problem:
        listening.close()
        advice = "; choose another port, or 0 for any" if problem.errno == errno.EADDRINUSE else ""
        raise OSError(
            problem.errno, f"cannot listen there: {problem.strerror}{advice}", str(address)
        ) from None
    listening.settimeout(ACCEPT_S)
    return listening


def _hang_up(connection: socket.socket) -> None:
    with suppress(OSError):  # is down already
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()
