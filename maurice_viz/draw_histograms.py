"""Histograms: the picture's over that of its best match, and how much each bin adds to the distance.

A chart has one color, so red, green and blue are told apart by three static bands behind the bars. Each is
1 wide along x: red from 0 to 1, green to 2, blue to 3, and each runs over the values 16 to 240. The bands
also fix the height of the chart, so that steps can be compared.
"""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.records import Sighting
from maurice_mcl.sensor import contributions
from maurice_mcl.typing import F32

from .entities import RunPaths
from .look import PALE, RGB
from .tensors import tensor_of

PLANES = 3  # red, green, blue: equal thirds of a descriptor
BANDS: tuple[RGB, RGB, RGB] = ((64, 22, 20), (18, 50, 26), (22, 34, 76))
SAMPLE: RGB = (255, 255, 255)
REFERENCE: RGB = (230, 159, 0)
USUAL = 99.5  # percentile of all library bins that the bands reach up to; a higher bar makes the chart grow
USUAL_DIFFERENCE = 0.1
KINDS = ("sample", "reference", "difference")


def prepare_histograms(
    rec: rr.RecordingStream, paths: RunPaths, channels: tuple[str, ...], library: Library
) -> None:
    """Log what does not change: bands, colors, and where the bars stand."""
    for channel in channels:
        index = library.index[channel]
        bins = len(index.relevance)
        _bands(rec, paths, channel, "bands", usual_height(index))
        _bands(rec, paths, channel, "difference_bands", USUAL_DIFFERENCE)
        _bars(rec, paths.histogram(channel, "reference"), REFERENCE, bins, 0.0, 1.0)
        _bars(rec, paths.histogram(channel, "sample"), SAMPLE, bins, 0.3, 0.4)
        _bars(rec, paths.histogram(channel, "difference"), PALE, bins, 0.0, 1.0)


def usual_height(index: ChannelIndex) -> float:
    """Give a height that nearly all bins of the library stay under."""
    return max(float(np.percentile(index.references, USUAL)), 1.0)


def _bands(rec: rr.RecordingStream, paths: RunPaths, channel: str, kind: str, height: float) -> None:
    for plane, color in enumerate(BANDS):
        band = rr.BarChart([height], abscissa=[float(plane)], widths=[1.0], color=color)
        rec.log(paths.histogram(channel, f"{kind}/{plane}"), band, static=True)


def _bars(rec: rr.RecordingStream, path: str, color: RGB, bins: int, offset: float, width: float) -> None:
    """Place the bars; `offset` and `width` are shares of a bin."""
    one = PLANES / bins
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


def draw_histograms(rec: rr.RecordingStream, paths: RunPaths, sighting: Sighting, library: Library) -> None:
    """Log for each channel the picture's histogram, its best match's, and their difference bin by bin."""
    best = int(sighting.quality.argmax())
    for channel in sighting.channels:
        sample, index = sighting.descriptors[channel], library.index[channel]
        shown = (sample, index.references[best], bin_differences(sample, index.references[best], index))
        for kind, values in zip(KINDS, shown, strict=True):
            rec.log(paths.histogram(channel, kind), rr.BarChart.from_fields(values=tensor_of(values)))


def bin_differences(sample: F32, reference: F32, index: ChannelIndex) -> F32:
    """Give the thesis's difference of every bin (D,), max(|s - r| - n, 0) / m; its mean is the distance."""
    return contributions(sample, reference, index) * np.float32(len(sample))
