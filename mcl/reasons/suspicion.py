"""What can be said of a run without ground truth: when it was probably lost, by the second opinion, and why.

Two numbers tell: how well the best reference of the whole library explains a picture, and how well the cloud
does. Where both fall, the pictures have changed. Where only the cloud's falls, it is at the wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..scoring.episodes import PROBABLY_LOST, Episode
from ..scoring.lost_signal import KNOWS_ABOVE
from .causes import DATA, KIDNAPPED, LEFT_MAP, LIGHTING, UNKNOWN, VIEW, Failure
from .drive_rules import STUCK_PICTURES, VERY_LONG_GAP, cloud_left, stuck_pictures
from .evidence import UpdateEvidence
from .particle_rules import weights_vanish
from .story import Story

USUAL_UPDATES = 20  # before, of which the usual level is taken
FALLEN_NATS = 4.0  # below the usual level
BEGAN_UPDATES = 10  # before it is probably lost, in which that began
LIGHT_TIMES = 1.5  # as bright or as dark as usual
LOG_SAYS, PICTURES_SAY = "the log says so", "the cloud stopped to fit, other places do"  # that it was carried


def suspected(updates: Sequence[UpdateEvidence], doubts: Sequence[tuple[int, int]]) -> tuple[Failure, ...]:
    """Return each doubt of a run without truth, from step to step, with what is suspected, in order."""
    failures = [_cause(updates, Episode(PROBABLY_LOST, first, last, noticed=first)) for first, last in doubts]
    if not failures and len(updates) > STUCK_PICTURES:
        story = Story(updates, Episode(PROBABLY_LOST, updates[0].step, updates[-1].step))
        rules = (stuck_pictures, weights_vanish, _left)
        failures = [failure for rule in rules if (failure := rule(story)) is not None]
    failures.sort(key=lambda failure: failure.first)
    return tuple(replace(failure, truth_known=False) for failure in failures)


def _began(updates: Sequence[UpdateEvidence], lost: int) -> int:
    """Return where a doubt at an update began: after it last knew where it was, by index."""
    begin = lost
    while begin > max(lost - BEGAN_UPDATES, 1) and not _knows(updates[begin - 1]):
        begin -= 1
    return begin


def _knows(update: UpdateEvidence) -> bool:
    return (update.knows or 0.0) > KNOWS_ABOVE


def _left(story: Story) -> Failure | None:
    outside = [update for update in story.updates if update.cloud_left]
    return cloud_left(story, outside) if outside else None


def _cause(updates: Sequence[UpdateEvidence], episode: Episode) -> Failure:
    """Return what is suspected to have made a run lost, of what can be seen without truth."""
    story = Story(updates, episode)
    lost, begin = story.lost, _began(updates, story.lost)
    before, since = updates[max(0, begin - USUAL_UPDATES) : begin], updates[begin : lost + 1]
    first = updates[begin]
    cloud, best, gray = (_medians(before, since, name) for name in ("cloud", "best", "gray"))
    evidence = {"knows": updates[lost].knows or 0.0, "cloud_nats": cloud[1], "usual_cloud_nats": cloud[0]}
    evidence |= {"best_nats": best[1], "usual_best_nats": best[0]}
    for update in updates[max(begin - 1, 0) : lost + 1]:
        if update.kidnapped:
            return story.failure(KIDNAPPED, update.step, told=LOG_SAYS, **evidence)
        if update.cloud_left:
            return story.failure(LEFT_MAP, update.step, driven_m=update.driven_m, **evidence)
        if story.usual_s > 0 and (update.after_s or 0.0) >= VERY_LONG_GAP * story.usual_s:
            gap = {"gap_s": update.after_s or 0.0, "usual_s": story.usual_s}
            return story.failure(DATA, update.step, **gap, **evidence)
    for rule in (stuck_pictures, weights_vanish):
        if (failure := rule(story)) is not None:
            return failure
    times = gray[1] / max(gray[0], 1e-9)
    if best[1] < best[0] - FALLEN_NATS / 2 and not 1 / LIGHT_TIMES < times < LIGHT_TIMES:
        levels = {"brightness": times, "level": gray[1], "expected_level": gray[0]}
        return story.failure(LIGHTING, first.step, **levels, **evidence)
    if best[1] < best[0] - FALLEN_NATS / 2:
        return story.failure(VIEW, first.step, **evidence)
    fell = [update for update in since if update.cloud < cloud[0] - FALLEN_NATS]
    if fell:
        return story.failure(KIDNAPPED, fell[0].step, told=PICTURES_SAY, **evidence)
    return story.failure(UNKNOWN, first.step, **evidence)


def _medians(
    before: Sequence[UpdateEvidence], since: Sequence[UpdateEvidence], name: str
) -> tuple[float, float]:
    usual, now = (float(np.median([getattr(u, name) for u in updates])) for updates in (before, since))
    return usual, now
