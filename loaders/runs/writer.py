"""Writing a saved run while it goes: parts of so many steps, each complete, clouds before their steps.

A single growing Parquet file could not be read after a kill, as its footer comes last.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_mcl.reasons.causes import Failure
from maurice_mcl.values.arrays import F32, F64, U8
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.library import Radii
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import (
    Belief,
    Estimate,
    LibraryEvidence,
    Opinion,
    RecoveryTest,
    Sighting,
    StepRecord,
)
from maurice_mcl.values.session import Frame, Moment

from ..files.writing import new_folder, put
from ..libraries.files import MANIFEST
from ..session_log.header import arena_to_json
from .manifest import (
    COMPARISON,
    CONFIGURATION,
    MAP,
    RUNS,
    VERSION,
    RunManifest,
    ended,
    to_bytes,
    write_manifest,
)

TABLES = ("particles", "renewed", "steps")  # in the order in which parts are written
PART_STEPS = 25
PART_PARTICLES = 200_000  # a part is also full with so many rows of a cloud


class RunWriter:
    """Writes a run into a new folder, part by part. InputError if it exists, unless `force` and a run."""

    def __init__(
        self, folder: Path, manifest: RunManifest, configuration: str, arena: Arena, *, force: bool = False
    ) -> None:
        self.folder, self._manifest = folder, manifest
        self._schema = steps_schema(manifest.channels)
        self._waiting: list[StepRows] = []
        self.written = 0  # steps
        self.failures: Sequence[Failure] | None = None  # why the run failed, as far as it got
        with new_folder(folder, *RUNS, force=force) as filling:  # never without a manifest
            for table in TABLES:
                (filling / table).mkdir()
            put(filling / CONFIGURATION, configuration.encode())
            put(filling / MAP, to_bytes(arena_to_json(arena)))
            write_manifest(filling, manifest)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Take in the next update."""
        self._waiting.append(rows_of(moment, record))
        particles = sum(rows.particles.height for rows in self._waiting)
        if len(self._waiting) >= PART_STEPS or particles >= PART_PARTICLES:
            self._flush()

    def close(self, state: str, manifest: RunManifest | None = None) -> None:
        """Write what is left, and in the manifest how it ended: "complete", "stopped" or "failed".

        `manifest` takes the place of the one it began with, where more is known at the end.
        """
        self._flush()
        failures = self.failures or ()
        known = all(failure.episode.last <= self.written for failure in failures)  # else a disk ran full
        manifest = manifest or self._manifest
        write_manifest(self.folder, ended(manifest, state, self.written, self.failures if known else None))

    def _flush(self) -> None:
        if not self._waiting:
            return
        rows, self._waiting = self._waiting, []
        frames = {
            "particles": pl.concat([row.particles for row in rows]),
            "renewed": pl.concat([row.renewed for row in rows]),
            "steps": pl.DataFrame([row.step for row in rows], schema=self._schema, orient="row"),
        }
        for table in TABLES:
            part = self.folder / table / part_name(self.written + 1)
            put(part, _parquet(frames[table]))
        self.written += len(rows)


def part_name(first_step: int) -> str:
    """Name a part by its first step, so that sorting by name sorts by step."""
    return f"{first_step:08d}.parquet"


def _parquet(frame: pl.DataFrame) -> bytes:
    content = io.BytesIO()  # not by name: a name with a star in it would be taken for a pattern
    frame.write_parquet(content, compression="zstd")
    return content.getvalue()


def begin_comparison(folder: Path, labels: Sequence[str], *, force: bool = False) -> None:
    """Begin a folder with a folder for each run below it. Raises InputError as for `RunWriter`."""
    with new_folder(folder, *RUNS, force=force) as filling:
        manifest = to_bytes({"format": COMPARISON, "version": VERSION, "runs": list(labels)})
        put(filling / MANIFEST, manifest)


# One update as rows of the tables of a saved run, and back (docs/saved-runs.md).

BEST = 5  # entries that are kept of every comparison
TOOK = "took_s"  # the one column that does not repeat

_CLOUD: dict[str, Any] = {"step": pl.Int32, "index": pl.Int32}
_CLOUD |= {"x_m": pl.Float32, "y_m": pl.Float32, "heading_rad": pl.Float32}
PARTICLES: dict[str, Any] = {**_CLOUD, "carried_log_weight": pl.Float64, "log_weight": pl.Float64}
RENEWED: dict[str, Any] = {**_CLOUD, "log_weight": pl.Float64, "parent": pl.Int32, "injected": pl.Boolean}

_POSE = ("x_m", "y_m", "heading_rad")
_SPREAD = ("sd_x_m", "sd_y_m", "heading_sd_rad", "mass", "confidence", "converged")

# Parts of a record that may be None, as all of their columns are then: what recovery compared, what the
# library as a whole says of a picture, and what a second filter says of the estimate.
PARTS: Mapping[str, tuple[type[Any], Mapping[str, Any]]] = {
    "recovery_test": (
        RecoveryTest,
        {"recovery_compared": pl.String, "recovery_threshold": pl.Float64, "recovery_found": pl.Float64},
    ),
    "library_evidence": (
        LibraryEvidence,
        {"library_evidence_mean": pl.Float64, "library_evidence_best": pl.Float64},
    ),
    "opinion": (Opinion, {"not_lost": pl.Float64, "not_lost_alarm": pl.Float64}),
}


