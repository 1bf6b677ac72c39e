"""What the simulator draws for: the last word of its random addresses (see maurice_mcl.randomness)."""

from __future__ import annotations

from enum import IntEnum


class Purpose(IntEnum):
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
