"""Traces: one number per update, over the session."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from maurice_mcl.arrays import F64
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.references import NearestReference, nearest_reference

from ..drawing.keys import line_key
from ..drawing.raster import png
from ..entities import RunPaths
from ..style import BAR, RGB, RUN_COLORS, Scale, font_safe
from ..text.narration import errors

# Which library entry stands for a pose, by the library's own rule.


@dataclass(frozen=True, slots=True, eq=False)
class EntryFinder:
    """The nearest reference of any pose in a map."""

    nearest: NearestReference
    origin: F64  # (2,)

    def entry_at(self, pose: F64) -> int:
        """Give the entry that a pose (3,) in the map's frame is nearest to; -1 outside free space."""
        relative = (pose - np.append(self.origin, 0)).astype(np.float32)
        return int(self.nearest.entries(relative[None], self.origin)[0])


def entry_finder(library: Library) -> EntryFinder:
    """Make the tables for a library with at least one entry."""
    return EntryFinder(nearest_reference(library.poses, library.arena), library.origin)


# Traces: one number an update, over the session.

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
EVIDENCE_COLORS: tuple[RGB, ...] = (*RUN_COLORS, (182, 60, 32), (88, 88, 205))  # of channels, in turn
ALL_TOGETHER: RGB = BAR  # of all channels, as the thickest line
THICK, THIN = 3.0, 1.0  # thin: channels for which no color was left
# plots that begin at zero, and how many steps of a scale their smallest panel has labels for
LABELED_STEPS = {POSITION_ERROR: 4.5, HEADING_ERROR: 6.5, SPREAD: 4.5}


def prepare_traces(rec: rr.RecordingStream, paths: RunPaths, channels: tuple[str, ...] = ()) -> None:
    """Log names and colors of the lines, static."""
    for quantity, color in COLORS.items():
        name = f"{font_safe(paths.label)}: {quantity.replace('_', ' ')}"
        style = rr.SeriesLines(names=[name], colors=[color], widths=[LINE])
        rec.log(paths.trace(quantity), style, static=True)
    lines = evidence_lines(channels)
    names, colors, widths = (list(part) for part in zip(*lines, strict=True))
    rec.log(paths.trace(EVIDENCE), rr.SeriesLines(names=names, colors=colors, widths=widths), static=True)
    key = rr.EncodedImage(contents=png(line_key(lines)), media_type="image/png")
    rec.log(paths.line_key, key, static=True)
    unseen = rr.SeriesPoints(colors=[(0, 0, 0, 0)], marker_sizes=[0.0])
    for quantity in LABELED_STEPS:
        rec.log(top_path(paths, quantity), unseen, static=True)


def evidence_lines(channels: tuple[str, ...]) -> list[tuple[str, RGB, float]]:
    """Give name, color and width of each line of evidence; colors come again, thinner, where all are used."""
    colors = [EVIDENCE_COLORS[k % len(EVIDENCE_COLORS)] for k in range(len(channels))]
    widths = [LINE if k < len(EVIDENCE_COLORS) else THIN for k in range(len(channels))]
    return [("all", ALL_TOGETHER, THICK), *zip(channels, colors, widths, strict=True)]


def top_path(paths: RunPaths, quantity: str) -> str:
    """Give the entity of the unseen point that a plot's scale reaches up to."""
    return f"{paths.trace(quantity)}/top"


@dataclass(slots=True)
class Traces:
    """Logs values, and in the end lets the scales of plots reach a round number.

    In a small plot that ends between 4 and 10 of anything the viewer labels nothing but zero.
    """

    paths: RunPaths
    _most: dict[str, float] = field(default_factory=dict)

    def log(self, rec: rr.RecordingStream, quantity: str, value: float) -> None:
        """Log one value of a quantity."""
        self._most[quantity] = max(value, self._most.get(quantity, 0.0))
        rec.log(self.paths.trace(quantity), rr.Scalars(value))

    def draw_tops(self, rec: rr.RecordingStream) -> None:
        """Log the tops, at the end of a run: only then is the largest value known."""
        for quantity, most in self._most.items():
            if quantity in LABELED_STEPS:
                top = round_top(most, LABELED_STEPS[quantity])
                rec.log(top_path(self.paths, quantity), rr.Scalars(top))


def round_top(most: float, steps: float) -> float:
    """Give the power of ten above a value that is more than so many of the one below; else the value."""
    if not 0 < most < np.inf:
        return 0.0
    below = 10.0 ** np.floor(np.log10(most))
    return float(10 * below if most > steps * below else most)


def draw_traces(
    rec: rr.RecordingStream, traces: Traces, record: StepRecord, truth: F64 | None, scale: Scale
) -> None:
    """Log one value a line; errors only where the truth is known."""
    if truth is not None:
        apart, angle = errors(record.estimate, truth)
        traces.log(rec, POSITION_ERROR, scale.length(apart))
        traces.log(rec, HEADING_ERROR, float(np.degrees(angle)))
    traces.log(rec, SPREAD, scale.length(float(np.hypot(*record.mean_estimate.sd_m))))
    traces.log(rec, EFFECTIVE, record.effective_sample_size / record.weighted.size)
    traces.log(rec, CONFIDENCE, record.estimate.confidence)


def draw_inside(rec: rr.RecordingStream, paths: RunPaths, record: StepRecord, ancestors: int) -> None:
    """Log shares of survivors and of ancestors, and the evidence of each channel."""
    rec.log(paths.trace(SURVIVORS), rr.Scalars(survivors(record)))
    rec.log(paths.trace(ANCESTORS), rr.Scalars(ancestors / record.belief.size))
    nats = np.append(record.calibrated_evidence, record.channel_evidence)
    if np.isfinite(nats).all():  # -inf when no particle was in free space
        rec.log(paths.trace(EVIDENCE), rr.Scalars(nats))


def draw_truth_seen(
    rec: rr.RecordingStream, paths: RunPaths, record: StepRecord, truth: F64, places: EntryFinder
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
