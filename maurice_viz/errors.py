"""What a function tells its caller: errors, and by a listener remarks, warnings and progress.

Nothing under `maurice_viz` but the command line prints. A caller passes a listener, or none for silence; the
command line passes one that writes to standard error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from maurice_loaders.errors import InputError


class OptionError(InputError):
    """An argument has a value that it cannot have: what was found, what was expected.

    On the command line it is a usage error, exit status 2.
    """

    def __init__(self, message: str) -> None:
        """Describe the argument in one line; there is no file to name."""
        super().__init__(None, message)


class SinkError(InputError):
    """A recording cannot be written or shown: what, where, what to do. The figures are not touched by it."""


class Terminated(KeyboardInterrupt):
    """The process was asked to end (SIGTERM): it ends as after Ctrl-C, with its own exit status."""


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


def once(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Return what passes on every text once: several runs often have the same to tell."""
    texts = set[str]()

    def tell_once(text: str) -> None:
        if text not in texts:
            texts.add(text)
            tell(text)

    return tell_once
