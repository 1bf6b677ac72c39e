"""Bar charts: their heights and their grounds.

A chart has one color, so red, green and blue are distinguished by three static bands behind the bars. Each is
1 wide along x: red from 0 to 1, green to 2, blue to 3, and each runs over the values 16 to 240.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.library import ChannelIndex

from ..style import CHANNEL_COLORS, PLAIN, RED_GREEN_BLUE, RGB, RGBA

PLANES = 3  # red, green, blue: equal thirds of a descriptor
USUAL_PERCENTILE = (
    99.5  # percentile of all library bins that the bands reach up to; a higher bar makes the chart grow
)
LEAST_HEIGHT = 1e-6  # a band of no height could not be seen
REFERENCE_BAR, SAMPLE_BAR = (0.0, 1.0), (0.25, 0.5)  # where in a bin they begin, and how wide they are


def channel_color(channel: str) -> RGB:
    """Return the color of a sensor channel: the same in every run; after the ninth channel they repeat."""
    known = list(CHANNELS)
    return CHANNEL_COLORS[(known.index(channel) if channel in known else 0) % len(CHANNEL_COLORS)]


def place_bars(
    rec: rr.RecordingStream, path: str, color: RGB, lefts: NDArray[Any], widths: NDArray[Any]
) -> None:
    """Log where the bars of a chart stand, static; their values come later."""
    at, wide = np.asarray(lefts, np.float32), np.asarray(widths, np.float32)
    parts = rr.BarChart(np.zeros(len(at), np.float32), color=color, abscissa=at, widths=wide)
    # all but the values: static values would hide all later ones, and from_fields() insists on values
    kept = [
        p for p in parts.as_component_batches() if not p.component_descriptor().component.endswith("values")
    ]
    rec.log(path, kept, static=True)


def usual_height(index: ChannelIndex) -> float:
    """Return a height that nearly all bins of the library stay under."""
    return max(float(np.percentile(index.references, USUAL_PERCENTILE)), LEAST_HEIGHT)


def bands_of(bins: int) -> tuple[RGBA, ...]:
    """Return one band per color if each color has 28 bins, else a single band."""
    return RED_GREEN_BLUE if bins == PLANES * BINS else (PLAIN,)
