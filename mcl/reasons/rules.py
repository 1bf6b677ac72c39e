"""The rules of a diagnosis, one table: each names a cause, and its evidence, where it holds.

They are asked in this order (docs/diagnose.md). What befell the recording and the robot comes first, as
everything after it follows from it. Then what is known of the place, the light and the view, as no filter can
do without them. What is left is due to the filter: its sensor model, its particles, and chance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..scoring.episodes import Episode
from ..scoring.table import PROBABLY_LOST
from . import drive_rules as drive
from . import laser_rules as laser
from . import picture_rules as picture
from . import suspicion as blind
from .causes import (
    FLAT,
    LEFT_MAP,
    LIBRARY_GAP,
    LIGHTING,
    MOTION,
    MOUNT,
    UNKNOWN,
    UNSEEN,
    VIEW,
    WRONG_MAP,
    Failure,
)
from .evidence import Story, UpdateEvidence, knows_where
from .surroundings import Surroundings

TRUTH, NO_TRUTH, NEVER_KNEW = "truth", "no truth", "never knew where it is, without truth"


@dataclass(frozen=True, slots=True)
class CauseRule:
    """A rule, and the runs that it is for: TRUTH, NO_TRUTH or NEVER_KNEW."""

    holds: Callable[[Story], Failure | None]
    asked: tuple[str, ...] = (TRUTH,)


RULES = (
    CauseRule(drive.gap_in_log),
    CauseRule(blind.told_carried, (NO_TRUTH,)),
    CauseRule(blind.long_gap, (NO_TRUTH,)),
    CauseRule(drive.stuck_pictures, (TRUTH, NO_TRUTH)),
    CauseRule(drive.odometry_jumps, (TRUTH, NO_TRUTH)),
    CauseRule(blind.skipped, (NO_TRUTH,)),
    CauseRule(drive.carried),
    CauseRule(drive.off_map),
    CauseRule(blind.left_map, (NO_TRUTH,)),
    CauseRule(drive.out_of_plane),
    CauseRule(drive.recorded_jump),
    CauseRule(laser.left_mapped),
    CauseRule(drive.beyond_motion),
    CauseRule(drive.weights_vanish, (TRUTH, NO_TRUTH, NEVER_KNEW)),
    CauseRule(blind.ever_left_map, (NEVER_KNEW,)),
    CauseRule(blind.scans_off, (NO_TRUTH,)),
    CauseRule(laser.wrong_mount),
    CauseRule(laser.wrong_map),
    CauseRule(laser.walls_unseen),
    CauseRule(laser.scene_changed),
    CauseRule(blind.unlike_all, (NO_TRUTH,)),
    CauseRule(picture.library_gap),
    CauseRule(picture.lighting),
    CauseRule(picture.unlike_references),
    CauseRule(drive.slipped_as_told),
    CauseRule(laser.wrong_start),
    CauseRule(laser.range_cut),
    CauseRule(laser.fits_elsewhere),
    CauseRule(laser.too_flat),
    CauseRule(laser.never_sure),
    CauseRule(drive.unlucky),
    CauseRule(picture.ambiguity),
    CauseRule(drive.no_particle),
    CauseRule(blind.unexplained, (NO_TRUTH,)),
)
# causes by which pictures or scans speak against the true place
AGAINST_TRUTH = (LIBRARY_GAP, LIGHTING, VIEW, MOUNT, WRONG_MAP, UNSEEN)
COMPARED = (*AGAINST_TRUTH, FLAT)


def failures_of(story: Story, asked: str) -> list[Failure]:
    """Return the failures that the rules for a run find, in the order of the rules."""
    rules = (rule for rule in RULES if asked in rule.asked)
    return [failure for rule in rules if (failure := rule.holds(story)) is not None]


def decide(story: Story) -> Failure:
    """Return the cause of one episode of a run with truth, with the others that hold.

    That is the first rule's that holds. A movement and a picture that coincide are weighed: the cause is the
    one by which more of the weight near the truth was lost.
    """
    failures = failures_of(story, TRUTH)
    if not failures:
        return story.failure(UNKNOWN, story.updates[story.lost].step)
    first, by_pictures = failures[0], [failure for failure in failures if failure.kind in AGAINST_TRUTH]
    if first.kind == MOTION and by_pictures:
        motion_nats, picture_nats = story.nats_lost
        first = by_pictures[0] if picture_nats > motion_nats else first
    implied: tuple[str, ...] = (
        (first.kind, *COMPARED) if first.kind == LEFT_MAP else (first.kind,)
    )  # nothing there to compare
    if first.kind == MOUNT and "ahead_m" in first.evidence:
        implied = (MOUNT, WRONG_MAP, VIEW, UNSEEN)  # these follow from a laser that is elsewhere
    others = dict.fromkeys(failure.kind for failure in failures if failure.kind not in implied)
    return replace(first, also=tuple(others))


def suspected(
    updates: Sequence[UpdateEvidence], doubts: Sequence[tuple[int, int]], around: Surroundings | None = None
) -> tuple[Failure, ...]:
    """Return each doubt of a run without truth, from step to step, with its cause where one shows, in order.

    A run that never knew where it is has no doubt; of it the weights and the map can tell.
    """
    usual, levels = (None, None) if around is None else (around.usual, around.levels)

    def story(first: int, last: int) -> Story:
        episode = Episode(PROBABLY_LOST, first, last, noticed=first)
        return Story(updates, episode, usual=usual, levels=levels)

    failures = [failures_of(story(first, last), NO_TRUTH)[0] for first, last in doubts]
    if not failures and updates and not any(map(knows_where, updates)):
        failures = failures_of(story(updates[0].step, updates[-1].step), NEVER_KNEW)[:1]
    return tuple(replace(failure, truth_known=False) for failure in failures)
