"""The order of the rules of a diagnosis, and which cause is named where several hold (docs/diagnose.md).

What befell the recording and the robot comes first, as everything after it follows from it. Then what is
known of the place, the light and the view, as no filter can do without them. What is left is due to the
filter: its sensor model, its particles, and chance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .drive_rules import (
    beyond_motion,
    carried,
    gap_in_log,
    off_map,
    out_of_plane,
    slipped_as_told,
    stuck_pictures,
)
from .kinds import LIBRARY_GAP, LIGHTING, MOTION, UNKNOWN, VIEW, Failure
from .particle_rules import no_particle, unlucky, weights_vanish
from .picture_rules import ambiguity, another_view, library_gap, lighting, sensor_model
from .story import Story

RULES: tuple[Callable[[Story], Failure | None], ...] = (
    gap_in_log,
    stuck_pictures,
    carried,
    off_map,
    out_of_plane,
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


SEEN = (LIBRARY_GAP, LIGHTING, VIEW)  # causes by which pictures speak against the true place


def decide(story: Story) -> Failure:
    """Return the cause of one episode, with the kinds of the others that hold.

    That is the first rule's that holds. A movement and a picture that coincide are weighed: the cause is the
    one by which more of the weight near the truth was lost.
    """
    failures = [failure for rule in RULES if (failure := rule(story)) is not None]
    if not failures:
        return story.failure(UNKNOWN, story.updates[story.lost].step)
    first, seen = failures[0], [one for one in failures if one.kind in SEEN]
    if first.kind == MOTION and seen and story.lost_by_pictures > story.lost_by_motion:
        first = seen[0]
    others = dict.fromkeys(one.kind for one in failures if one.kind != first.kind)
    return replace(first, also=tuple(others))
