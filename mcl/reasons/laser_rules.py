"""Rules about scans: whether they fit the map at the truth, what keeps them from it, where else they fit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..scoring.table import SEARCHING
from ..sensor.laser.fit import OFF_SHARE, Mounting, ScanFit
from .causes import AMBIGUITY, FLAT, LEFT_MAP, MOUNT, START, UNSEEN, VIEW, WRONG_MAP, Failure, Value
from .evidence import Story, UpdateEvidence, median

LEAST_UPDATES = 2  # at which something holds
MOST_SHARE = 0.5  # of the updates looked at
WORSE_NATS = 5.0  # by which the place of the estimate is ahead: the scan speaks against the truth
UNKNOWN_SHARE = 0.4  # of the beams end where nobody has mapped
MOUNT_SCANS, MOUNT_RAD, MOUNT_M = 4, float(np.radians(10)), 0.15
MOUNT_SHARE = 0.5  # of the nats that scans lack, that another mount gives
CHANCE_SKILL = 0.35  # a scan that fits the truth no better than this fits it by chance
UNSEEN_SHARE = 0.2  # of the beams pass through walls, or hit nothing where the map has one
ALIKE_NATS = 5.0  # places whose nats differ by less fit as well
TELLING_NATS = 10.0  # by which the calibrated model puts the truth before the estimate ...
FLAT_NATS = 4.0  # ... and the run's own does not
CUT_SHARE = 0.7  # of the beams that hit something, left out by laser_max_range: too few are left
TURNED_RAD = float(np.radians(30))  # of a start that is at the right place


def left_mapped(story: Story) -> Failure | None:
    """Many beams end where nobody has mapped."""
    known = story.where(story.pictures, lambda u: u.scan is not None)
    out = [update for update in known if _share(update, "unknown") >= UNKNOWN_SHARE]
    if len(out) < max(MOST_SHARE * len(known), LEAST_UPDATES):
        return None
    share = median(_share(update, "unknown") for update in out)
    return story.failure(LEFT_MAP, out[0].step, unknown_beams=share, scans=len(out))


def wrong_mount(story: Story) -> Failure | None:
    """The scans fit the truth once the laser is turned on the robot, or its beams are counted backward."""
    bad = _bad(story)
    fits = [fit for update in bad if (fit := update.scan) is not None and fit.mounting is not None]
    if len(fits) < MOUNT_SCANS:
        return None
    mounting = fits[-1].mounting
    assert mounting is not None
    least = (1 - MOUNT_SHARE) * mounting.as_it_is
    turned = abs(mounting.yaw_rad) >= MOUNT_RAD or mounting.mirrored
    if mounting.placed_nats > mounting.nats and np.hypot(*mounting.place) >= MOUNT_M:
        return (
            _misplaced(story, mounting, _since(bad, story), len(fits))
            if mounting.placed_nats >= least
            else None
        )
    if not turned or mounting.nats < least:
        return None
    words: dict[str, Value] = {"beams": "clockwise"} if mounting.mirrored else {}
    yaw = float(np.degrees(mounting.yaw_rad))
    nats = {"turned_nats": mounting.nats, "scan_nats": mounting.as_it_is}
    return story.failure(MOUNT, _since(bad, story), yaw_deg=yaw, **nats, **words, scans=len(fits))


def _misplaced(story: Story, mounting: Mounting, first: int, scans: int) -> Failure:
    place = {"ahead_m": mounting.place[0], "left_m": mounting.place[1]}
    nats = {"placed_nats": mounting.placed_nats, "scan_nats": mounting.as_it_is}
    return story.failure(MOUNT, first, **place, **nats, scans=scans)


def wrong_map(story: Story) -> Failure | None:
    """The scans fit the truth no better than any place of the map, and never did."""
    bad = _bad(story)
    first = _since(bad, story) if bad else 0
    before = [update for update in story.updates if update.step < first and update.scan is not None]
    skill = median(fit.skill for fit in _fits(bad))
    if not bad or len(before) > LEAST_UPDATES or skill > CHANCE_SKILL:
        return None
    return story.failure(WRONG_MAP, first, skill=skill, **_off(bad), scans=len(bad))


def walls_unseen(story: Story) -> Failure | None:
    """Beams pass through what the map has, or come back from nothing where it has a wall."""
    known = story.where(story.pictures, lambda u: u.scan is not None)
    through = [update for update in known if _unseen(update) >= UNSEEN_SHARE]
    if len(through) < max(MOST_SHARE * len(known), LEAST_UPDATES):
        return None
    unseen = median(_unseen(update) for update in through)
    if unseen < median(_share(update, "short") for update in through):
        return None
    return story.failure(UNSEEN, through[0].step, unseen_beams=unseen, **_off(through), scans=len(through))


def scene_changed(story: Story) -> Failure | None:
    """Something stands where the map has nothing, or the map is another one there."""
    bad = _bad(story)
    if not bad:
        return None
    short_m = median(fit.short_m for fit in _fits(bad) if np.isfinite(fit.short_m))
    short = {"short_beams": median(_share(u, "short") for u in bad)}
    words = short | ({"short_m": short_m} if np.isfinite(short_m) else {})
    return story.failure(VIEW, _since(bad, story), **words, **_off(bad), scans=len(bad))


def wrong_start(story: Story) -> Failure | None:
    """All particles began at one place, and the robot was elsewhere."""
    first = story.updates[0]
    off_m = first.score.error_m
    if story.since > 0 or off_m is None or not first.began_together or not first.score.lost:
        return None
    if any(update.share_near >= MOST_SHARE for update in story.updates[: story.lost + 1]):
        return None
    turned_rad = first.score.heading_error_rad or 0.0
    turned: dict[str, Value] = {}
    if abs(turned_rad) >= TURNED_RAD:
        turned = {"start_turned_deg": abs(float(np.degrees(turned_rad)))}
    return story.failure(START, first.step, start_off_m=off_m, **turned, particles=first.size)


def range_cut(story: Story) -> Failure | None:
    """The run's own laser_max_range leaves out most beams that hit something."""
    fits = _fits(story.where(story.pictures, lambda u: u.scan is not None))
    cut = [fit.cut for fit in fits if fit.cut >= CUT_SHARE]
    if len(cut) < max(MOST_SHARE * len(fits), LEAST_UPDATES):
        return None
    first = story.where(story.pictures, lambda u: u.scan is not None and u.scan.cut >= CUT_SHARE)[0]
    return story.failure(FLAT, first.step, cut_beams=median(cut), scans=len(cut))


