"""What can be said of a run without ground truth: when its cloud stopped to explain the pictures, and why.

Two numbers tell: how well the best reference of the whole library explains a picture, and how well the cloud
does. Where both fall, the pictures have changed. Where only the cloud's falls, it is at the wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .drive_rules import LONG_GAP, STUCK_FOR, stuck_pictures
from .evidence import UpdateEvidence
from .kinds import DATA, KIDNAPPED, LEFT_MAP, LIGHTING, UNKNOWN, VIEW, Failure
from .particle_rules import weights_vanish
from .story import Story

USUAL_OF = 5  # updates before, from which on there is a usual level
FALLEN_FOR = 4  # updates in a row
FALLEN_NATS = 4.0  # below the usual level
DARKER = 1.5  # times as bright or as dark as usual


def suspected(updates: Sequence[UpdateEvidence]) -> tuple[Failure, ...]:
    """Return what is suspected of a run without truth, in order: at most one of a kind at a time."""
    found: list[Failure] = []
    k = 0
    while k < len(updates):
        end = _fallen(updates, k)
        if end is not None:
            found.append(_cause(updates, k, end))
            k = end
        k += 1
    if not found and len(updates) > STUCK_FOR:
        story = Story(updates, 0, len(updates) - 1)
        found += [one for rule in (stuck_pictures, weights_vanish, _left) if (one := rule(story))]
    return tuple(replace(one, truth_known=False) for one in sorted(found, key=lambda one: one.first))


def _left(story: Story) -> Failure | None:
    left = story.some(range(len(story.updates)), lambda one: one.left)
    if not left:
        return None
    return story.failure(
        LEFT_MAP, left[0].step, cloud="left the map", driven_m=left[0].driven_m, updates=len(left)
    )


def _fallen(updates: Sequence[UpdateEvidence], k: int) -> int | None:
    """Return the last update of a time, begun at an index, in which the cloud explained pictures badly."""
    if k < USUAL_OF:
        return None
    usual = float(np.median([one.cloud for one in updates[max(0, k - 4 * USUAL_OF) : k]]))
    end = k
    while end < len(updates) and updates[end].cloud < usual - FALLEN_NATS:
        end += 1
    return end - 1 if end - k >= FALLEN_FOR else None


def _cause(updates: Sequence[UpdateEvidence], k: int, end: int) -> Failure:
    """Return what is suspected to have made the cloud explain pictures badly."""
    story = Story(updates, k, end)
    before, since = updates[max(0, k - 4 * USUAL_OF) : k], updates[k : end + 1]
    first = updates[k]
    cloud, best, gray = (_medians(before, since, name) for name in ("cloud", "best", "gray"))
    evidence = {"cloud_nats": cloud[1], "usual_cloud_nats": cloud[0]}
    evidence |= {"best_nats": best[1], "usual_best_nats": best[0]}
    if story.usual_s > 0 and (first.after_s or 0.0) >= LONG_GAP * story.usual_s:
        gap = {"gap_s": first.after_s or 0.0, "usual_s": story.usual_s}
        return story.failure(DATA, first.step, **gap, **evidence)
    if (stuck := stuck_pictures(story)) is not None:
        return stuck
    if first.left:
        return story.failure(LEFT_MAP, first.step, driven_m=first.driven_m, **evidence)
    if best[1] > best[0] - FALLEN_NATS / 2:
        kind = KIDNAPPED if first.cloud < cloud[0] - FALLEN_NATS else UNKNOWN
        return story.failure(kind, first.step, told="the cloud stopped to fit, other places do", **evidence)
    times = gray[1] / max(gray[0], 1e-9)
    if not 1 / DARKER < times < DARKER:
        levels = {"brightness": times, "level": gray[1], "expected_level": gray[0]}
        return story.failure(LIGHTING, first.step, **levels, **evidence)
    return story.failure(VIEW, first.step, **evidence)


def _medians(
    before: Sequence[UpdateEvidence], since: Sequence[UpdateEvidence], name: str
) -> tuple[float, float]:
    first, second = (float(np.median([getattr(one, name) for one in some])) for some in (before, since))
    return first, second
