"""What can go wrong with showing, as one line for people."""

from __future__ import annotations

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
