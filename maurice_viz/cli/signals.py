"""Ctrl-C and SIGTERM: they end the process at once while it starts, and by an exception afterwards."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}  # what a shell gives a command ended by a signal


def end_while_starting() -> None:
    """Let both signals end the process at once, unless its parent has it ignore them."""
    for number in STATUS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, end_at_once)


def end_at_once(number: int, frame: FrameType | None) -> None:
    """End the process: while modules are imported nothing needs cleaning up, and an exception may be lost."""
    os.write(sys.stderr.fileno(), b"maurice-replay: stopped\n")
    os._exit(STATUS[signal.Signals(number)])


def stop(number: int, frame: FrameType | None) -> None:
    """Stop the command by an exception, so that it closes what it has open."""
    from ..errors import Terminated

    raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


def stop_by_exception() -> None:
    """From here on the command has things to close: let a request to stop raise an exception."""
    for number in STATUS:
        if signal.getsignal(number) is end_at_once:
            signal.signal(number, stop)
