"""The arbiter: asks all behaviors and does what the most urgent one proposes."""

from __future__ import annotations

from collections.abc import Sequence

from .behaviors import Behavior, Proposal, Senses


def choose(behaviors: Sequence[Behavior], senses: Senses) -> Proposal | None:
    """Give the proposal of the highest priority, of equals the first one's; None when nobody has any."""
    proposals = [p for p in (behavior.propose(senses) for behavior in behaviors) if p is not None]
    return max(proposals, key=lambda p: p.priority, default=None)
