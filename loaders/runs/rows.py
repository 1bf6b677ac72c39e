"""One update as rows of the tables of a saved run, and back (docs/saved-runs.md)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from maurice_mcl.arrays import F32, F64, U8
from maurice_mcl.records import Belief, Estimate, Sighting, StepRecord
from maurice_mcl.session import Frame, Moment

BEST = 5  # entries that are kept of every comparison
TOOK = "took_s"  # the one column that does not repeat

_CLOUD: dict[str, Any] = {"step": pl.Int32, "index": pl.Int32}
_CLOUD |= {"x_m": pl.Float32, "y_m": pl.Float32, "heading_rad": pl.Float32}
PARTICLES: dict[str, Any] = {**_CLOUD, "carried_log_weight": pl.Float64, "log_weight": pl.Float64}
RENEWED: dict[str, Any] = {**_CLOUD, "log_weight": pl.Float64, "parent": pl.Int32, "injected": pl.Boolean}

_POSE = ("x_m", "y_m", "heading_rad")
_SPREAD = ("sd_x_m", "sd_y_m", "heading_sd_rad", "mass", "confidence", "converged")


def steps_schema(channels: Sequence[str]) -> dict[str, Any]:
    """Return names and types of the columns of `steps`, for a run with these channels."""
    floats = [f"{kind}_{name}" for kind in ("estimate", "mean") for name in (*_POSE, *_SPREAD)]
    floats += ["effective_sample_size", "log_evidence", "calibrated_evidence"]
    floats += [f"evidence_{name}" for name in channels] + [f"truth_{name}" for name in _POSE]
    schema: dict[str, Any] = {"step": pl.Int32, "time_s": pl.Float64}
    schema |= {"picture": pl.String, "picture_sha256": pl.String, "motions": pl.List(pl.List(pl.Float64))}
    schema |= dict.fromkeys(floats, pl.Float64)
    schema |= {"events": pl.List(pl.String), "session_events": pl.List(pl.String)}
    schema |= {"best_entries": pl.List(pl.Int32), "best_quality": pl.List(pl.Float32)}
    return schema | {"particles": pl.Int32, TOOK: pl.Float64}


@dataclass(frozen=True, slots=True, eq=False)
class StepRows:
    """One update: its row of `steps`, and its rows of the two clouds."""

    step: Mapping[str, Any]  # by the names of `steps_schema`
    particles: pl.DataFrame  # PARTICLES, N rows
    renewed: pl.DataFrame  # RENEWED, N' rows; none when the step did not resample


def rows_of(moment: Moment, record: StepRecord) -> StepRows:
    """Turn an update into rows. Truth stands beside the record, as everywhere."""
    return StepRows(_step_row(moment, record), _particle_rows(record), _renewed_rows(record))


def _step_row(moment: Moment, record: StepRecord) -> dict[str, Any]:
    frame, comparison = moment.frame, record.sighting.comparison
    best = comparison.best(BEST)
    row: dict[str, Any] = {"step": frame.step, "time_s": frame.time_s}
    row |= {"picture": frame.picture, "picture_sha256": picture_hash(frame.image)}
    row |= {"motions": frame.motions.tolist()}
    row |= _estimate_columns("estimate", record.estimate) | _estimate_columns("mean", record.mean_estimate)
    row |= {"effective_sample_size": record.effective_sample_size, "log_evidence": record.log_evidence}
    row |= {"calibrated_evidence": record.calibrated_evidence}
    evidences = zip(comparison.channels, record.channel_evidence.tolist(), strict=True)
    row |= {f"evidence_{name}": value for name, value in evidences}
    truth: list[Any] = [None] * len(_POSE) if moment.truth is None else moment.truth.tolist()
    row |= {f"truth_{name}": value for name, value in zip(_POSE, truth, strict=True)}
    row |= {"events": list(record.events), "session_events": list(moment.events)}
    row |= {"best_entries": best.tolist(), "best_quality": comparison.quality[best].tolist()}
    return row | {"particles": record.weighted.size, TOOK: float(sum(record.took_s.values()))}


def picture_hash(image: U8) -> str:
    """Return the SHA-256 of a decoded picture (H, W, 3), its shape included."""
    digest = hashlib.sha256(str(image.shape).encode())
    digest.update(np.ascontiguousarray(image).data)
    return digest.hexdigest()


def _estimate_columns(kind: str, estimate: Estimate) -> dict[str, float]:
    spread = (*estimate.sd_m, estimate.heading_sd_rad, estimate.mass, estimate.confidence, estimate.converged)
    names = (f"{kind}_{name}" for name in (*_POSE, *_SPREAD))
    return dict(zip(names, (*estimate.pose.tolist(), *spread), strict=True))


def _cloud(step: int, belief: Belief) -> dict[str, Any]:
    poses = np.ascontiguousarray(belief.poses.T)
    numbers: dict[str, Any] = {"step": np.full(belief.size, step, np.int32)}
    numbers |= {"index": np.arange(belief.size, dtype=np.int32)}
    return numbers | dict(zip(_POSE, poses, strict=True)) | {"log_weight": belief.log_weights}


def _particle_rows(record: StepRecord) -> pl.DataFrame:
    cloud = _cloud(record.frame.step, record.weighted)
    return pl.DataFrame(cloud | {"carried_log_weight": record.predicted.log_weights}).select(
        pl.col(name).cast(kind) for name, kind in PARTICLES.items()
    )


def _renewed_rows(record: StepRecord) -> pl.DataFrame:
    if record.parents is None:
        return pl.DataFrame(schema=RENEWED)
    fresh = np.zeros(record.belief.size, bool) if record.injected is None else record.injected
    came_from = {"parent": record.parents, "injected": fresh}
    return pl.DataFrame(_cloud(record.frame.step, record.belief) | came_from).select(
        pl.col(name).cast(kind) for name, kind in RENEWED.items()
    )


def moment_of(rows: StepRows, image: U8) -> Moment:
    """Return the moment back, with a picture from elsewhere."""
    row = rows.step
    motions = np.array(row["motions"], np.float64).reshape(-1, 3)
    frame = Frame(row["step"], row["time_s"], motions, image, row["picture"])
    known = row["truth_x_m"] is not None
    truth = np.array([row[f"truth_{name}"] for name in _POSE]) if known else None
    return Moment(frame, truth, tuple(row["session_events"]))


def weighted_of(rows: StepRows, origin: F64) -> Belief:
    """Return the weighted cloud back."""
    return _belief_of(rows.particles, origin)


def record_of(rows: StepRows, frame: Frame, sighting: Sighting, origin: F64) -> StepRecord:
    """Return the record back, with a sighting from elsewhere: of that, a run keeps only the best few."""
    row, weighted = rows.step, weighted_of(rows, origin)
    carried = rows.particles["carried_log_weight"].to_numpy()
    renewed, evidences = rows.renewed, [v for name, v in row.items() if name.startswith("evidence_")]
    injected = renewed["injected"].to_numpy() if renewed["injected"].any() else None
    return StepRecord(
        frame=frame,
        predicted=Belief(weighted.poses, carried, origin),
        sighting=sighting,
        weighted=weighted,
        estimate=_estimate_of(row, "estimate"),
        mean_estimate=_estimate_of(row, "mean"),
        effective_sample_size=row["effective_sample_size"],
        log_evidence=row["log_evidence"],
        calibrated_evidence=row["calibrated_evidence"],
        channel_evidence=np.array(evidences),
        parents=renewed["parent"].to_numpy() if renewed.height else None,
        injected=injected,
        belief=_belief_of(renewed, origin) if renewed.height else weighted,
        events=tuple(row["events"]),
        took_s={"all": row[TOOK]},
    )


def _belief_of(cloud: pl.DataFrame, origin: F64) -> Belief:
    poses: F32 = np.column_stack([cloud[name].to_numpy() for name in _POSE])
    return Belief(poses, cloud["log_weight"].to_numpy(), origin)


def _estimate_of(row: Mapping[str, Any], kind: str) -> Estimate:
    pose = np.array([row[f"{kind}_{name}"] for name in _POSE])
    sd_x, sd_y, *others = (row[f"{kind}_{name}"] for name in _SPREAD)
    return Estimate(pose, (sd_x, sd_y), *others)
