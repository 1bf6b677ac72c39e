"""Randomness by address: every draw can be repeated alone, knowing the seed, the step and the purpose."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Domain(IntEnum):
    """Who draws. Simulator and filter never share a stream."""

    FILTER = 1
    SIMULATOR = 2
    IMPORT = 3


class Purpose(IntEnum):
    """What the filter draws for."""

    START = 1
    MOTION = 2
    RESAMPLE = 3
    INJECT = 4


def stream(domain: int, seed: int, step: int = 0, purpose: int = 0) -> np.random.Generator:
    """Open the generator at one address; the same address always gives the same numbers.

    Draw per-particle noise as `standard_normal((N, k))`: rows come one after the other, so a larger N
    keeps a smaller one's draws. Whole-array tricks (Box-Muller on halves, sorting) would break that.
    """
    words = [int(domain), int(seed), int(step), int(purpose)]
    if any(not 0 <= w < 2**32 for w in words):
        raise ValueError(f"a random address needs whole numbers from 0 to 2**32 - 1, found {words}")
    return np.random.default_rng(words)
