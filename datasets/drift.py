"""Slow drift of gain and white balance within a session: smooth, seeded, within its bound."""

from __future__ import annotations

import numpy as np

from maurice_mcl.randomness import Domain, stream

from .addresses import Purpose
from .conditions import Conditions
from .sensor import Exposure

PERIODS = (140.0, 61.0)  # updates of a slow and a less slow swing; no ratio of small numbers
SHARES = (0.7, 0.3)  # of the bound that each may take


def swings(seed: int, number: int, count: int) -> list[float]:
    """Give `count` smooth functions of the update, each within -1 and 1."""
    phases = stream(Domain.SIMULATOR, seed, 0, Purpose.LIGHT_DRIFT).uniform(0, 2 * np.pi, (count, 2))
    waves = np.sin(2 * np.pi * number / np.array(PERIODS) + phases)
    return [float(value) for value in waves @ np.array(SHARES)]


def drifted(exposure: Exposure, conditions: Conditions, seed: int, number: int) -> Exposure:
    """Give the exposure at one update: all colors drift together, and red and blue each on their own."""
    common, red, blue = swings(seed, number, 3)
    gain = 1 + conditions.drift * common
    shares = (1 + conditions.tint * red, 1.0, 1 + conditions.tint * blue)
    r, g, b = (before * gain * share for before, share in zip(exposure.gain, shares, strict=True))
    return Exposure((r, g, b), exposure.automatic)
