"""Where the command begins: being stopped gives no traceback, not even while starting."""

from __future__ import annotations

from .errors import end_while_starting


def main() -> None:
    """Run `maurice-replay`; exit status 130 after Ctrl-C and 143 after SIGTERM."""
    end_while_starting()
    from .app import app  # takes a fifth of a second

    app()
