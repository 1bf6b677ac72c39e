"""What can go wrong with showing, as one line for people."""

from __future__ import annotations

from maurice_loaders.errors import LogError


class SinkError(LogError):
    """A recording cannot be written or shown: what, where, what to do. The figures are not touched by it."""


class Terminated(KeyboardInterrupt):
    """The process was asked to end (SIGTERM): it ends as after Ctrl-C, with its own exit status."""