def too_flat(story: Story) -> Failure | None:
    """The run's own model of the laser hardly tells the truth from where the filter was."""
    wrong = [update for update in _wrong(story) if update.scan and update.scan.off < OFF_SHARE]
    fits = _fits(wrong)
    if len(fits) < LEAST_UPDATES:
        return None
    ahead, own = median(fit.ahead for fit in fits), median(fit.own_ahead for fit in fits)
    numbers = _says_little(story, fits)
    if ahead < TELLING_NATS or not 0 <= own <= FLAT_NATS or not numbers:
        return None
    numbers |= {"ahead_nats": ahead, "own_nats": own, "between_m": _between_m(story)}
    return story.failure(FLAT, wrong[0].step, **numbers, scans=len(fits))


def never_sure(story: Story) -> Failure | None:
    """The run was right, and its own model of the laser says too little to keep the cloud together."""
    searched = story.where(range(story.lost, story.end + 1), lambda u: u.scan is not None)
    right = [update for update in searched if update.score.correct and not update.score.converged]
    fits = [fit for fit in _fits(right) if fit.off < OFF_SHARE]
    if story.episode.kind != SEARCHING or len(fits) < max(MOST_SHARE * len(searched), LEAST_UPDATES):
        return None
    numbers = _says_little(story, fits)
    if not numbers:
        return None
    return story.failure(FLAT, right[0].step, **numbers, between_m=_between_m(story), scans=len(fits))


def _says_little(story: Story, fits: list[ScanFit]) -> dict[str, Value]:
    """Return what the run's model says of some scans beside what its motion needs; {}: it is enough."""
    growth = median(u.surprise.growth for u in story.updates if u.surprise is not None)
    says = median(fit.own_over_typical for fit in fits)
    return {} if says > max(growth, FLAT_NATS) else {"says_nats": says, "needs_nats": growth}


def _between_m(story: Story) -> float:
    return median(u.moved_m for u in story.updates if u.moved_m is not None)


def fits_elsewhere(story: Story) -> Failure | None:
    """The scans fit the truth, and where the filter was about as well."""
    wrong = _wrong(story)
    elsewhere = [u for u in wrong if u.scan and u.scan.off < OFF_SHARE and u.scan.is_compared]
    fits = _fits(elsewhere)
    if len(fits) < max(MOST_SHARE * len(wrong), LEAST_UPDATES):
        return None
    ahead, apart_m = median(fit.ahead for fit in fits), median(fit.apart_m for fit in fits)
    if ahead > ALIKE_NATS:
        return None
    x, y = fits[0].rival
    where = {"rival_x_m": x, "rival_y_m": y, "apart_m": apart_m}
    if apart_m < elsewhere[0].lost_m:  # the same place, in another heading
        turned = median(update.score.heading_error_rad or 0.0 for update in elsewhere)
        where = {"turned_deg": float(np.degrees(turned))}
    along = {"corridor": "yes"} if median(fit.between for fit in fits) <= ALIKE_NATS else {}
    return story.failure(AMBIGUITY, wrong[0].step, ahead_nats=ahead, **where, **along, scans=len(fits))


def _wrong(story: Story) -> list[UpdateEvidence]:
    lost = range(story.lost, story.end + 1)
    return story.where(lost, lambda u: u.score.correct is False and u.scan is not None)


def _is_bad(update: UpdateEvidence) -> bool:
    fit = update.scan
    return fit is not None and (fit.off >= OFF_SHARE or fit.ahead < -WORSE_NATS)


def _bad(story: Story) -> list[UpdateEvidence]:
    """Return the updates around the loss whose scan does not fit the truth; none where they are few."""
    known = story.where(story.pictures, lambda u: u.scan is not None)
    bad = [update for update in known if _is_bad(update) and update.scan and update.scan.off >= OFF_SHARE]
    return bad if len(bad) >= max(MOST_SHARE * len(known), 1) else []


def _since(bad: list[UpdateEvidence], story: Story) -> int:
    """Return the step from which on scans were bad without a gap up to the first of these."""
    k = next(k for k in story.pictures if story.updates[k] is bad[0])
    while k > 0 and _is_bad(story.updates[k - 1]):
        k -= 1
    return story.updates[k].step


def _off(bad: list[UpdateEvidence]) -> dict[str, Value]:
    return {"off_beams": median(fit.off for fit in _fits(bad))}


def _unseen(update: UpdateEvidence) -> float:
    return _share(update, "beyond") + _share(update, "unseen")


def _share(update: UpdateEvidence, judgment: str) -> float:
    return update.scan.shares.get(judgment, 0.0) if update.scan is not None else 0.0


def _fits(updates: Iterable[UpdateEvidence]) -> list[ScanFit]:
    return [update.scan for update in updates if update.scan is not None]
