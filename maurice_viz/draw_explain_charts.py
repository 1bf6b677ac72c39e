"""Charts of explanations at every update: all references in one row of bars, a block a reference.

A chart has one color, so channels are told apart by tints behind the bars, in the order of the table.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from maurice_mcl.explaining import StepExplanation
from maurice_mcl.typing import F32, F64

from .draw_histograms import REFERENCE, REFERENCE_BAR, SAMPLE, SAMPLE_BAR
from .entities import RunPaths
from .explanation_bars import Bars
from .explanation_paths import KINDS, Column, chart_path
from .look import BAR, RGB, TINTS
from .tensors import tensor_of

FOOT_NATS = 0.3  # height of the tints in the chart of costs; higher bars make the chart grow


def prepare_charts(rec: rr.RecordingStream, paths: RunPaths, bars: Bars, blocks: int) -> None:
    """Log what does not change: tints, colors, and where the bars stand."""
    for kind, height in (("tints", 1.0), ("feet", FOOT_NATS)):
        for number in range(len(bars.channels)):
            band = rr.BarChart(
                np.full(blocks, height, np.float32),
                abscissa=np.array([bars.left_of(block) + number for block in range(blocks)], np.float32),
                widths=np.ones(blocks, np.float32),
                color=TINTS[number % len(TINTS)],
            )
            rec.log(f"{chart_path(paths, kind)}/{number}", band, static=True)
    lefts = np.concatenate([bars.lefts + bars.left_of(block) for block in range(blocks)])
    widths = np.tile(bars.widths, blocks)
    for kind, color, offset, width in (
        ("reference", REFERENCE, *REFERENCE_BAR),
        ("sample", SAMPLE, *SAMPLE_BAR),
        ("cost", BAR, 0.0, 1.0),
    ):
        _place_bars(rec, chart_path(paths, kind), color, lefts + offset * widths, width * widths)


def draw_charts(
    rec: rr.RecordingStream, paths: RunPaths, bars: Bars, step: StepExplanation, blocks: Sequence[Column]
) -> None:
    """Log for each reference its descriptors, under those of the picture, and what each element costs."""
    sample = bars.heights([channel.sample for channel in step.winner.channels])
    heights = [_block(bars, column) for column in blocks]
    shown = (
        np.tile(sample, len(blocks)),
        np.concatenate([reference for reference, _ in heights]),
        np.concatenate([cost for _, cost in heights]),
    )
    for kind, values in zip(KINDS, shown, strict=True):
        rec.log(chart_path(paths, kind), rr.BarChart.from_fields(values=tensor_of(values)))


def _block(bars: Bars, column: Column) -> tuple[F32, F32]:
    """Give heights of one reference's descriptors and costs; none where there is no reference."""
    _, explained = column
    if explained is None or explained.entry is None:
        nothing = np.zeros(len(bars.starts), np.float32)
        return nothing, nothing
    channels = explained.entry.channels
    costs = bars.divided([c.loses for c in channels], [c.contributions for c in channels])
    return bars.heights([c.reference for c in channels]), costs


def _place_bars(rec: rr.RecordingStream, path: str, color: RGB, lefts: F64, widths: F64) -> None:
    chart = rr.BarChart(
        np.zeros(len(lefts), np.float32),
        color=color,
        abscissa=np.asarray(lefts, np.float32),
        widths=np.asarray(widths, np.float32),
    )
    # all but the values: static values would hide all later ones, and from_fields() insists on values
    style = [
        part
        for part in chart.as_component_batches()
        if not part.component_descriptor().component.endswith("values")
    ]
    rec.log(path, style, static=True)
