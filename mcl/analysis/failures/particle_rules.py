"""Rules about particles: what became of those at the true place, and whether weights were numbers at all."""

from __future__ import annotations

import numpy as np

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
    """Particles at the true place had weight for a copy or more, and resampling made none."""
    for k in range(story.end, story.since - 1, -1):
        one = story.updates[k]
        if one.near is None or one.near.shares[2] > 0:
            if k < story.end:
                break
            continue
        share = one.near.shares[1]
        if share * one.size >= A_COPY:
            return story.failure(
                RESAMPLING,
                one.step,
                share=share,
                copies=share * one.size,
                near=one.near.particles,
                particles=one.size,
            )
    return None


def no_particle(story: Story) -> Failure | None:
    """No particle was at the true place: none ever was, or the last one went."""
    known = story.some(range(story.since, story.end + 1), lambda one: one.near is not None)
    if not known:
        return None
    nearest = min(one.near.nearest_m for one in known if one.near)
    counted = [one for one in known if one.near and one.near.shares[1] * one.size >= A_COPY]
    if not counted:
        return story.failure(PROPOSAL, known[0].step, ever="no", nearest_m=nearest, particles=known[0].size)
    after = [one for one in known if one.step > counted[-1].step and one.near and not one.near.particles]
    if not after:
        return None
    return story.failure(
        PROPOSAL,
        after[0].step,
        ever="yes",
        held_until=counted[-1].step,
        died=after[0].step,
        nearest_m=nearest,
        particles=after[0].size,
    )
