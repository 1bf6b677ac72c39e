"""Seeds: which may be fitted on and which only tested on, and what the simulator draws for.

Both `--arena-seed` and `--seed` of a session count: a drive is for testing only when both are test seeds.
Seeds outside the three groups are free for trying things out; nothing that is published rests on them.
"""

from __future__ import annotations

from enum import IntEnum

# What the simulator draws for: the last word of its random addresses (see maurice_mcl.randomness).


class SimPurpose(IntEnum):
    """One stream a purpose, so that changing one part of a world leaves the others as they were."""

    WORLD = 1
    SURVEY_LIGHT = 2
    SURVEY_PLACING = 3
    SURVEY_NOISE = 4
    COVERED_NOISE = 5
    SESSION_LIGHT = 6
    SESSION_NOISE = 7
    DRIVER = 8
    ROBOT = 9
    MOVED = 10
    OCCLUDERS = 11
    LIGHT_DRIFT = 12
    KIDNAP = 13
    SLIP = 14
    START = 15
    WANDER = 16
    PROXIMITY = 17
    BARE = 18


# Which seeds may be fitted on and which may only be tested on: the split never changes.

DEMO = 0  # the first, not a chosen one
FITTING = range(1, 100)  # anything may be fitted or tuned on these
TEST = range(1000, 2000)  # nothing ever is


def for_fitting(seed: int) -> int:
    """Return a seed that may be fitted on; ValueError for any other, above all for test seeds."""
    if seed not in FITTING:
        raise ValueError(f"found seed {seed}, expected a fitting seed, {_span(FITTING)}{_whose(seed)}")
    return seed


def for_testing(seed: int) -> int:
    """Return a seed that results may be reported on; ValueError for any other."""
    if seed not in TEST:
        raise ValueError(f"found seed {seed}, expected a test seed, {_span(TEST)}{_whose(seed)}")
    return seed


def _span(seeds: range) -> str:
    return f"{seeds.start} to {seeds.stop - 1}"


def _whose(seed: int) -> str:
    names = {"the demo's": seed == DEMO, "a fitting seed": seed in FITTING, "a test seed": seed in TEST}
    return "".join(f"; it is {name}" for name, is_it in names.items() if is_it)
