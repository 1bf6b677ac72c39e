"""Histograms: the picture's over that of its best match, and how much each bin adds to the distance.

The picture's bars are narrower and stand over the reference's: where they cover each other the viewer mixes
their colors, to a pale one in its dark theme and a dull one in its light theme. A chart has one color, so
red, green and blue are told apart by three static bands behind the bars. Each is 1 wide along x: red from 0
to 1, green to 2, blue to 3, and each runs over the values 16 to 240. The bands also fix the height of the
chart, so that steps can be compared.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.records import Comparison
from maurice_mcl.sensor.descriptors.histogram import BINS
from maurice_mcl.sensor.distances import DISTANCES, contributions

from ..drawing.arrow import tensor_of
from ..entities import RunPaths
from ..style import BAR, PLAIN, RED_GREEN_BLUE, RGB, RGBA, RUN_COLORS

PLANES = 3  # red, green, blue: equal thirds of a descriptor
REFERENCE, SAMPLE = RUN_COLORS[:2]
USUAL = 99.5  # percentile of all library bins that the bands reach up to; a higher bar makes the chart grow
SMALLEST = 1e-6  # a band of no height could not be seen
MOST_COMPARED = 100  # references that say how high differences are
KINDS = ("sample", "reference", "difference")
REFERENCE_BAR, SAMPLE_BAR = (0.0, 1.0), (0.25, 0.5)  # where in a bin they begin, and how wide they are


def prepare_histograms(
    rec: rr.RecordingStream, paths: RunPaths, distances: Mapping[str, str], library: Library
) -> None:
    """Log what does not change: bands, colors, and where the bars stand; `distances` by channel."""
    for channel, distance in distances.items():
        index = library.index[channel]
        bins = len(index.relevance)
        _bands(rec, paths, channel, "bands", bins, usual_height(index))
        _bands(rec, paths, channel, "difference_bands", bins, usual_difference(index, distance))
        _bars(rec, paths.histogram(channel, "reference"), REFERENCE, bins, *REFERENCE_BAR)
        _bars(rec, paths.histogram(channel, "sample"), SAMPLE, bins, *SAMPLE_BAR)
        _bars(rec, paths.histogram(channel, "difference"), BAR, bins, 0.0, 1.0)


def usual_height(index: ChannelIndex) -> float:
    """Give a height that nearly all bins of the library stay under."""
    return max(float(np.percentile(index.references, USUAL)), SMALLEST)


def usual_difference(index: ChannelIndex, distance: str) -> float:
    """Give a height that nearly all elements stay under, from a reference to the other most like it.

    A picture is drawn against its best match; two references of any kind would be many times as far apart.
    """
    count = len(index.references)
    if count < 2:
        return 1.0
    parts = []
    for k in np.linspace(0, count - 1, min(count, MOST_COMPARED)).astype(int):
        apart = DISTANCES[distance](index.references[k], index)
        apart[k] = np.inf
        best = index.references[apart.argmin()]
        parts.append(contributions(distance, index.references[k], best, index))
    return max(float(np.percentile(parts, USUAL)), SMALLEST)


def bands_of(bins: int) -> tuple[RGBA, ...]:
    """Give a band each for red, green and blue where there are 28 bins of each, else one for everything."""
    return RED_GREEN_BLUE if bins == PLANES * BINS else (PLAIN,)


def _bands(
    rec: rr.RecordingStream, paths: RunPaths, channel: str, kind: str, bins: int, height: float
) -> None:
    for plane, color in enumerate(bands_of(bins)):
        band = rr.BarChart([height], abscissa=[float(plane)], widths=[1.0], color=color)
        rec.log(paths.histogram(channel, f"{kind}/{plane}"), band, static=True)


def _bars(rec: rr.RecordingStream, path: str, color: RGB, bins: int, offset: float, width: float) -> None:
    """Place the bars; `offset` and `width` are shares of a bin."""
    one = len(bands_of(bins)) / bins
    at = ((np.arange(bins) + offset) * one).astype(np.float32)
    wide = np.full(bins, width * one, np.float32)
    chart = rr.BarChart(np.zeros(bins, np.float32), color=color, abscissa=at, widths=wide)
    # all but the values: static values would hide all later ones, and from_fields() insists on values
    style = [
        part
        for part in chart.as_component_batches()
        if not part.component_descriptor().component.endswith("values")
    ]
    rec.log(path, style, static=True)


def draw_histograms(
    rec: rr.RecordingStream,
    paths: RunPaths,
    comparison: Comparison,
    library: Library,
    distances: Mapping[str, str],
) -> None:
    """Log for each channel the picture's vector, its best match's, and what each element adds to D.

    `distances` names the distance that each channel is compared by.
    """
    best = int(comparison.quality.argmax())
    for channel in comparison.channels:
        sample, index = comparison.descriptors[channel], library.index[channel]
        reference = index.references[best]
        shown = (sample, reference, contributions(distances[channel], sample, reference, index))
        for kind, values in zip(KINDS, shown, strict=True):
            rec.log(paths.histogram(channel, kind), rr.BarChart.from_fields(values=tensor_of(values)))
