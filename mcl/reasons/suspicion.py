"""Rules for a run without ground truth, which was probably lost by the second opinion.

The estimate of a run that is probably lost is no place to compare anything with. So a cause is named only by
what does not depend on it: the log, the recording, the weights, and how well the best reference of the whole
library explains the pictures, and how light they are beside all of these. Everything else is not known: that
the cloud fits no longer is what a robot that was carried has in common with wheels that spin, a start that is
wrong and a light that changed (docs/diagnose.md has how often each is named).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ..sensor.laser.fit import OFF_SHARE, ScanFit
from ..values import F64
from .causes import KIDNAPPED, LIGHTING, UNKNOWN, VIEW, Failure
from .drive_rules import VERY_LONG_GAP, cloud_left, estimate_jump, gap_before, has_left, too_slow
from .evidence import FIRST_UPDATES, Story, UpdateEvidence

USUAL_UPDATES = 20  # before, of which the usual level is taken
FALLEN_NATS = 2.0  # below the usual level
LEAST_PICTURES = 3  # that fit no reference
UNLIKE_TIMES = 1.6  # the usual cost of a library's own pictures: the best reference of all shows another view
LIGHT_TIMES = 1.5  # as bright or as dark as any reference
AS_LIGHT_TIMES = 1.35  # as light as before: else it may be the light that changed
SCANS_IN_A_ROW = 3  # that do not fit: fewer may be people in view
LOG_SAYS = "the log says so"  # that it was carried


def scan_doubts(updates: Sequence[UpdateEvidence]) -> tuple[tuple[int, int], ...]:
    """Return from which step to which several scans in a row did not fit the map at a cloud's place."""
    rows = [[u.step for u in group] for is_off, group in groupby(updates, _is_off) if is_off]
    return tuple((steps[0], steps[-1]) for steps in rows if len(steps) >= SCANS_IN_A_ROW)


def _is_off(update: UpdateEvidence) -> bool:
    fit = update.scan_here
    return fit is not None and update.score.converged and fit.off >= OFF_SHARE


def _scans(updates: Sequence[UpdateEvidence]) -> list[ScanFit]:
    return [update.scan_here for update in updates if update.scan_here is not None]


def told_carried(story: Story) -> Failure | None:
    """The log says that the robot was carried."""
    updates = story.where(story.doubted, lambda u: u.kidnapped)
    return story.failure(KIDNAPPED, updates[0].step, told=LOG_SAYS) if updates else None


def left_map(story: Story) -> Failure | None:
    """The whole cloud left the map."""
    outside = story.where(story.doubted, has_left)
    return cloud_left(story, outside[:1]) if outside else None


def ever_left_map(story: Story) -> Failure | None:
    """The whole cloud of a run that never knew where it is left the map."""
    outside = story.where(story.since_last, has_left)
    return cloud_left(story, outside) if outside else None


def long_gap(story: Story) -> Failure | None:
    """Pictures and odometry of a long time are missing."""
    late = story.where(story.doubted, lambda u: story.waited(u) >= VERY_LONG_GAP)
    return gap_before(story, late[0]) if late else None


def skipped(story: Story) -> Failure | None:
    """A live source was faster than the filter."""
    return too_slow(story, story.updates[story.began : story.lost + 1])


def scans_off(story: Story) -> Failure | None:
    """Scans do not fit the map at the estimate; why is not known without truth."""
    updates, begin = story.updates, story.lost
    if updates[begin].scan_here is None:
        return None
    while begin > 0 and (fit := updates[begin - 1].scan_here) is not None and fit.off >= OFF_SHARE:
        begin -= 1
    off = _scans([update for update in updates[begin:] if update.step <= story.episode.last])
    numbers = {"off_beams": float(np.median([fit.off for fit in off])), "scans": len(off)}
    return story.failure(UNKNOWN, updates[begin].step, **estimate_jump(updates[begin]), **numbers)


def unlike_all(story: Story) -> Failure | None:
    """The first pictures of a doubt are unlike all references, wherever these are.

    None where they are few: one picture can be of a place between two references.
    """
    usual, since = story.usual, story.updates[story.began : min(story.lost + FIRST_UPDATES, story.end + 1)]
    if usual is None or not np.isfinite(usual.cost) or len(since) < LEAST_PICTURES:
        return None
    best_nats = float(np.median([update.best for update in since]))
    times, evidence = -best_nats / usual.cost, _levels(story)
    if times <= UNLIKE_TIMES or evidence["usual_best_nats"] - best_nats < FALLEN_NATS:
        return None
    level = float(np.median([update.gray for update in since]))
    if (lightness := _beyond(level, story.levels)) is not None:
        ratio, expected = lightness
        light = {"brightness": ratio, "level": level, "expected_level": expected}
        return story.failure(LIGHTING, since[0].step, **light, times_usual=times, **evidence)
    before = float(np.median([update.gray for update in story.updates[: story.began]] or [level]))
    as_light = 1 / AS_LIGHT_TIMES < level / max(before, 1e-9) < AS_LIGHT_TIMES
    return story.failure(VIEW, since[0].step, times_usual=times, **evidence) if as_light else None


def unexplained(story: Story) -> Failure:
    """Nothing that can be seen without truth explains the doubt."""
    return story.failure(UNKNOWN, story.updates[story.began].step, **_levels(story))


def _levels(story: Story) -> dict[str, float]:
    """Return how well cloud and best reference explained the pictures before a doubt, and since."""
    onset, lost = story.began, story.lost
    since = story.updates[onset : lost + 1]
    before = story.updates[max(0, onset - USUAL_UPDATES) : onset] or since
    cloud, best = (_medians(before, since, name) for name in ("cloud", "best"))
    numbers = {
        "knows": story.updates[lost].knows or 0.0,
        "cloud_nats": cloud[1],
        "usual_cloud_nats": cloud[0],
    }
    return numbers | {"best_nats": best[1], "usual_best_nats": best[0]}


def _beyond(level: float, levels: F64 | None) -> tuple[float, float] | None:
    """Return the ratio of a level to that of the darkest or lightest reference, and the reference's level.

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
