"""Why a run did not have the true place, in words: what became of its particles near the truth."""

from __future__ import annotations

from maurice_mcl.analysis.failures.causes import SLIPPED, TURNED
from maurice_mcl.analysis.failures.near_truth import MISLED, MOVED, NEVER, OUTWEIGHED, Vanishing
from maurice_mcl.analysis.failures.verdict import Trouble

from ..style import Scale

SLIPS = (SLIPPED, TURNED)


def why(trouble: Trouble, scale: Scale) -> tuple[str, str]:
    """Return how the particles near the truth went, and how pictures fit there since; empty if not known."""
    one = trouble.why
    if one is None or not trouble.needs_why:
        return "", ""
    return _went(trouble, one, scale), _since(one, trouble.fresh)


def _went(trouble: Trouble, one: Vanishing, scale: Scale) -> str:
    if one.kind == MISLED:
        worse = one.pictures - one.better
        return f"{worse} of {one.pictures} pictures fit a wrong place better than the true one"
    if one.kind == NEVER:
        nearest = scale.say(one.nearest_m)
        return f"none of its {one.particles} particles was ever at the true place ({nearest} away at best)"
    particles = f"all {one.near} particles at the true place"
    if one.kind == MOVED:
        is_slip = trouble.cause is not None and trouble.cause.kind in SLIPS
        led = f"that slip led {particles} astray" if is_slip else f"{particles} drove off it"
        return f"{led} by {one.gone}"
    if one.kind == OUTWEIGHED:
        return f"the pictures fit other places better, and {particles} were gone by {one.gone}"
    return f"resampling dropped {particles} by {one.gone}, by chance"


def _since(one: Vanishing, fresh: int) -> str:
    if one.gone is None or one.fits is None:
        return ""
    if not one.fits:
        few = f"only {one.better} of {one.pictures} pictures since fit that place"
        return f"{few} better than where the filter was"
    drawn = "" if fresh else ", and none was drawn"
    better = f"{one.better} of {one.pictures} pictures since fit that place better"
    return f"{better}, but no particle was left there{drawn}"
