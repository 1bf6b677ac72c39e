"""Rules about the drive: what befell the recording and the robot. Each from the evidence alone."""

from __future__ import annotations

import numpy as np

from ...values.session import first_word
from .evidence import UpdateEvidence
from .kinds import DATA, KIDNAPPED, LEFT_MAP, MOTION, OUT_OF_PLANE, Failure
from .story import Story

LONG_GAP, VERY_LONG_GAP = 3.0, 5.5  # times the usual time between pictures; a robot is carried in less
SPEEDING, VERY_SPEEDING = 1.0, 4.0  # times the usual speed: the robot did not drive that far by itself
STUCK_FOR = 3  # equal pictures in a row
BEYOND_SD = 4.5  # standard deviations of the motion model, of one movement
TOLD_SD = 2.5  # where the log tells that the wheels slipped
BEYOND_SUM_SD = 5.0  # and of the sum of several
SUMMED = 3  # movements at least
OUT_FOR = 2  # updates off the map
TILTED_SHARE = 1 / 3  # of the updates about a loss
LEAP = 2.0  # times as far as in any other update: no drive, but a robot that was carried

# What befell the recording.


def gap_in_log(story: Story) -> Failure | None:
    """Pictures and odometry of some time are missing, and the robot drove on meanwhile."""
    for one in story.some(story.window, lambda one: one.after_s is not None and not one.kidnapped):
        times = (one.after_s or 0.0) / story.usual_s if story.usual_s > 0 else 0.0
        if not (times >= LONG_GAP and _is_surprising(one)):
            continue
        speed = (one.moved_m or 0.0) / max(one.after_s or 0.0, 1e-9) / max(story.usual_speed, 1e-9)
        if speed <= (VERY_SPEEDING if times >= VERY_LONG_GAP else SPEEDING):
            moved = {"moved_m": one.moved_m or 0.0, "driven_m": one.driven_m}
            return story.failure(DATA, one.step, gap_s=one.after_s or 0.0, usual_s=story.usual_s, **moved)
    return None


def stuck_pictures(story: Story) -> Failure | None:
    """The camera gave the same picture again and again."""
    stuck = story.some(story.around, lambda one: one.repeated)
    before = [one for one in stuck if one.step <= story.updates[story.lost].step + 1]
    if len(stuck) < STUCK_FOR or not before:
        return None
    return story.failure(DATA, before[0].step, equal_pictures=len(stuck), last=stuck[-1].step)


# What befell the robot.


def carried(story: Story) -> Failure | None:
    """The truth moved much farther than odometry says, or the log tells of it."""
    for one in story.some(story.window, lambda one: one.moved_m is not None or one.kidnapped):
        if one.kidnapped or _jumped(one, story):
            told = "the log says so" if one.kidnapped else "the truth jumped"
            away = {} if one.moved_m is None else {"moved_m": one.moved_m, "driven_m": one.driven_m}
            return story.failure(KIDNAPPED, one.step, told=told, **away)
    return None


def _jumped(one: UpdateEvidence, story: Story) -> bool:
    """Return whether the truth moved much farther than odometry says, and than the robot ever drives."""
    if one.moved_m is None:
        return False
    unseen_m = one.moved_m - one.driven_m
    others = [other.moved_m for other in story.updates if other is not one and other.moved_m is not None]
    leap = one.moved_m > LEAP * max(others, default=float("inf"))
    return unseen_m > one.lost_m or (leap and unseen_m > one.lost_m / 2)


def off_map(story: Story) -> Failure | None:
    """The truth lies off the map, or the whole cloud left it."""
    left = story.some(
        story.window, lambda one: not one.broken and (one.left or (one.zero and one.inside == 0))
    )
    before = [one for one in story.some(story.window, _is_surprising) if left and one.step < left[0].step]
    if left and not before:  # else the cloud left as the motion had led it astray
        return story.failure(
            LEFT_MAP, left[0].step, cloud="left the map", driven_m=left[0].driven_m, updates=len(left)
        )
    out = story.some(story.window, lambda one: one.outside is True)
    if len(out) >= OUT_FOR:
        return story.failure(LEFT_MAP, out[0].step, truth="off the map", updates=len(out))
    return None


def out_of_plane(story: Story) -> Failure | None:
    """The robot was tilted out of the plane in a third of the updates about the loss, as the log tells."""
    tilted = story.some(story.around, lambda one: one.tilt_deg is not None)
    if not tilted or len(tilted) < TILTED_SHARE * len(story.around):
        return None
    most = max(one.tilt_deg or 0.0 for one in tilted)
    return story.failure(OUT_OF_PLANE, tilted[0].step, tilt_deg=most, updates=len(tilted))


def beyond_motion(story: Story) -> Failure | None:
    """The robot moved as the motion model never would, at once or little by little."""
    known = story.some(story.moves, lambda one: one.surprise is not None)
    alone = [one for one in known if _is_surprising(one)]
    if alone:
        worst = max(alone, key=lambda one: one.surprise.largest if one.surprise else 0.0)
        return _motion(story, alone[0], worst, worst.surprise.largest if worst.surprise else 0.0, 1)
    if len(known) < SUMMED:
        return None
    z = np.array(
        [[one.surprise.forward, one.surprise.left, one.surprise.turn] for one in known if one.surprise]
    )
    best, where = 0.0, (0, 0)
    for first in range(len(z) - SUMMED + 1):
        for last in range(first + SUMMED, len(z) + 1):
            sd = float(np.abs(z[first:last].sum(axis=0)).max()) / np.sqrt(last - first)
            if sd > best:
                best, where = sd, (first, last)
    if best < BEYOND_SUM_SD:
        return None
    return _motion(story, known[where[0]], known[where[1] - 1], best, where[1] - where[0])


def slipped_as_told(story: Story) -> Failure | None:
    """The log tells that the wheels slipped, and the motion model hardly allows it."""
    for one in story.some(story.moves, lambda one: "slip" in map(first_word, one.events)):
        if one.surprise is not None and one.surprise.largest > TOLD_SD:
            return _motion(story, one, one, one.surprise.largest, 1)
    return None


def _motion(story: Story, first: UpdateEvidence, worst: UpdateEvidence, sd: float, movements: int) -> Failure:
    floor = {"floor": first.floor} if first.floor else {}
    axis = worst.surprise.axis if worst.surprise else ""
    moved = {"moved_m": worst.moved_m or 0.0, "driven_m": worst.driven_m}
    return story.failure(
        MOTION, first.step, sd=sd, axis=axis, movements=movements, worst_step=worst.step, **moved, **floor
    )


def _is_surprising(one: UpdateEvidence) -> bool:
    return one.surprise is not None and one.surprise.largest > BEYOND_SD
