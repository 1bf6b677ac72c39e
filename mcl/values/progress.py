"""Who hears how far a long work is: functions that callers may pass."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]  # done, of how many
NamedProgress = Callable[[int, int, str], None]  # and what is being made
