"""The listener: how a function that takes a while reports remarks, warnings and progress to its caller.

Nothing under `maurice_viz` but the command line prints. A caller passes a listener, or none for
silence; the command line passes one that writes to standard error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class Listener(Protocol):
    """What a caller may pass to follow a function: three callbacks, none of which returns anything.

    >>> import maurice_viz as mv
    >>> class Printer:
    ...     def remark(self, text: str) -> None:
    ...         print(text)
    ...     def warning(self, text: str) -> None:
    ...         print("warning:", text)
    ...     def progress(self, done: int, total: int, what: str) -> None:
    ...         pass
    >>> converted = mv.convert("session.log", "drive", listener=Printer())
    """

    def remark(self, text: str) -> None:
        """Receive a line of interest: what was detected, written or left out."""
        ...

    def warning(self, text: str) -> None:
        """Receive a line about something wrong that did not end the function."""
        ...

    def progress(self, done: int, total: int, what: str) -> None:
        """Receive that `done` of `total` are done (0: total not known) of `what`, such as "replay"."""
        ...


class SilentListener:
    """Ignores everything: the default wherever a listener can be passed."""

    def remark(self, text: str) -> None:
        """Ignore a remark."""

    def warning(self, text: str) -> None:
        """Ignore a warning."""

    def progress(self, done: int, total: int, what: str) -> None:
        """Ignore progress."""


SILENT: Listener = SilentListener()


def progress_of(listener: Listener, what: str) -> Callable[[int, int], None]:
    """Return the callback `(done, total)` that functions of the lower packages take, under one name."""
    return lambda done, total: listener.progress(done, total, what)
