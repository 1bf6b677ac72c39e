"""The live robot: drives, looks, and says so line by line to whoever listens, at its own pace."""

from __future__ import annotations

import time
from collections.abc import Callable

from .broadcast import FAREWELL_S, Address, Broadcast, Tally
from .legs import Progress
from .live_log import LiveLog, header_line
from .maurice import one_thread, play, session_info
from .simulation import Plan, stage


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
    plan: Plan,
    address: Address,
    rate: float,
    *,
    truth: bool = True,
    ready: Callable[[Address], None],
    over: Callable[[Tally], None],
    progress: Progress | None = None,
) -> None:
    """Drive a whole session and say its lines at an address.

    `ready` is told where it listens, as soon as it does, and `over` what became of the lines, also when the
    robot is stopped half way. LogError for worlds and recordings that cannot be used,
    OSError where one cannot listen. Readers get the header first, then what is said from then on.
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
