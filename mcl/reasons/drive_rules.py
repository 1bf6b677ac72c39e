"""Rules about the drive, what befell the recording and the robot, and about what became of the particles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..values import first_word, skipped_before
from .causes import (
    AWAY,
    CLOCK,
    DATA,
    FAR_FASTER,
    FASTER_AFTER,
    KIDNAPPED,
    LEFT_MAP,
    MOTION,
    NUMERIC,
    OUT_OF_PLANE,
    PROPOSAL,
    RESAMPLING,
    UNKNOWN,
    Failure,
    Value,
)
from .evidence import Story, UpdateEvidence

LONG_GAP, VERY_LONG_GAP = 3.0, 5.5  # times the usual time between pictures; a robot is carried in less
SPEEDING, VERY_SPEEDING = 1.0, 4.0  # times the usual speed: the robot did not drive that far by itself
USUAL_PERCENT = 95  # of the speeds of odometry: the highest may be further jumps
STUCK_PICTURES = 3  # equal ones in a row
BEYOND_SD = 4.5  # standard deviations of the motion model, of one movement
LOGGED_SD = 2.5  # where the log tells that the wheels slipped
BEYOND_SUM_SD = 5.0  # and of the sum of several
SUMMED_MOVEMENTS = 3  # at least
OUT_UPDATES = 2  # off the map
TILTED_SHARE = 1 / 3  # of the updates about a loss
LEAP_TIMES = 2.0  # times as far as in any other update: no drive, but a robot that was carried

# What befell the recording.


def gap_in_log(story: Story) -> Failure | None:
    """Pictures and odometry of some time are missing, and the robot drove on meanwhile."""
    for update in story.where(story.window, lambda u: u.after_s is not None and not u.kidnapped):
        times = story.waited(update)
        if not (times >= LONG_GAP and _is_surprising(update)):
            continue
        speed = (update.moved_m or 0.0) / max(update.after_s or 0.0, 1e-9) / max(story.usual_speed, 1e-9)
        if speed <= (VERY_SPEEDING if times >= VERY_LONG_GAP else SPEEDING):
            moved = {"moved_m": update.moved_m or 0.0, "driven_m": update.driven_m}
            return gap_before(story, update, **moved)
    return None


def gap_before(story: Story, update: UpdateEvidence, **evidence: Value) -> Failure:
    """Return the failure of a gap before an update, with whose it was where a live source tells."""
    gap = {"gap_s": update.after_s or 0.0, "usual_s": story.usual_s} | evidence
    event = next((text for text in update.events if first_word(text) in (AWAY, CLOCK)), "")
    of_source = {"source": first_word(event)} if event else {}
    count = skipped_before(update.events)
    skipped = {"skipped": count} if count else {}
    return story.failure(DATA, update.step, **gap, **skipped, **of_source)


def too_slow(story: Story, updates: Sequence[UpdateEvidence]) -> Failure | None:
    """At least half of the pictures of a live source were skipped: the filter was slower than the robot."""
    counts = {update.step: skipped_before(update.events) for update in updates}
    if sum(counts.values()) < max(len(updates), 1):
        return None
    first = next(step for step, count in counts.items() if count)
    return story.failure(DATA, first, skipped=sum(counts.values()))


def stuck_pictures(story: Story) -> Failure | None:
    """The camera gave the same picture again and again."""
    stuck = story.where(story.nearby, lambda u: u.repeated)
    before = [update for update in stuck if update.step <= story.updates[story.lost].step + 1]
    if len(stuck) < STUCK_PICTURES or not before:
        return None
    return story.failure(DATA, before[0].step, equal_pictures=len(stuck), last=stuck[-1].step)


def odometry_jumps(story: Story) -> Failure | None:
    """Odometry jumped: it was far faster than it ever was, and the robot did not follow."""
    for update in story.where(story.window, lambda u: u.driven_m - (u.moved_m or 0.0) > u.lost_m):
        after_s = update.after_s or float("inf")  # of the first update no speed is known
        others = [u.driven_m / u.after_s for u in story.updates if u is not update and u.after_s]
        usual_m_s = (
            float(np.percentile(others, USUAL_PERCENT)) if len(others) > FASTER_AFTER else float("inf")
        )
        if update.driven_m > FAR_FASTER * usual_m_s * after_s:
            moved = {} if update.moved_m is None else {"moved_m": update.moved_m}
            jump = {"jump_m": update.driven_m, "within_s": after_s}
            return story.failure(MOTION, update.step, **jump, usual_speed=usual_m_s, **moved)
    return None


def estimate_jump(update: UpdateEvidence) -> dict[str, Value]:
    """Return how far the estimate jumped where odometry did not, as evidence; empty where it did not."""
    if update.estimate_m - update.driven_m <= update.lost_m:
        return {}
    return {"estimate_jump_m": update.estimate_m, "driven_m": update.driven_m}


def recorded_jump(story: Story) -> Failure | None:
    """The estimate of a recorded localizer with a laser jumped to a wrong place; its filter is not here."""
    updates = story.updates
    if any(u.surprise is not None for u in updates) or all(u.scan is None for u in updates):
        return None
    for before, update in pairwise(story.where(story.window, lambda u: True)):
        if before.score.correct and update.score.correct is False and (jump := estimate_jump(update)):
            return story.failure(UNKNOWN, update.step, **jump)
    return None


# What befell the robot.


def carried(story: Story) -> Failure | None:
    """The truth moved much farther than odometry says, or the log tells of it."""
    for update in story.where(story.window, lambda u: u.moved_m is not None or u.kidnapped):
        if update.kidnapped or _jumped(update, story):
            source = "the log says so" if update.kidnapped else "the truth jumped"
            away = {} if update.moved_m is None else {"moved_m": update.moved_m, "driven_m": update.driven_m}
            return story.failure(KIDNAPPED, update.step, told=source, **away)
    return None


def _jumped(update: UpdateEvidence, story: Story) -> bool:
    """Return whether the truth moved much farther than odometry says, and than the robot ever drives."""
    if update.moved_m is None:
        return False
    unseen_m = update.moved_m - update.driven_m
    others = [u.moved_m for u in story.updates if u is not update and u.moved_m is not None]
    leap = update.moved_m > LEAP_TIMES * max(others, default=float("inf"))
    return unseen_m > update.lost_m or (leap and unseen_m > update.lost_m / 2)


def _was_carried(update: UpdateEvidence) -> bool:
    """Return whether the log says so, or the truth moved much farther than odometry."""
    return update.kidnapped or (update.moved_m or 0.0) - update.driven_m > update.lost_m


def off_map(story: Story) -> Failure | None:
    """The truth lies off the map, or the whole cloud left it."""
    outside = story.where(story.window, has_left)
    surprising = story.where(story.window, _is_surprising)
    if outside and not any(u.step < outside[0].step for u in surprising):  # else motion had led it astray
        return cloud_left(story, outside)
    off = story.where(story.window, lambda u: u.outside is True)
    if len(off) >= OUT_UPDATES:
        return story.failure(LEFT_MAP, off[0].step, truth="off the map", updates=len(off))
    return None


def has_left(update: UpdateEvidence) -> bool:
    """Return whether no particle of an update was in free space."""
    return not update.broken and (update.cloud_left or (update.zero and update.inside == 0))


def cloud_left(story: Story, outside: Sequence[UpdateEvidence]) -> Failure:
    """Return the failure of a cloud that left the map at some updates."""
    first = outside[0]
    return story.failure(
        LEFT_MAP, first.step, cloud="left the map", driven_m=first.driven_m, updates=len(outside)
    )


def out_of_plane(story: Story) -> Failure | None:
    """The robot was tilted out of the plane in a third of the updates about the loss, as the log tells."""
    tilted = story.where(story.nearby, lambda u: u.tilt_deg is not None)
    if not tilted or len(tilted) < TILTED_SHARE * len(story.nearby):
        return None
    most = max(update.tilt_deg or 0.0 for update in tilted)
    return story.failure(OUT_OF_PLANE, tilted[0].step, tilt_deg=most, updates=len(tilted))


def beyond_motion(story: Story) -> Failure | None:
    """The robot moved as the motion model never would, at once or little by little."""
    # a robot that was carried during a search did not drive; within the window `carried` comes first
    drives = [k for k in story.moves if k in story.window or not _was_carried(story.updates[k])]
    surprises = [(u, u.surprise) for k in drives if (u := story.updates[k]).surprise is not None]
    alone = [pair for pair in surprises if pair[1].largest > BEYOND_SD]
    if alone:
        worst, surprise = max(alone, key=lambda pair: pair[1].largest)
        return _motion(story, alone[0][0], worst, surprise.largest, 1)
    z = np.array([[s.forward, s.left, s.turn] for _, s in surprises]).reshape(-1, 3)
    most_sd, span = 0.0, (0, 0)
    for first in range(len(z) - SUMMED_MOVEMENTS + 1):
        for last in range(first + SUMMED_MOVEMENTS, len(z) + 1):
            sd = float(np.abs(z[first:last].sum(axis=0)).max()) / np.sqrt(last - first)
            if sd > most_sd:
                most_sd, span = sd, (first, last)
    if most_sd < BEYOND_SUM_SD:
        return None
    first, last = span
    return _motion(story, surprises[first][0], surprises[last - 1][0], most_sd, last - first)


def slipped_as_told(story: Story) -> Failure | None:
    """The log tells that the wheels slipped, and the motion model hardly allows it."""
    for update in story.where(story.moves, lambda u: "slip" in map(first_word, u.events)):
        if update.surprise is not None and update.surprise.largest > LOGGED_SD:
            return _motion(story, update, update, update.surprise.largest, 1)
    return None


def _motion(story: Story, first: UpdateEvidence, worst: UpdateEvidence, sd: float, movements: int) -> Failure:
    floor = {"floor": first.floor} if first.floor else {}
    axis = worst.surprise.axis if worst.surprise else ""
    moved = {"moved_m": worst.moved_m or 0.0, "driven_m": worst.driven_m}
    return story.failure(
        MOTION, first.step, sd=sd, axis=axis, movements=movements, worst_step=worst.step, **moved, **floor
    )


def _is_surprising(update: UpdateEvidence) -> bool:
    return update.surprise is not None and update.surprise.largest > BEYOND_SD


# What became of the particles at the true place, and whether weights were numbers at all.

SHARP_NATS = 37.0  # from the best reference to the middle one: weights differ by more than a float can hold
MOST_SHARE = 0.5  # of the updates looked at
COPIES = 1.0  # times one over the number of particles: the weight that should leave a copy


def weights_vanish(story: Story) -> Failure | None:
    """Likelihoods were no numbers, or all weights zero, or all but one: rounded away, not small."""
    broken = story.where(story.window, lambda u: u.broken)
    if broken:
        return story.failure(NUMERIC, broken[0].step, weights="not a number", updates=len(broken))
    zero = story.where(story.window, lambda u: u.zero and not has_left(u))
    if zero:
        return story.failure(NUMERIC, zero[0].step, weights="all zero", updates=len(zero))
    known = story.where(story.window, lambda u: np.isfinite(u.spread_nats))
    sharp = [update for update in known if update.spread_nats > SHARP_NATS]
    if not sharp or len(sharp) < MOST_SHARE * len(known):
        return None
    spread = float(np.median([update.spread_nats for update in sharp]))
    ess = float(np.median([update.ess for update in sharp]))
    return story.failure(
        NUMERIC, sharp[0].step, weights="all but one zero", spread_nats=spread, effective=ess
    )


def unlucky(story: Story) -> Failure | None:
    """Particles at the true place had weight for a copy or more, and resampling made none, for good."""
    known = story.where(story.since_last, lambda u: u.near is not None)
    last_near = max((u.step for u in known if u.near and u.near.shares[2] > 0), default=0)
    update = next((u for u in known if u.step > last_near and _counts(u)), None)
    if update is None or update.near is None:
        return None
    share = update.near.shares[1]
    evidence = {"share": share, "copies": share * update.size, "near": update.near.particles}
    return story.failure(RESAMPLING, update.step, **evidence, particles=update.size)


def no_particle(story: Story) -> Failure | None:
    """No particle was at the true place: none ever was, none for long, or the last one went."""
    known = story.where(story.since_last, lambda u: u.near is not None)
    if not known:
        return None
    nearest = min(update.near.nearest_m for update in known if update.near)
    scored_updates = [update for update in known if _counts(update)]
    size = {"nearest_m": nearest, "particles": known[0].size}
    if not scored_updates:
        return story.failure(PROPOSAL, known[0].step, ever="no", **size)
    lost = story.updates[story.lost].step
    before = [update for update in scored_updates if update.step < lost]
    if not before and len(scored_updates) >= MOST_SHARE * len(known):
        return None  # a search that had them nearly all the time
    since = before[-1] if before else scored_updates[0]
    later = [update for update in known if update.step > since.step and update.near]
    updates = [update for update in later if update.near and not update.near.particles]
    updates = updates or [update for update in later if not before and not _counts(update)]
    if not updates and not before:
        return story.failure(PROPOSAL, known[0].step, ever="late", came=since.step, **size)
    died = updates[0].step if updates else lost
    until = [update for update in scored_updates if update.step < died] or [since]
    return story.failure(PROPOSAL, died, ever="yes", held_until=until[-1].step, died=died, **size)


def _counts(update: UpdateEvidence) -> bool:
    """Return whether particles at the true place had weight for a copy or more."""
    return update.near is not None and update.near.shares[1] * update.size >= COPIES