def steps_schema(channels: Sequence[str]) -> dict[str, Any]:
    """Return names and types of the columns of `steps`, for a run with these channels."""
    floats = [f"{kind}_{name}" for kind in ("estimate", "mean") for name in (*_POSE, *_SPREAD)]
    floats += ["effective_sample_size", "log_evidence", "calibrated_evidence"]
    floats += [f"evidence_{name}" for name in channels] + [f"truth_{name}" for name in _POSE]
    schema: dict[str, Any] = {"step": pl.Int32, "time_s": pl.Float64}
    schema |= {"picture": pl.String, "picture_sha256": pl.String, "motions": pl.List(pl.List(pl.Float64))}
    schema |= dict.fromkeys(floats, pl.Float64)
    for _, columns in PARTS.values():
        schema |= columns
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
    row |= {"picture": frame.picture, "picture_sha256": picture_hash(frame.image, frame.scan)}
    row |= {"motions": frame.motions.tolist()}
    row |= _estimate_columns("estimate", record.estimate) | _estimate_columns("mean", record.mean_estimate)
    row |= {"effective_sample_size": record.effective_sample_size, "log_evidence": record.log_evidence}
    row |= {"calibrated_evidence": record.calibrated_evidence}
    evidences = zip(comparison.channels, record.channel_evidence.tolist(), strict=True)
    row |= {f"evidence_{name}": value for name, value in evidences}
    for part, (_, columns) in PARTS.items():
        value = getattr(record, part)
        row |= dict(zip(columns, astuple(value), strict=True)) if value else dict.fromkeys(columns)
    truth: list[Any] = [None] * len(_POSE) if moment.truth is None else moment.truth.tolist()
    row |= {f"truth_{name}": value for name, value in zip(_POSE, truth, strict=True)}
    row |= {"events": list(record.events), "session_events": list(moment.events)}
    row |= {"best_entries": best.tolist(), "best_quality": comparison.quality[best].tolist()}
    return row | {"particles": record.weighted.size, TOOK: float(sum(record.took_s.values()))}


def picture_hash(image: U8, scan: LaserScan | None = None) -> str:
    """Return the SHA-256 of a decoded picture (H, W, 3), its shape included, and of a scan's ranges."""
    digest = hashlib.sha256(str(image.shape).encode())
    digest.update(np.ascontiguousarray(image).data)
    if scan is not None:
        digest.update(scan.ranges_m.tobytes())
    return digest.hexdigest()


def _estimate_columns(kind: str, estimate: Estimate) -> dict[str, float]:
    spread = (*estimate.sd_m, estimate.heading_sd_rad, estimate.mass, estimate.confidence, estimate.converged)
    names = (f"{kind}_{name}" for name in (*_POSE, *_SPREAD))
    return dict(zip(names, (*estimate.pose.tolist(), *spread), strict=True))


def _part_of(row: Mapping[str, Any], part: str) -> Any:
    kind, columns = PARTS[part]
    values = [row[name] for name in columns]
    return None if values[0] is None else kind(*values)


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


def moment_of(
    rows: StepRows, image: U8, readings: Mapping[str, float] | None = None, scan: LaserScan | None = None
) -> Moment:
    """Return the moment back, with picture, readings and scan from elsewhere."""
    row = rows.step
    motions = np.array(row["motions"], np.float64).reshape(-1, 3)
    frame = Frame(row["step"], row["time_s"], motions, image, row["picture"], readings or {}, scan)
    known = row["truth_x_m"] is not None
    truth = np.array([row[f"truth_{name}"] for name in _POSE]) if known else None
    return Moment(frame, truth, tuple(row["session_events"]))


def weighted_of(rows: StepRows, origin: F64) -> Belief:
    """Return the weighted cloud back."""
    return _belief_of(rows.particles, origin)


def record_of(rows: StepRows, frame: Frame, sighting: Sighting, origin: F64, radii: Radii) -> StepRecord:
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
        estimate=_estimate_of(row, "estimate", radii),
        mean_estimate=_estimate_of(row, "mean", radii),
        effective_sample_size=row["effective_sample_size"],
        log_evidence=row["log_evidence"],
        calibrated_evidence=row["calibrated_evidence"],
        channel_evidence=np.array(evidences),
        parents=renewed["parent"].to_numpy() if renewed.height else None,
        injected=injected,
        belief=_belief_of(renewed, origin) if renewed.height else weighted,
        events=tuple(row["events"]),
        took_s={"all": row[TOOK]},
        recovery_test=_part_of(row, "recovery_test"),
        library_evidence=_part_of(row, "library_evidence") or sighting.comparison.library_evidence,
        opinion=_part_of(row, "opinion"),
    )


def _belief_of(cloud: pl.DataFrame, origin: F64) -> Belief:
    poses: F32 = np.column_stack([cloud[name].to_numpy() for name in _POSE])
    return Belief(poses, cloud["log_weight"].to_numpy(), origin)


def _estimate_of(row: Mapping[str, Any], kind: str, radii: Radii) -> Estimate:
    pose = np.array([row[f"{kind}_{name}"] for name in _POSE])
    sd_x, sd_y, *shares = (row[f"{kind}_{name}"] for name in _SPREAD)
    heading_sd, mass, confidence, converged = shares
    return Estimate(pose, (sd_x, sd_y), heading_sd, mass, confidence, converged, radii)
