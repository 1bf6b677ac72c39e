"""Traces: one number an update, over the session."""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.records import StepRecord
from maurice_mcl.typing import F64

from .entities import RunPaths
from .look import RGB, RUN_COLORS, Scale
from .narrate import errors
from .places import Places

POSITION_ERROR = "position_error"
HEADING_ERROR = "heading_error"
SPREAD = "spread"
CONFIDENCE = "confidence"
EFFECTIVE = "effective_sample"
SURVIVORS = "survivors"
ANCESTORS = "ancestors"
TRUTH_RATIO = "truth_over_estimate"
TRUTH_RANK = "truth_rank"
EVIDENCE = "evidence"  # several lines in one entity: of all channels together, and of each alone
LINE = 1.75

COLORS: dict[str, RGB] = {
    POSITION_ERROR: RUN_COLORS[0],
    SPREAD: RUN_COLORS[1],
    HEADING_ERROR: RUN_COLORS[0],
    CONFIDENCE: RUN_COLORS[0],
    EFFECTIVE: RUN_COLORS[1],
    SURVIVORS: RUN_COLORS[2],
    ANCESTORS: RUN_COLORS[3],
    TRUTH_RATIO: RUN_COLORS[0],
    TRUTH_RANK: RUN_COLORS[0],
}
EVIDENCE_COLORS: tuple[RGB, ...] = ((255, 255, 255), *RUN_COLORS)


def prepare_traces(rec: rr.RecordingStream, paths: RunPaths, channels: tuple[str, ...] = ()) -> None:
    """Log names and colors of the lines, static."""
    for quantity, color in COLORS.items():
        name = f"{paths.label}: {quantity.replace('_', ' ')}"
        style = rr.SeriesLines(names=[name], colors=[color], widths=[LINE])
        rec.log(paths.trace(quantity), style, static=True)
    names = ["all", *channels]
    colors = [EVIDENCE_COLORS[k % len(EVIDENCE_COLORS)] for k in range(len(names))]
    style = rr.SeriesLines(names=names, colors=colors, widths=[LINE] * len(names))
    rec.log(paths.trace(EVIDENCE), style, static=True)


def draw_traces(
    rec: rr.RecordingStream, paths: RunPaths, record: StepRecord, truth: F64 | None, scale: Scale
) -> None:
    """Log one value a line; errors only where the truth is known."""
    if truth is not None:
        apart, angle = errors(record.estimate, truth)
        rec.log(paths.trace(POSITION_ERROR), rr.Scalars(scale.length(apart)))
        rec.log(paths.trace(HEADING_ERROR), rr.Scalars(float(np.degrees(angle))))
    rec.log(paths.trace(SPREAD), rr.Scalars(scale.length(float(np.hypot(*record.mean.sd_m)))))
    share = record.effective_sample_size / record.weighted.size
    rec.log(paths.trace(EFFECTIVE), rr.Scalars(share))
    rec.log(paths.trace(CONFIDENCE), rr.Scalars(record.estimate.confidence))


def draw_inside(rec: rr.RecordingStream, paths: RunPaths, record: StepRecord, ancestors: int) -> None:
    """Log shares of survivors and of ancestors, and the evidence of each channel."""
    rec.log(paths.trace(SURVIVORS), rr.Scalars(survivors(record)))
    rec.log(paths.trace(ANCESTORS), rr.Scalars(ancestors / record.belief.size))
    nats = np.append(record.calibrated_evidence, record.channel_evidence)
    if np.isfinite(nats).all():  # -inf when no particle was in free space
        rec.log(paths.trace(EVIDENCE), rr.Scalars(nats))


def draw_truth_seen(
    rec: rr.RecordingStream, paths: RunPaths, record: StepRecord, truth: F64, places: Places
) -> None:
    """Log how well the picture fits where the robot is: against the estimate, and among all references."""
    seen = record.sighting.comparison
    at_truth, at_estimate = places.entry_at(truth), places.entry_at(record.estimate.pose)
    if at_truth < 0:
        return
    logs = seen.log_likelihood
    rec.log(paths.trace(TRUTH_RANK), rr.Scalars(float((logs > logs[at_truth]).sum() + 1)))
    if at_estimate >= 0:
        rec.log(paths.trace(TRUTH_RATIO), rr.Scalars(float(logs[at_truth] - logs[at_estimate])))


def survivors(record: StepRecord) -> float:
    """Give the share of the weighted particles that left a copy; 1 where there was no resampling."""
    if record.parents is None:
        return 1.0
    kept = np.zeros(record.weighted.size, bool)
    kept[record.parents[record.parents >= 0]] = True
    return float(kept.mean())
