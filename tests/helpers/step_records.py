"""Step records made by hand: clouds of a few points, at places that one can work out on paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maurice_mcl.filter.estimate import heaviest_cluster, weighted_mean
from maurice_mcl.values.records import Belief, Comparison, Sighting, StepRecord, effective_sample_size
from maurice_mcl.values.session import Frame, Moment

Cloud = Sequence[tuple[float, float, float]]  # x_m, y_m and share of the weight, one a particle
NO_IMAGE = np.zeros((2, 2, 3), np.uint8)


def made(
    cloud: Cloud,
    *,
    step: int = 1,
    parents: Sequence[int] | None = None,
    injected: Sequence[bool] | None = None,
    events: tuple[str, ...] = (),
    evidence: float = -5.0,
    origin: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    references: int = 0,
) -> StepRecord:
    """Make a record whose weighted cloud this is; without references no picture was compared."""
    table = np.array(cloud, float)
    poses = np.column_stack([table[:, :2] - origin, np.full(len(table), heading)]).astype(np.float32)
    with np.errstate(divide="ignore"):
        weighted = Belief(poses, np.log(table[:, 2] / table[:, 2].sum()), np.array(origin))
    nothing, square = np.zeros(references, np.float32), np.zeros((0, references), np.float32)
    comparison = Comparison((), {}, square, square, nothing, square, nothing, nothing)
    return StepRecord(
        frame=Frame(step, 2.5 * step, np.zeros((1, 3)), NO_IMAGE, ""),
        predicted=weighted,
        sighting=Sighting(comparison, np.zeros(len(table), np.int32), np.zeros(0, np.float32)),
        weighted=weighted,
        estimate=heaviest_cluster(weighted),
        mean_estimate=weighted_mean(weighted),
        effective_sample_size=effective_sample_size(weighted.log_weights),
        log_evidence=evidence,
        calibrated_evidence=evidence,
        channel_evidence=np.zeros(0),
        parents=None if parents is None else np.array(parents, np.int32),
        injected=None if injected is None else np.array(injected),
        belief=weighted,
        events=events,
        took_s={},
    )


def moment(record: StepRecord, truth: tuple[float, float, float] | None = None, *told: str) -> Moment:
    """Put the truth and what the log says beside a record."""
    return Moment(record.frame, None if truth is None else np.array(truth), told)


def at(x: float, y: float, share: float, count: int = 4) -> list[tuple[float, float, float]]:
    """Give a tight cluster: particles within 2 cm of a place, sharing a share of the weight."""
    turn = np.arange(count) * 2 * np.pi / count
    return [(x + 0.02 * np.cos(t), y + 0.02 * np.sin(t), share / count) for t in turn]
