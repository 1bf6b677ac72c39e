"""Traces: errors, spread, effective sample size and confidence over the session."""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.records import StepRecord
from maurice_mcl.typing import F64

from .entities import RunPaths
from .look import RGB, RUN_COLORS, Scale
from .narrate import errors

POSITION_ERROR = "position_error"
HEADING_ERROR = "heading_error"
SPREAD = "spread"
CONFIDENCE = "confidence"
EFFECTIVE = "effective_sample"
LINE = 1.75

COLORS: dict[str, RGB] = {
    POSITION_ERROR: RUN_COLORS[0],
    SPREAD: RUN_COLORS[1],
    HEADING_ERROR: RUN_COLORS[0],
    CONFIDENCE: RUN_COLORS[0],
    EFFECTIVE: RUN_COLORS[1],
}


def prepare_traces(rec: rr.RecordingStream, paths: RunPaths) -> None:
    """Log names and colors of the lines, static."""
    for quantity, color in COLORS.items():
        name = f"{paths.label}: {quantity.replace('_', ' ')}"
        style = rr.SeriesLines(names=[name], colors=[color], widths=[LINE])
        rec.log(paths.trace(quantity), style, static=True)


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
