"""Peers for tests of live sources: whoever connects is sent what is scripted."""

from __future__ import annotations

import base64
import json
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from maurice_loaders.files.pictures import encode_jpeg

HEADER = json.dumps({"format": "maurice-session-log", "version": 1, "kind": "session", "name": "live"})
PICTURE = base64.b64encode(encode_jpeg(np.full((6, 8, 3), 90, np.uint8))).decode()
Act = Callable[[socket.socket], None]


def line(t_s: float, **record: object) -> bytes:
    return (json.dumps({"t": t_s} | record) + "\n").encode()


def update(t_s: float, forward_m: float = 0.1) -> bytes:
    """A movement and a picture after it."""
    return line(t_s, odometry=[forward_m, 0.0, 0.0]) + line(t_s, image={"base64": PICTURE})


def log(times: Iterable[float], header: str = HEADER) -> bytes:
    return header.encode() + b"\n" + b"".join(update(t) for t in times)


def says(data: bytes) -> Act:
    return lambda connection: connection.sendall(data)


def says_nothing_until(over: threading.Event) -> Act:
    return lambda connection: over.wait(30) and None


def free_address() -> str:
    """Where nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"tcp://127.0.0.1:{server.getsockname()[1]}"


@contextmanager
def peer(*acts: Act) -> Iterator[str]:
    """Listen; the first who connects meets the first act, and so on, then nobody is let in."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            for act in acts:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                with connection:
                    try:
                        act(connection)
                    except OSError:  # hung up on
                        continue
            server.close()

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield address
        server.close()
        thread.join(10)
