"""Branching a run: the state in which another filter goes on from one of its steps.

Random numbers are drawn by address (seed, step, purpose), so a branch with the run's own seed draws the same
numbers at every later step, and one that changes nothing is the run itself, bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..values.randomness import Domain, Purpose, stream
from ..values.records import (
    NO_HISTORY,
    Belief,
    FilterState,
    Past,
    RecoveryState,
    StepRecord,
    uniform_log_weights,
)
from .following import movement_of, unexplained
from .localizer import LEFT_MAP, Localizer
from .proposal import MotionProposal
from .recovery import RecoveryStrategy
from .resampling import systematic
from .weighting import usable_evidence


def recovery_evidence(record: StepRecord) -> float:
    """Return what the recovery strategy was told of an update."""
    return usable_evidence(record.calibrated_evidence, LEFT_MAP in record.events)


def recovery_after(strategy: RecoveryStrategy, evidences: Iterable[float]) -> RecoveryState:
    """Return the averages of a strategy that saw these evidences, update by update."""
    state = NO_HISTORY
    for evidence in evidences:
        state = strategy(evidence, state).state
    return state


def remembered(
    original: Localizer, branch: Localizer, before: Belief, record: StepRecord, past: Sequence[Past]
) -> tuple[Past, ...]:
    """Return what a branch would have kept of an update of the run that it leaves, the latest first.

    That run is known by its clouds, the one `before` the update too, and its estimates. Where its particles
    followed no sensor, none measures how the robot moved.
    """
    if isinstance(branch.proposal, MotionProposal):
        return ()
    prediction, movement = original.predict(before, record.frame), None
    if not isinstance(original.proposal, MotionProposal):
        comparison = unexplained(record.sighting.comparison, prediction.belief)
        movement = movement_of(comparison, record.frame, past)
    return branch.proposal.keep(replace(record, predicted=prediction.belief), movement, past)


def branched(
    localizer: Localizer,
    step: int,
    belief: Belief,
    evidences: Iterable[float],
    size: int | None = None,
    past: Sequence[Past] = (),
) -> FilterState:
    """Return the state in which a filter goes on from a belief that another one had after a step.

    `evidences` are what recovery was told until then (`recovery_evidence`); none of them where they are
    those of another sensor model. With a `size` other than the belief's, it is resampled to that many. By the
    updates of the `past`, the latest first, its sensors check what they propose.
    """
    if size is not None and size != belief.size:
        belief = resized(belief, size, localizer.seed, step)
    columns = np.asfortranarray(belief.poses)  # as the filter holds them: its sums and sines round alike
    same = Belief(columns, belief.log_weights, belief.origin)
    return FilterState(step, same, recovery_after(localizer.recovery.strategy, evidences), tuple(past))


def resized(belief: Belief, size: int, seed: int, step: int) -> Belief:
    """Return a belief resampled to another number of particles, systematically, with equal weights.

    First copies come first, in the order of their parents: particles of a larger cloud then keep the motion
    noise that they have in the smaller one.
    """
    rng = stream(Domain.FILTER, seed, step, Purpose.BRANCH)
    parents = systematic(belief.weights, size, rng)
    first = np.searchsorted(parents, parents)  # parents are in ascending order
    order = np.lexsort((parents, np.arange(size) - first))
    poses = belief.poses[parents[order]]
    return Belief(poses, uniform_log_weights(size), belief.origin)
