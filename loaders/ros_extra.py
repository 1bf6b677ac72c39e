"""The optional package that reads bags, and its errors made ours."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .errors import LogError

INSTALL = "pip install 'maurice-replay[ros]'"


def require_ros(path: Path) -> None:
    """Raise LogError, with the command that mends it, where the package that reads bags is not installed."""
    if importlib.util.find_spec("rosbags") is None:
        raise LogError(path, f"reading bags and MCAP needs an extra; {INSTALL}")


@contextmanager
def bag_errors(path: Path) -> Iterator[None]:
    """Turn whatever a reader stumbles over in a damaged file into a LogError.

    The readers raise anything, from their own errors to an assertion or a number that does not fit, so
    everything is caught here: wrap nothing but calls into them.
    """
    try:
        yield
    except LogError:
        raise
    except Exception as problem:
        said = " ".join(str(problem).split())[:200] or type(problem).__name__
        found = f"found a damaged or unreadable bag ({said}), expected a whole one"
        raise LogError(path, f"{found}; was the recording ended properly?") from None


def each(path: Path, messages: Iterable[tuple[Any, int, bytes]]) -> Iterator[tuple[Any, int, bytes]]:
    """Go through a reader's messages; errors as in `bag_errors`."""
    going = iter(messages)
    while True:
        with bag_errors(path):
            message = next(going, None)
        if message is None:
            return
        yield message
