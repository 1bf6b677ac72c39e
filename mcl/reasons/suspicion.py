"""What can be said of a run without ground truth: when it was probably lost, by the second opinion, and why.

The estimate of a run that is probably lost is no place to compare anything with. So a cause is named only by
what does not hang on it: the log, the recording, the weights, and how well the best reference of the whole
library explains the pictures, and how light they are beside all of these. Everything else is not known: that
the cloud fits no longer is what a robot that was carried has in common with wheels that spin, a start that is
wrong and a light that changed (docs/diagnose.md has how often each is named).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from ..scoring.episodes import PROBABLY_LOST, Episode
from ..scoring.lost_signal import KNOWS_ABOVE
from ..sensor.laser.fit import OFF_SHARE, ScanFit
from ..values import F64
from .causes import KIDNAPPED, LIGHTING, UNKNOWN, VIEW, Failure
from .drive_rules import (
    VERY_LONG_GAP,
    cloud_left,
    estimate_jump,
    gap_before,
    has_left,
    odometry_jumps,
    stuck_pictures,
    too_slow,
    weights_vanish,
)
from .evidence import FIRST_UPDATES, Story, UpdateEvidence
from .surroundings import Surroundings

USUAL_UPDATES = 20  # before, of which the usual level is taken
FALLEN_NATS = 2.0  # below the usual level
LEAST_PICTURES = 3  # that fit no reference
UNLIKE_TIMES = 1.6  # the usual cost of a library's own pictures: the best reference of all shows another view
BEGAN_UPDATES = 10  # before it is probably lost, in which that began
LIGHT_TIMES = 1.5  # as bright or as dark as any reference
AS_LIGHT_TIMES = 1.35  # as light as before: else it may be the light that changed
SCANS_IN_A_ROW = 3  # that do not fit: fewer may be people in view
LOG_SAYS = "the log says so"  # that it was carried


def suspected(
    updates: Sequence[UpdateEvidence], doubts: Sequence[tuple[int, int]], around: Surroundings | None = None
) -> tuple[Failure, ...]:
    """Return each doubt of a run without truth, from step to step, with its cause where one shows, in order.

    A run that never knew where it is has no doubt; of it the weights and the map can tell.
    """
    failures = [
        _cause(Story(updates, Episode(PROBABLY_LOST, first, last, noticed=first)), around)
        for first, last in doubts
    ]
    if not failures and updates and not any(map(_knows, updates)):
        first, last = updates[0].step, updates[-1].step
        story = Story(updates, Episode(PROBABLY_LOST, first, last, noticed=first))
        failures = [failure for rule in (weights_vanish, _left) if (failure := rule(story)) is not None][:1]
    return tuple(replace(failure, truth_known=False) for failure in failures)


def scan_doubts(updates: Sequence[UpdateEvidence]) -> tuple[tuple[int, int], ...]:
    """Return from which step to which several scans in a row did not fit the map at a cloud's place."""
    rows = [[u.step for u in group] for is_off, group in groupby(updates, _is_off) if is_off]
    return tuple((steps[0], steps[-1]) for steps in rows if len(steps) >= SCANS_IN_A_ROW)


def _is_off(update: UpdateEvidence) -> bool:
    fit = update.scan_here
    return fit is not None and update.score.converged and fit.off >= OFF_SHARE


def _by_scans(story: Story) -> Failure:
    """Return since when scans do not fit the map at the estimate; why is not known without truth."""
    updates, begin = story.updates, story.lost
    while begin > 0 and (fit := updates[begin - 1].scan_here) is not None and fit.off >= OFF_SHARE:
        begin -= 1
    off = _scans([update for update in updates[begin:] if update.step <= story.episode.last])
    numbers = {"off_beams": float(np.median([fit.off for fit in off])), "scans": len(off)}
    return story.failure(UNKNOWN, updates[begin].step, **estimate_jump(updates[begin]), **numbers)


def _scans(updates: Sequence[UpdateEvidence]) -> list[ScanFit]:
    return [update.scan_here for update in updates if update.scan_here is not None]


