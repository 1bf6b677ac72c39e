"""Where the command begins: being stopped is no defect, and so no traceback, not even while starting."""

from __future__ import annotations

import signal
import sys
from types import FrameType


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    try:
        from .errors import Terminated

        def terminate(number: int, frame: FrameType | None) -> None:
            raise Terminated

        signal.signal(signal.SIGTERM, terminate)
        from .cli import app

        app()
    except KeyboardInterrupt as stop:
        sys.stderr.write("maurice-replay: stopped\n")
        sys.exit(143 if type(stop).__name__ == "Terminated" else 130)
