"""What can be said of a run without ground truth: when it was probably lost, by the second opinion, and why.

Two numbers tell: how well the best reference of the whole library explains a picture, and how well the cloud
does. Where both fall, the pictures have changed. Where only the cloud's falls, it is at the wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...scoring.episodes import PROBABLY_LOST, Episode
from ...scoring.lost_signal import KNOWS_ABOVE
from .drive_rules import STUCK_FOR, VERY_LONG_GAP, stuck_pictures
from .evidence import UpdateEvidence
from .kinds import DATA, KIDNAPPED, LEFT_MAP, LIGHTING, UNKNOWN, VIEW, Failure
from .particle_rules import weights_vanish
from .story import Story

USUAL_OF = 5  # updates before, from which on there is a usual level
LOOKS_AT = 4 * USUAL_OF  # updates before that it is taken of
FALLEN_NATS = 4.0  # below the usual level
BEGAN_WITHIN = 10  # updates before it is probably lost, in which that began
DARKER = 1.5  # times as bright or as dark as usual


def suspected(updates: Sequence[UpdateEvidence], doubts: Sequence[tuple[int, int]]) -> tuple[Failure, ...]:
    """Return each doubt of a run without truth, from step to step, with what is suspected, in order."""
    found = [_cause(updates, Episode(PROBABLY_LOST, first, last, noticed=first)) for first, last in doubts]
    if not found and len(updates) > STUCK_FOR:
        story = Story(updates, Episode(PROBABLY_LOST, updates[0].step, updates[-1].step))
        found += [one for rule in (stuck_pictures, weights_vanish, _left) if (one := rule(story))]
    return tuple(replace(one, truth_known=False) for one in sorted(found, key=lambda one: one.first))


def _began(updates: Sequence[UpdateEvidence], lost: int) -> int:
    """Return where a doubt at an update began: after it last knew where it was, by index."""
    begin = lost
    while begin > max(lost - BEGAN_WITHIN, 1) and not _knows(updates[begin - 1]):
        begin -= 1
    return begin


def _knows(one: UpdateEvidence) -> bool:
    return (one.knows or 0.0) > KNOWS_ABOVE


def _left(story: Story) -> Failure | None:
    left = story.some(range(len(story.updates)), lambda one: one.left)
    if not left:
        return None
    return story.failure(
        LEFT_MAP, left[0].step, cloud="left the map", driven_m=left[0].driven_m, updates=len(left)
    )


def _cause(updates: Sequence[UpdateEvidence], episode: Episode) -> Failure:
    """Return what is suspected to have made a run lost, of what can be seen without truth."""
    story = Story(updates, episode)
    lost, begin = story.lost, _began(updates, story.lost)
    before, since = updates[max(0, begin - LOOKS_AT) : begin], updates[begin : lost + 1]
    first = updates[begin]
    cloud, best, gray = (_medians(before, since, name) for name in ("cloud", "best", "gray"))
    evidence = {"knows": updates[lost].knows or 0.0, "cloud_nats": cloud[1], "usual_cloud_nats": cloud[0]}
    evidence |= {"best_nats": best[1], "usual_best_nats": best[0]}
    for one in updates[max(begin - 1, 0) : lost + 1]:
        if one.kidnapped:
            return story.failure(KIDNAPPED, one.step, told="the log says so", **evidence)
        if one.left:
            return story.failure(LEFT_MAP, one.step, driven_m=one.driven_m, **evidence)
        if story.usual_s > 0 and (one.after_s or 0.0) >= VERY_LONG_GAP * story.usual_s:
            gap = {"gap_s": one.after_s or 0.0, "usual_s": story.usual_s}
            return story.failure(DATA, one.step, **gap, **evidence)
    for rule in (stuck_pictures, weights_vanish):
        if (found := rule(story)) is not None:
            return found
    times = gray[1] / max(gray[0], 1e-9)
    if best[1] < best[0] - FALLEN_NATS / 2 and not 1 / DARKER < times < DARKER:
        levels = {"brightness": times, "level": gray[1], "expected_level": gray[0]}
        return story.failure(LIGHTING, first.step, **levels, **evidence)
    if best[1] < best[0] - FALLEN_NATS / 2:
        return story.failure(VIEW, first.step, **evidence)
    fell = [one for one in since if one.cloud < cloud[0] - FALLEN_NATS]
    if fell:
        return story.failure(
            KIDNAPPED, fell[0].step, told="the cloud stopped to fit, other places do", **evidence
        )
    return story.failure(UNKNOWN, first.step, **evidence)


def _medians(
    before: Sequence[UpdateEvidence], since: Sequence[UpdateEvidence], name: str
) -> tuple[float, float]:
    first, second = (float(np.median([getattr(one, name) for one in some])) for some in (before, since))
    return first, second
