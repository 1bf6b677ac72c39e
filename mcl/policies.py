"""When to resample: plain functions of the belief and the step."""

from __future__ import annotations

from collections.abc import Callable

from .belief import Belief, effective_sample_size

ResamplePolicy = Callable[[Belief, int], bool]  # the weighted belief, the step (1 for the first picture)


def always(belief: Belief, step: int) -> bool:
    """Resample at every update, as the thesis does (3.4)."""
    return True


def never(belief: Belief, step: int) -> bool:
    """Let the weights multiply up; for looking at what resampling does."""
    return False


def below_effective(share: float) -> ResamplePolicy:
    """Resample when the effective sample size falls under a share (0 to 1) of N (Liu and Chen 1995)."""

    def policy(belief: Belief, step: int) -> bool:
        return effective_sample_size(belief.log_weights) < share * belief.size

    return policy


def every(count: int) -> ResamplePolicy:
    """Resample at every so many updates."""

    def policy(belief: Belief, step: int) -> bool:
        return step % count == 0

    return policy
