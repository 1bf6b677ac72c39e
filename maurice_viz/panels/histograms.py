"""Histograms: the picture's over that of its best match, and how much each bin adds to the distance.

Static bands behind the bars separate red, green and blue, and fix the height, so that steps can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import contributions

from ..drawing.bars import (
    REFERENCE,
    REFERENCE_BAR,
    SAMPLE,
    SAMPLE_BAR,
    bands_of,
    place_bars,
    tensor_of,
    usual_difference,
    usual_height,
)
from ..entities import Phase, RunPaths
from ..style import BAR
from .panel import Panel, StepUpdate, set_phase
from .views import bars_view

KINDS = ("sample", "reference", "difference")
LEGEND = ": picture blue, match orange, both pale"
SHORT_LEGEND = ", match orange"


class HistogramsPanel(Panel):
    """Draws for each channel the picture's descriptor, its best match's, and what each element adds to D."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        for channel, distance in self._run.distances.items():
            index = self._library.index[channel]
            bins = len(index.relevance)
            self._place_bands(rec, channel, "bands", bins, usual_height(index))
            self._place_bands(rec, channel, "difference_bands", bins, usual_difference(index, distance))
            one = len(bands_of(bins)) / bins
            for kind, color, offset, width in (
                ("reference", REFERENCE, *REFERENCE_BAR),
                ("sample", SAMPLE, *SAMPLE_BAR),
                ("difference", BAR, 0.0, 1.0),
            ):
                path, lefts = self._paths.histogram(channel, kind), (np.arange(bins) + offset) * one
                place_bars(rec, path, color, lefts, np.full(bins, width * one))

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        comparison = update.record.sighting.comparison
        if not update.whole or not len(comparison.quality):
            return
        set_phase(rec, update.moment, Phase.MEASURE)
        best = int(comparison.quality.argmax())
        for channel in comparison.channels:
            sample, index = comparison.descriptors[channel], self._library.index[channel]
            reference = index.references[best]
            difference = contributions(self._run.distances[channel], sample, reference, index)
            for kind, values in zip(KINDS, (sample, reference, difference), strict=True):
                rec.log(
                    self._paths.histogram(channel, kind), rr.BarChart.from_fields(values=tensor_of(values))
                )

    def clear(self, rec: rr.RecordingStream) -> None:
        rec.log(self._paths.at("histogram"), rr.Clear(recursive=True))

    def _place_bands(self, rec: rr.RecordingStream, channel: str, kind: str, bins: int, top: float) -> None:
        for plane, color in enumerate(bands_of(bins)):
            band = rr.BarChart([top], abscissa=[float(plane)], widths=[1.0], color=color)
            rec.log(self._paths.histogram(channel, f"{kind}/{plane}"), band, static=True)


def histogram_views(paths: RunPaths, channels: Sequence[str], legend: str = LEGEND) -> list[rrb.BarChartView]:
    """Show the picture's histogram over its best match's; the legend stands in the first tab's title."""
    titles = [f"{c} ({CHANNELS[c].unit}){legend}" if k == 0 else c for k, c in enumerate(channels)]
    return [_view(paths, c, t, "bands", "reference", "sample") for c, t in zip(channels, titles, strict=True)]


def difference_views(paths: RunPaths, channels: Sequence[str]) -> list[rrb.BarChartView]:
    """Show what each element adds to the distance D from the best match, one view per channel."""
    titles = [f"{c}, D" if k else f"{c}, D: what each element adds to it" for k, c in enumerate(channels)]
    return [
        _view(paths, c, t, "difference_bands", "difference") for c, t in zip(channels, titles, strict=True)
    ]


def _view(paths: RunPaths, channel: str, title: str, *kinds: str) -> rrb.BarChartView:
    return bars_view(title[0].upper() + title[1:], [paths.histogram(channel, kind) for kind in kinds])
