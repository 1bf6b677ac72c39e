"""What can be said of a run without ground truth: when it was probably lost, by the second opinion, and why.

Two numbers tell: how well the best reference of the whole library explains a picture, and how well the cloud
does. Where both fall, the pictures have changed. Where only the cloud's falls, it is at the wrong place.
Over a map in place of references one number tells: how well the scan fits the map at the estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from ..scoring.episodes import PROBABLY_LOST, Episode
from ..scoring.lost_signal import KNOWS_ABOVE
from ..sensor.laser.fit import OFF_SHARE, ScanFit
from .causes import DATA, KIDNAPPED, LEFT_MAP, LIGHTING, START, UNKNOWN, VIEW, Failure
from .drive_rules import STUCK_PICTURES, VERY_LONG_GAP, cloud_left, stuck_pictures, weights_vanish
from .evidence import Story, UpdateEvidence
from .laser_rules import UNKNOWN_SHARE

USUAL_UPDATES = 20  # before, of which the usual level is taken
FALLEN_NATS = 4.0  # below the usual level
BEGAN_UPDATES = 10  # before it is probably lost, in which that began
LIGHT_TIMES = 1.5  # as bright or as dark as usual
SCANS_IN_A_ROW = 3  # that do not fit: fewer may be people in view
# that it was carried
LOG_SAYS, PICTURES_SAY = "the log says so", "the cloud stopped to fit, other places do"
SCANS_SAY = "scans that fitted fit no more, all at once"


def suspected(updates: Sequence[UpdateEvidence], doubts: Sequence[tuple[int, int]]) -> tuple[Failure, ...]:
    """Return each doubt of a run without truth, from step to step, with what is suspected, in order."""
    failures = [_cause(updates, Episode(PROBABLY_LOST, first, last, noticed=first)) for first, last in doubts]
    if not failures and len(updates) > STUCK_PICTURES:
        story = Story(updates, Episode(PROBABLY_LOST, updates[0].step, updates[-1].step))
        rules = (stuck_pictures, weights_vanish, _left)
        failures = [failure for rule in rules if (failure := rule(story)) is not None]
    failures.sort(key=lambda failure: failure.first)
    return tuple(replace(failure, truth_known=False) for failure in failures)


def scan_doubts(updates: Sequence[UpdateEvidence]) -> tuple[tuple[int, int], ...]:
    """Return from which step to which several scans in a row did not fit the map at a cloud's place."""
    rows = [[u.step for u in group] for is_off, group in groupby(updates, _is_off) if is_off]
    return tuple((steps[0], steps[-1]) for steps in rows if len(steps) >= SCANS_IN_A_ROW)


def _is_off(update: UpdateEvidence) -> bool:
    fit = update.scan_here
    return fit is not None and update.score.converged and fit.off >= OFF_SHARE


def _by_scans(story: Story) -> Failure:
    """Return what is suspected where scans stopped to fit the map at the estimate."""
    updates, begin = story.updates, story.lost
    while begin > 0 and (fit := updates[begin - 1].scan_here) is not None and fit.off >= OFF_SHARE:
        begin -= 1
    first = updates[begin].step
    off = _scans([update for update in updates[begin:] if update.step <= story.episode.last])
    before = _scans(updates[max(begin - SCANS_IN_A_ROW, 0) : begin])
    numbers = {"off_beams": float(np.median([fit.off for fit in off])), "scans": len(off)}
    unknown, short = (
        float(np.median([fit.shares.get(name, 0.0) for fit in off])) for name in ("unknown", "short")
    )
    if not before:
        return story.failure(START, first, **numbers)
    if unknown >= UNKNOWN_SHARE:
        return story.failure(LEFT_MAP, first, unknown_beams=unknown, **numbers)
    if len(before) == SCANS_IN_A_ROW and all(fit.off < OFF_SHARE / 2 for fit in before):
        return story.failure(KIDNAPPED, first, told=SCANS_SAY, **numbers)
    return story.failure(VIEW, first, short_beams=short, **numbers)


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
    outside = [update for update in story.updates if update.cloud_left]
    return cloud_left(story, outside) if outside else None


def _cause(updates: Sequence[UpdateEvidence], episode: Episode) -> Failure:
    """Return what is suspected to have made a run lost, of what can be seen without truth."""
    story = Story(updates, episode)
    lost, begin = story.lost, _began(updates, story.lost)
    by_scans, since = updates[lost].scan_here is not None, updates[begin : lost + 1]
    before = updates[max(0, begin - USUAL_UPDATES) : begin] or since
    first = updates[begin]
    cloud, best, gray = (_medians(before, since, name) for name in ("cloud", "best", "gray"))
    evidence = {"knows": updates[lost].knows or 0.0, "cloud_nats": cloud[1], "usual_cloud_nats": cloud[0]}
    evidence |= {"best_nats": best[1], "usual_best_nats": best[0]}
    evidence = {} if by_scans else evidence
    for update in updates[max(begin - 1, 0) : lost + 1]:
        if update.kidnapped:
            return story.failure(KIDNAPPED, update.step, told=LOG_SAYS, **evidence)
        if update.cloud_left:
            return story.failure(LEFT_MAP, update.step, driven_m=update.driven_m, **evidence)
        if story.waited(update) >= VERY_LONG_GAP:
            gap = {"gap_s": update.after_s or 0.0, "usual_s": story.usual_s}
            return story.failure(DATA, update.step, **gap, **evidence)
    if by_scans:
        return _by_scans(story)
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
