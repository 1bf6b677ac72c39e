"""Whether a run failed, when, and whether that is the harm that was to be done: judged by the truth alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from maurice_datasets.trials.drives import Bench, RenderedSession
from maurice_mcl.filter.localizer import ALL_ZERO, Localizer
from maurice_mcl.filter.localizer import LEFT_MAP as LEFT
from maurice_mcl.reasons.causes import LEFT_MAP, NUMERIC, PROPOSAL, RESAMPLING
from maurice_mcl.scoring.metrics import StepScore, first_mostly, first_run_of, score_step
from maurice_mcl.scoring.modes import near_truth
from maurice_mcl.scoring.table import LOST_FOR
from maurice_mcl.sensor.ahead import Compared, compared
from maurice_mcl.values.library import Library
from maurice_mcl.values.records import Comparison, StepRecord
from maurice_mcl.values.session import Moment

from .ways import HEALTHY, LOOKS, Planting

NEVER = 1_000_000  # a step that no drive has
MOST = 0.5  # of the weights
Steps = Iterator[tuple[Moment, StepRecord]]


def localizer_of(planting: Planting) -> Localizer:
    """Build the filter of a planted drive, without a seed."""
    return _bench(planting.library).localizer(dict(planting.settings)).of_session(planting.session)


@lru_cache(2)
def _bench(library: Library) -> Bench:
    """Return what is built over a library, kept for the last two: most causes leave it as it is."""
    return Bench.of(library)


def compared_with(
    plain: RenderedSession, localizer: Localizer, planting: Planting, known: dict[int, Comparison]
) -> tuple[Comparison, ...]:
    """Compare the pictures of a planted drive; those of the plain drive only if they are not `known`."""
    own = {id(moment.frame.image) for moment in plain.all_moments}
    comparisons_there = []
    for moment in planting.session.moments():
        image = moment.frame.image
        comparison = known.get(id(image))
        if comparison is None:
            comparison = compared([localizer.sensor], moment.frame)[0].comparison
        if id(image) in own:
            known[id(image)] = comparison
        comparisons_there.append(comparison)
    return tuple(comparisons_there)


def steps_of(localizer: Localizer, planting: Planting, comparisons: Sequence[Comparison], seed: int) -> Steps:
    """Run a filter with a seed over a planted drive whose pictures are compared already."""
    seeded = replace(localizer, seed=seed)
    state = seeded.initialize(planting.session.info.start)
    for moment, comparison in zip(planting.session.moments(), comparisons, strict=True):
        state, record = seeded.step(state, moment.frame, Compared(comparison, 0.0))
        yield moment, record


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run against the truth. Steps are numbers of pictures."""

    updates: int
    localized_at: int | None  # first of five updates of which four are localized
    lost_from: int | None  # first of four updates in a row that are too far off, after it was localized or
    # from the beginning where the start was known
    right_share: float  # of all updates
    held_from: int | None  # first step at which particles near the truth had weight for a copy or more
    dropped_at: int | None  # step at which resampling left none of those, for good
    left_at: int | None  # first step at which no particle was in free space
    zero_at: int | None  # first step at which most weights in free space were zero

    @property
    def failed(self) -> bool:
        """Whether the run was lost, or never found itself."""
        return self.localized_at is None or self.lost_from is not None


def outcome_of(steps: Steps, *, start_known: bool) -> Outcome:
    """Follow a run to its end."""
    scores: list[StepScore] = []
    step_held = dropped = left = None
    zero = None
    for moment, record in steps:
        if moment.truth is None:
            raise ValueError("expected the truth at every picture of a planted drive")
        scores.append(score_step(record.estimate, moment.truth))
        near, size, step = near_truth(record, moment.truth), record.weighted.size, moment.frame.step
        _, weighed, after = near.shares
        counted = weighed * size >= 1
        step_held = moment.frame.step if step_held is None and counted else step_held
        dropped = step if counted and after == 0 else (None if after > 0 else dropped)
        if left is None and {LEFT, ALL_ZERO} & set(record.events):
            left = step
        zero = step if zero is None and _is_zero(record) else zero
    localized = first_mostly(np.array([score.localized is True for score in scores], bool))
    return Outcome(
        updates=len(scores),
        localized_at=localized,
        lost_from=_lost_from(scores, 0 if start_known else localized),
        right_share=float(np.mean([score.correct is True for score in scores])),
        held_from=step_held,
        dropped_at=dropped,
        left_at=left,
        zero_at=zero,
    )


def _is_zero(record: StepRecord) -> bool:
    """Return whether numbers were too small or too large for the weights of particles in free space."""
    inside = record.sighting.entries >= 0
    if not inside.any():
        return False
    weights = np.exp(record.weighted.log_weights[inside])
    return ALL_ZERO in record.events or float(np.mean(weights == 0)) >= MOST


def _lost_from(scores: Sequence[StepScore], first: int | None) -> int | None:
    """Return the first update of a loss after the first update; None where it never was localized."""
    if first is None:
        return None
    first_lost = first_run_of([score.lost is True for score in scores[first:]], LOST_FOR)
    return None if first_lost is None else first + first_lost - LOST_FOR + 1


def is_harm(kind: str, planting: Planting, outcome: Outcome) -> bool:
    """Return whether a run failed in the way, and at the time, that the planted cause makes it fail."""
    if kind == HEALTHY:
        return not outcome.failed
    special = {
        PROPOSAL: outcome.left_at is None and (outcome.held_from or NEVER) > LOOKS,
        RESAMPLING: outcome.dropped_at is not None,
        LEFT_MAP: outcome.left_at is not None,
        NUMERIC: outcome.zero_at is not None,
    }
    return outcome.failed and special.get(kind, True) and _in_time(planting, outcome)


def _in_time(planting: Planting, outcome: Outcome) -> bool:
    """Return whether a run with a known start was lost after the cause began, and soon after."""
    if planting.session.info.start is None or outcome.lost_from is None:
        return outcome.right_share < 0.5 or outcome.localized_at is None
    return planting.since <= outcome.lost_from <= planting.since + planting.late
