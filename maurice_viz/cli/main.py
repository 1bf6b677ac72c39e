"""Where the command begins: being stopped is no defect, and so no traceback, not even while starting."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

INTERRUPTED = 130  # what a shell says of a command ended by Ctrl-C ...
TERMINATED = 143  # ... and by SIGTERM
AGAIN_S = 0.05


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    asked: list[int] = []  # signals to end
    try:
        from ..errors import Terminated

        def terminate(number: int, frame: FrameType | None) -> None:
            asked.append(number)
            raise Terminated

        signal.signal(signal.SIGTERM, terminate)
        sys.unraisablehook = _raised_again(asked)
        from .app import app

        app()
    except KeyboardInterrupt:
        sys.stderr.write("maurice-replay: stopped\n")
        sys.exit(TERMINATED if asked else INTERRUPTED)
    except SystemExit as end:  # typer takes whatever stops a command for Ctrl-C
        if _unsaid(end):
            sys.stderr.write("maurice-replay: stopped\n")
        if asked and end.code == INTERRUPTED:
            sys.exit(TERMINATED)
        raise


def _raised_again(asked: list[int]) -> Callable[[sys.UnraisableHookArgs], None]:
    """Make sure that being stopped is not overheard.

    Where a signal comes while Python runs a callback of its own, as it does while importing, the exception is
    lost. The signal is sent again a moment later.
    """
    main_thread = threading.get_ident()

    def send(number: signal.Signals) -> None:
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main_thread, number)  # also ends its sleep
        else:  # Windows
            _thread.interrupt_main(number)

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if isinstance(lost.exc_value, KeyboardInterrupt):
            number = signal.SIGTERM if asked else signal.SIGINT
            threading.Timer(AGAIN_S, send, [number]).start()
        else:
            sys.__unraisablehook__(lost)

    return hook


def _unsaid(end: SystemExit) -> bool:
    """Tell whether typer ended a command for a Ctrl-C that the command itself did not see."""
    return end.__context__ is not None and isinstance(end.__context__.__cause__, KeyboardInterrupt)
