"""Ctrl-C and SIGTERM wait for the end of an update: figures, recording and saved run end at the same one."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from ..errors import Terminated

STOPS = (signal.SIGINT, signal.SIGTERM)


class Stops:
    """Remembers a request to stop while an update is processed; a second one takes effect at once."""

    def __init__(self) -> None:
        self._inside = False
        self._requested: int | None = None  # the signal that came inside

    @contextmanager
    def wait(self) -> Iterator[None]:
        """Hold back a request that comes inside until the block has ended without an error."""
        self._inside = True
        try:
            yield
        finally:
            self._inside = False
        if self._requested is not None:
            raise Terminated if self._requested == signal.SIGTERM else KeyboardInterrupt

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal, as `signal.signal` takes it."""
        first, self._requested = self._requested is None, number
        if not (self._inside and first):
            raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def stops_between() -> Iterator[Stops]:
    """Handle both signals in the main thread, the only one in which Python can; what is ignored stays so.

    SIGTERM is left alone where nobody has set a handler: it then ends the process at once, as usual.
    """
    stops, before = Stops(), dict[int, Any]()
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in STOPS}
        before = {number: handler for number, handler in before.items() if callable(handler)}
    try:
        for number in before:
            signal.signal(number, stops.handle)
        yield stops
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
