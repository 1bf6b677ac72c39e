"""The entry point of the command: a request to stop prints no traceback, even during startup and exit."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from contextlib import suppress

from .shared.errors import end_while_starting, status_of

# Python looks for garbage after so many new objects; importing makes many that stay.
COLLECT_AFTER = (200_000, 20, 100)


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    end_while_starting()
    gc.set_threshold(*COLLECT_AFTER)
    statuses: list[int] = []
    atexit.register(_end_now, statuses)  # the first one here, so the last one called
    from .app import app  # takes a fifth of a second

    try:
        app()
    except SystemExit as end:
        statuses += [end.code] if isinstance(end.code, int) else []
        raise
    except KeyboardInterrupt as stop:  # one more, while the first was handled
        statuses.append(status_of(stop))
        sys.exit(status_of(stop))
    finally:
        end_while_starting()  # also while what is left is written out


def _end_now(statuses: list[int]) -> None:
    """End the process, once all is written.

    Python would take half a second to free what ends with the process, and no longer listen to us about
    signals. After a defect, or where the output is closed, it is left to say so.
    """
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
        for status in statuses:
            os._exit(status)
