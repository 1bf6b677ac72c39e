"""The entry point of the command: a request to stop prints no traceback, even during startup and exit."""

from __future__ import annotations

import sys

from .errors import end_while_starting, status_of


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    end_while_starting()
    from .app import app  # takes a fifth of a second

    try:
        app()
    except KeyboardInterrupt as stop:  # one more, while the first was handled
        sys.exit(status_of(stop))
    finally:
        end_while_starting()  # also while what is left is written out
