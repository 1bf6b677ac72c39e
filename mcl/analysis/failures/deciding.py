"""The order of the rules of a diagnosis: the first that holds names the cause (docs/diagnose.md).

What befell the recording and the robot comes first, as everything after it follows from it. Then what is
known of the place, the light and the view, as no filter can do without them. What is left is due to the
filter: its sensor model, its particles, and chance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .drive_rules import beyond_motion, carried, gap_in_log, off_map, slipped_as_told, stuck_pictures
from .kinds import UNKNOWN, Failure
from .particle_rules import no_particle, unlucky, weights_vanish
from .picture_rules import ambiguity, another_view, library_gap, lighting, sensor_model
from .story import Story

RULES: tuple[Callable[[Story], Failure | None], ...] = (
    gap_in_log,
    stuck_pictures,
    carried,
    off_map,
    beyond_motion,
    weights_vanish,
    library_gap,
    lighting,
    another_view,
    sensor_model,
    slipped_as_told,
    unlucky,
    ambiguity,
    no_particle,
)


def decide(story: Story) -> Failure:
    """Return the cause of one trouble, of the first rule that holds, with the kinds of the others."""
    found = [failure for rule in RULES if (failure := rule(story)) is not None]
    if not found:
        return story.failure(UNKNOWN, story.updates[story.lost].step)
    others = dict.fromkeys(one.kind for one in found[1:] if one.kind != found[0].kind)
    return replace(found[0], also=tuple(others))