def _began(updates: Sequence[UpdateEvidence], lost: int) -> int:
    """Return where a doubt at an update began: after it last knew where it was, by index."""
    begin = lost
    while begin > max(lost - BEGAN_UPDATES, 1) and not _knows(updates[begin - 1]):
        begin -= 1
    return begin


def _knows(update: UpdateEvidence) -> bool:
    return (update.knows or 0.0) > KNOWS_ABOVE


def _left(story: Story) -> Failure | None:
    outside = [update for update in story.updates if has_left(update)]
    return cloud_left(story, outside) if outside else None


def _cause(story: Story, around: Surroundings | None) -> Failure:
    """Return what made a run probably lost, of what can be seen without truth."""
    updates, lost = story.updates, story.lost
    begin = _began(updates, lost)
    since = updates[begin : lost + 1]
    for update in updates[max(begin - 1, 0) : lost + 1]:
        if update.kidnapped:
            return story.failure(KIDNAPPED, update.step, told=LOG_SAYS)
        if has_left(update):
            return cloud_left(story, [update])
        if story.waited(update) >= VERY_LONG_GAP:
            return gap_before(story, update)
    if (failure := odometry_jumps(story) or too_slow(story, since)) is not None:
        return failure
    if updates[lost].scan_here is not None:
        return _by_scans(story)
    for rule in (stuck_pictures, weights_vanish):
        if (failure := rule(story)) is not None:
            return failure
    before = updates[max(0, begin - USUAL_UPDATES) : begin] or since
    cloud, best = (_medians(before, since, name) for name in ("cloud", "best"))
    evidence = {"knows": updates[lost].knows or 0.0, "cloud_nats": cloud[1], "usual_cloud_nats": cloud[0]}
    evidence |= {"best_nats": best[1], "usual_best_nats": best[0]}
    if (failure := _by_pictures(story, begin, best[0], around)) is not None:
        return replace(failure, evidence={**failure.evidence, **evidence})
    return story.failure(UNKNOWN, since[0].step, **evidence)


def _by_pictures(story: Story, begin: int, before_nats: float, around: Surroundings | None) -> Failure | None:
    """Return what the first pictures of a doubt tell beside all references, wherever these are.

    None where that is nothing, or where they are few: one picture can be of a place between two references.
    """
    usual = None if around is None else around.usual
    since = story.updates[begin : min(story.lost + FIRST_UPDATES, story.end + 1)]
    if around is None or usual is None or not np.isfinite(usual.cost) or len(since) < LEAST_PICTURES:
        return None
    best_nats = float(np.median([update.best for update in since]))
    times = -best_nats / usual.cost
    if times <= UNLIKE_TIMES or before_nats - best_nats < FALLEN_NATS:
        return None
    level = float(np.median([update.gray for update in since]))
    if (lightness := _beyond(level, around.levels)) is not None:
        ratio, expected = lightness
        levels = {"brightness": ratio, "level": level, "expected_level": expected}
        return story.failure(LIGHTING, since[0].step, **levels, times_usual=times)
    before = float(np.median([update.gray for update in story.updates[:begin]] or [level]))
    as_light = 1 / AS_LIGHT_TIMES < level / max(before, 1e-9) < AS_LIGHT_TIMES
    return story.failure(VIEW, since[0].step, times_usual=times) if as_light else None


def _beyond(level: float, levels: F64 | None) -> tuple[float, float] | None:
    """Return how many times as light as the darkest or the lightest reference, and that one's level.

    None for a level (0 to 255) within those (L, 3) of the references.
    """
    if levels is None or not len(levels):
        return None
    means = levels.mean(axis=1)
    least, most = float(means.min()), float(means.max())
    nearest = least if level < least else most
    is_beyond = level * LIGHT_TIMES < least or level > most * LIGHT_TIMES
    return (level / max(nearest, 1e-9), nearest) if is_beyond else None


def _medians(
    before: Sequence[UpdateEvidence], since: Sequence[UpdateEvidence], name: str
) -> tuple[float, float]:
    usual, now = (float(np.median([getattr(u, name) for u in updates])) for updates in (before, since))
    return usual, now
