"""Rules about particles: what became of those at the true place, and whether weights were numbers at all."""

from __future__ import annotations

import numpy as np

from .evidence import UpdateEvidence
from .kinds import NUMERIC, PROPOSAL, RESAMPLING, Failure
from .story import Story

SHARP_NATS = 37.0  # from the best reference to the middle one: weights differ by more than a float can hold
MOSTLY = 0.5  # of the updates looked at
A_COPY = 1.0  # times one over the number of particles: the weight that should leave a copy


def weights_vanish(story: Story) -> Failure | None:
    """Likelihoods were no numbers, or all weights zero, or all but one: rounded away, not small."""
    broken = story.some(story.window, lambda one: one.broken)
    if broken:
        return story.failure(NUMERIC, broken[0].step, weights="not a number", updates=len(broken))
    zero = story.some(story.window, lambda one: one.zero)
    if zero:
        return story.failure(NUMERIC, zero[0].step, weights="all zero", updates=len(zero))
    known = story.some(story.window, lambda one: np.isfinite(one.spread_nats))
    sharp = [one for one in known if one.spread_nats > SHARP_NATS]
    if not sharp or len(sharp) < MOSTLY * len(known):
        return None
    spread = float(np.median([one.spread_nats for one in sharp]))
    ess = float(np.median([one.ess for one in sharp]))
    return story.failure(
        NUMERIC, sharp[0].step, weights="all but one zero", spread_nats=spread, effective=ess
    )


def unlucky(story: Story) -> Failure | None:
    """Particles at the true place had weight for a copy or more, and resampling made none, for good."""
    known = [k for k in range(story.since, story.end + 1) if story.updates[k].near is not None]
    kept = [k for k in known if (near := story.updates[k].near) and near.shares[2] > 0]
    after = [story.updates[k] for k in known if not kept or k > kept[-1]]
    counted = [one for one in after if _counts(one)]
    if not counted or (one := counted[0]).near is None:
        return None
    share = one.near.shares[1]
    had = {"share": share, "copies": share * one.size, "near": one.near.particles}
    return story.failure(RESAMPLING, one.step, **had, particles=one.size)


def no_particle(story: Story) -> Failure | None:
    """No particle was at the true place: none ever was, none for long, or the last one went."""
    known = story.some(range(story.since, story.end + 1), lambda one: one.near is not None)
    if not known:
        return None
    nearest = min(one.near.nearest_m for one in known if one.near)
    counted = [one for one in known if _counts(one)]
    size = {"nearest_m": nearest, "particles": known[0].size}
    if not counted:
        return story.failure(PROPOSAL, known[0].step, ever="no", **size)
    lost = story.updates[story.lost].step
    before = [one for one in counted if one.step < lost]
    if not before and len(counted) >= MOSTLY * len(known):
        return None  # a search that had them nearly all the time
    since = before[-1] if before else counted[0]
    later = [one for one in known if one.step > since.step and one.near]
    gone = [one for one in later if one.near and not one.near.particles]
    gone = gone or [one for one in later if not before and not _counts(one)]
    if not gone and not before:
        return story.failure(PROPOSAL, known[0].step, ever="late", came=since.step, **size)
    died = gone[0].step if gone else lost
    until = [one for one in counted if one.step < died] or [since]
    return story.failure(PROPOSAL, died, ever="yes", held_until=until[-1].step, died=died, **size)


def _counts(one: UpdateEvidence) -> bool:
    """Return whether particles at the true place had weight for a copy or more."""
    return one.near is not None and one.near.shares[1] * one.size >= A_COPY
