"""The optional package that reads bags, and its errors made ours."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import LogError

INSTALL = "pip install 'maurice-replay[ros]'"


def require_ros(path: Path) -> None:
    """Raise LogError, with the command that mends it, where the package that reads bags is not installed."""
    if importlib.util.find_spec("rosbags") is None:
        raise LogError(path, f"reading bags and MCAP needs an extra; {INSTALL}")


@contextmanager
def bag_errors(path: Path, advice: str = "was the recording ended properly?") -> Iterator[None]:
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
        raise LogError(path, f"{found}; {advice}") from None
