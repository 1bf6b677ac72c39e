"""Ctrl-C and SIGTERM wait for the end of an update: figures, recording and saved run go equally far."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

STOPS = (signal.SIGINT, signal.SIGTERM)


class Stops:
    """Keeps a request to stop while an update is taken in. A second one is heard at once."""

    def __init__(self) -> None:
        self._inside = False
        self._waiting: Callable[[], object] | None = None  # what the request would have done

    @contextmanager
    def wait(self) -> Iterator[None]:
        """Hold back a request that comes while this is open, until it has gone well."""
        self._inside = True
        try:
            yield
        finally:
            self._inside = False
        if self._waiting is not None:
            self._waiting()

    def answer(
        self, before: Callable[[int, FrameType | None], object]
    ) -> Callable[[int, FrameType | None], object]:
        """Give a handler of a signal that was handled by another one `before`."""

        def handle(number: int, frame: FrameType | None) -> None:
            if self._inside and self._waiting is None:
                self._waiting = lambda: before(number, frame)
            else:
                before(number, frame)

        return handle


@contextmanager
def stops_between() -> Iterator[Stops]:
    """Listen for Ctrl-C and SIGTERM where Python handles them, which is in the main thread alone."""
    stops, before = Stops(), {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in STOPS}
        before = {number: one for number, one in handlers.items() if callable(one)}
    try:
        for number, handler in before.items():
            signal.signal(number, stops.answer(handler))
        yield stops
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
