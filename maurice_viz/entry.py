"""Where the command begins: being stopped is no defect, and so no traceback, not even while starting."""

from __future__ import annotations

import signal
import sys
from types import FrameType

INTERRUPTED = 130  # what a shell says of a command ended by Ctrl-C ...
TERMINATED = 143  # ... and by SIGTERM


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    asked: list[int] = []  # signals to end
    try:
        from .errors import Terminated

        def terminate(number: int, frame: FrameType | None) -> None:
            asked.append(number)
            raise Terminated

        signal.signal(signal.SIGTERM, terminate)
        from .cli import app

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


def _unsaid(end: SystemExit) -> bool:
    """Tell whether typer ended a command for a Ctrl-C that the command itself did not see."""
    return end.__context__ is not None and isinstance(end.__context__.__cause__, KeyboardInterrupt)
