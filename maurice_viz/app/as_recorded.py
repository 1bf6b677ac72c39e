"""Another localizer's particles and pose as records of updates, so that our views show them.

Nothing is filtered and no picture is compared: what a bag does not hold stays empty or unknown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from maurice_loaders.bags.localizer import Overview, RecordedLocalizer, RecordedUpdate
from maurice_loaders.errors import InputError, PictureError
from maurice_loaders.io.notes import ReadingNotes
from maurice_mcl.arrays import F64, U8
from maurice_mcl.filter.estimate import CLUSTER_M, CONFIDENCE_M, heaviest_cluster, share_within, weighted_mean
from maurice_mcl.library import Library
from maurice_mcl.records import (
    Belief,
    Estimate,
    StepRecord,
    effective_sample_size,
    normalize,
    uniform_log_weights,
)
from maurice_mcl.session import Frame, Moment

from .restoring import NO_PICTURE, nothing_seen

AFTER_RESAMPLING = (
    "shown as recorded: AMCL and Beluga publish their particles after resampling, so the weights are nearly "
    "equal and say little of how well each particle matched"
)


def map_of(localizer: RecordedLocalizer, overview: Overview) -> Library:
    """Make a library without entries, of which only the map can be drawn."""
    return Library(localizer.info.name, np.zeros((0, 3)), (), {}, overview.arena)


@dataclass(slots=True)
class AsRecorded:
    """The updates of one recorded localizer."""

    localizer: RecordedLocalizer
    overview: Overview
    label: str
    notes: ReadingNotes
    unweighted: int = 0  # clouds so far whose weights were of no use, and count as equal
    _begin_s: float | None = field(init=False, default=None)

    def updates(self) -> Iterator[Mapping[str, tuple[Moment, StepRecord]]]:
        """Give one moment and record a cloud, in order."""
        origin = map_of(self.localizer, self.overview).origin
        for number, update in enumerate(self.localizer.updates(self.notes), start=1):
            self._begin_s = update.t_s if self._begin_s is None else self._begin_s
            image = self._image(update)
            name = update.picture or "no picture"
            frame = Frame(number, update.t_s - self._begin_s, update.motions, image, name)
            events = (AFTER_RESAMPLING,) if number == 1 else ()
            moment = Moment(frame, update.truth, events)
            yield {self.label: (moment, record_of(frame, update, self._belief(update, origin)))}

    def _image(self, update: RecordedUpdate) -> U8:
        if update.read is None:
            return NO_PICTURE
        try:
            return update.read()
        except PictureError as problem:
            self.notes.problem(InputError(self.localizer.path, f"{update.picture}: {problem}"))
            return NO_PICTURE

    def _belief(self, update: RecordedUpdate, origin: F64) -> Belief:
        local = update.poses.copy()
        local[:, :2] -= origin
        log_weights = _log_weights(update.weights)
        if log_weights is None:
            self.unweighted += update.weights is not None
            log_weights = uniform_log_weights(len(local))
        return Belief(local.astype(np.float32), log_weights, origin)


def record_of(frame: Frame, update: RecordedUpdate, belief: Belief) -> StepRecord:
    """Make the record of one cloud; what only the filter itself could know is left empty or NaN."""
    return StepRecord(
        frame=frame,
        predicted=belief,  # as it was before the sensor is not in the bag
        sighting=nothing_seen(belief.size),
        weighted=belief,
        estimate=estimate_of(update, belief),
        mean_estimate=weighted_mean(belief),
        effective_sample_size=effective_sample_size(belief.log_weights),
        log_evidence=float("nan"),
        calibrated_evidence=float("nan"),
        channel_evidence=np.zeros(0),
        parents=None,
        injected=None,
        belief=_without_heirs(belief),
        events=(),
        took_s={},
    )


def _without_heirs(belief: Belief) -> Belief:
    """Give the same cloud with one particle of no weight more.

    Whom the next cloud's particles come from is not in the bag. Lines from particle to particle are drawn
    where a cloud is as large as the one before it was left, and would mean nothing here.
    """
    poses = np.append(belief.poses, belief.poses[:1], axis=0)
    return Belief(poses, np.append(belief.log_weights, -np.inf), belief.origin)


def estimate_of(update: RecordedUpdate, belief: Belief) -> Estimate:
    """Give the localizer's own pose with its own spread, or the heaviest cluster where it said none."""
    if update.pose is None:
        return heaviest_cluster(belief)
    own = update.pose
    x, y, heading = (float(value) for value in own.sd)
    near = share_within(belief, own.pose, CLUSTER_M)
    return Estimate(
        own.pose, (x, y), heading, near, share_within(belief, own.pose, CONFIDENCE_M), converged=near
    )


def _log_weights(weights: F64 | None) -> F64 | None:
    """Give normalized log-weights (N,), or None where the weights make no sense."""
    if weights is None or not (np.isfinite(weights).all() and (weights >= 0).all() and weights.sum() > 0):
        return None
    with np.errstate(divide="ignore"):
        return normalize(np.log(weights))[0]
