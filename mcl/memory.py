"""What reseeding remembers: running averages of how well the cloud explains pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Memory:
    """Averages of the mean likelihood of a picture; 0 before the first. Part of the filter's state."""

    slow: float = 0.0
    fast: float = 0.0
    spread: float = 0.0  # running mean of the squared deviation of log-likelihoods, nats squared
    updates: int = 0  # averaged over since the last reset


NOTHING = Memory()
