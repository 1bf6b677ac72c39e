"""How hard a session is: three tiers, nominal, dim and hard, as data.

A tier says what the world looks like (its light, how much hangs on its walls) and what happens during the
session (occluders, light that drifts). Numbers are invented; docs/arena.md has what they do to the filter.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tier:
    """One tier."""

    name: str
    light: float = 1.0  # all lamps and windows times this
    bare: float = 0.0  # share of textures and things on walls that are left out, 0 to 1
    occluded: float = 0.0  # share of the session's frames in which people stand in the view
    drift: float = 0.0  # slow drift of the light within the session: largest change of gain as a share
    tint: float = 0.0  # the same for the white balance of red and blue


TIERS: dict[str, Tier] = {
    tier.name: tier
    for tier in (
        Tier("nominal"),
        Tier("dim", light=0.3),
        Tier("hard", light=0.45, bare=0.6, occluded=0.3, drift=0.2, tint=0.1),
    )
}
