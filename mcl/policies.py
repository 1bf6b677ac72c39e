"""When to resample, as plain functions of the belief."""

from __future__ import annotations

from collections.abc import Callable

from .belief import Belief

ResamplePolicy = Callable[[Belief], bool]


def always(belief: Belief) -> bool:
    """Resample at every update, as the thesis does (3.4)."""
    return True


def never(belief: Belief) -> bool:
    """Let the weights multiply up; for looking at what resampling does."""
    return False
