"""Rules about particles: what became of those at the true place, and whether weights were numbers at all."""

from __future__ import annotations

import numpy as np

from .causes import NUMERIC, PROPOSAL, RESAMPLING, Failure
from .evidence import UpdateEvidence
from .story import Story

SHARP_NATS = 37.0  # from the best reference to the middle one: weights differ by more than a float can hold
MOST_SHARE = 0.5  # of the updates looked at
COPIES = 1.0  # times one over the number of particles: the weight that should leave a copy


def weights_vanish(story: Story) -> Failure | None:
    """Likelihoods were no numbers, or all weights zero, or all but one: rounded away, not small."""
    broken = story.where(story.window, lambda u: u.broken)
    if broken:
        return story.failure(NUMERIC, broken[0].step, weights="not a number", updates=len(broken))
    zero = story.where(story.window, lambda u: u.zero)
    if zero:
        return story.failure(NUMERIC, zero[0].step, weights="all zero", updates=len(zero))
    known = story.where(story.window, lambda u: np.isfinite(u.spread_nats))
    sharp = [update for update in known if update.spread_nats > SHARP_NATS]
    if not sharp or len(sharp) < MOST_SHARE * len(known):
        return None
    spread = float(np.median([update.spread_nats for update in sharp]))
    ess = float(np.median([update.ess for update in sharp]))
    return story.failure(
        NUMERIC, sharp[0].step, weights="all but one zero", spread_nats=spread, effective=ess
    )


def unlucky(story: Story) -> Failure | None:
    """Particles at the true place had weight for a copy or more, and resampling made none, for good."""
    known = story.where(story.since_last, lambda u: u.near is not None)
    kept = max((u.step for u in known if u.near and u.near.shares[2] > 0), default=0)
    update = next((u for u in known if u.step > kept and _counts(u)), None)
    if update is None or update.near is None:
        return None
    share = update.near.shares[1]
    evidence = {"share": share, "copies": share * update.size, "near": update.near.particles}
    return story.failure(RESAMPLING, update.step, **evidence, particles=update.size)


def no_particle(story: Story) -> Failure | None:
    """No particle was at the true place: none ever was, none for long, or the last one went."""
    known = story.where(story.since_last, lambda u: u.near is not None)
    if not known:
        return None
    nearest = min(update.near.nearest_m for update in known if update.near)
    counted = [update for update in known if _counts(update)]
    size = {"nearest_m": nearest, "particles": known[0].size}
    if not counted:
        return story.failure(PROPOSAL, known[0].step, ever="no", **size)
    lost = story.updates[story.lost].step
    before = [update for update in counted if update.step < lost]
    if not before and len(counted) >= MOST_SHARE * len(known):
        return None  # a search that had them nearly all the time
    since = before[-1] if before else counted[0]
    later = [update for update in known if update.step > since.step and update.near]
    gone = [update for update in later if update.near and not update.near.particles]
    gone = gone or [update for update in later if not before and not _counts(update)]
    if not gone and not before:
        return story.failure(PROPOSAL, known[0].step, ever="late", came=since.step, **size)
    died = gone[0].step if gone else lost
    until = [update for update in counted if update.step < died] or [since]
    return story.failure(PROPOSAL, died, ever="yes", held_until=until[-1].step, died=died, **size)


def _counts(update: UpdateEvidence) -> bool:
    """Return whether particles at the true place had weight for a copy or more."""
    return update.near is not None and update.near.shares[1] * update.size >= COPIES
