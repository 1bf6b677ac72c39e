"""Bar charts: their heights, their grounds, and descriptors of several channels in one row of bars.

A chart has one color, so red, green and blue are distinguished by three static bands behind the bars. Each is
1 wide along x: red from 0 to 1, green to 2, blue to 3, and each runs over the values 16 to 240.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import rerun as rr
from numpy.typing import NDArray
from rerun.components import TensorDataBatch

from maurice_mcl.arrays import F32, F64, I32
from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.sensor.descriptors.channel import BINS
from maurice_mcl.sensor.distances import DISTANCES, contributions

from ..style import PLAIN, RED_GREEN_BLUE, RGB, RGBA, RUN_COLORS

_POINT = pa.field("item", pa.float32(), nullable=False)
_STRIP = pa.field("item", pa.list_(_POINT, 2), nullable=False)


def strips_of(lines: Sequence[F32] | F32) -> Any:
    """Return lines (M, K, 2), or M lines (K_i, 2), as `LineStrips2D.from_fields` takes them unchanged."""
    points = np.concatenate(lines) if len(lines) else np.zeros((0, 2), np.float32)
    ends = np.cumsum([0, *(len(line) for line in lines)], dtype=np.int32)
    numbers = pa.array(np.ascontiguousarray(points, np.float32).ravel())
    pairs = pa.FixedSizeListArray.from_arrays(numbers, type=pa.list_(_POINT, 2))
    return pa.ListArray.from_arrays(pa.array(ends), pairs, type=pa.list_(_STRIP))


KIND = "F32"  # the union's name for float32


@lru_cache(maxsize=16)
def _mold(length: int) -> tuple[Any, list[Any], int]:
    """Let Rerun build a tensor of this length once: return it, its kinds of numbers, and which is float32."""
    tensor = TensorDataBatch(np.zeros(length, np.float32)).as_arrow_array()
    union = tensor.field(2)
    names = [union.type.field(k).name for k in range(union.type.num_fields)]
    return tensor, [union.field(k) for k in range(len(names))], names.index(KIND)


def tensor_of(values: F32) -> Any:
    """Return a vector (D,) as the Arrow array that `rr.BarChart.from_fields(values=...)` takes unchanged.

    Six times quicker than Rerun (28 against 173 microseconds): all but the numbers is built once a length.
    """
    tensor, kinds, at = _mold(len(values))
    data = pa.py_buffer(np.ascontiguousarray(values, np.float32))
    numbers = pa.Array.from_buffers(pa.float32(), len(values), [None, data])
    hole = kinds[at]
    filled = pa.Array.from_buffers(hole.type, 1, hole.buffers()[:2], children=[numbers])
    shape, names, buffer = (tensor.field(k) for k in range(3))
    children = [*kinds[:at], filled, *kinds[at + 1 :]]
    union = pa.Array.from_buffers(buffer.type, 1, buffer.buffers()[:3], children=children)
    return pa.Array.from_buffers(tensor.type, 1, [None], children=[shape, names, union])


PLANES = 3  # red, green, blue: equal thirds of a descriptor
REFERENCE, SAMPLE = RUN_COLORS[:2]
USUAL = 99.5  # percentile of all library bins that the bands reach up to; a higher bar makes the chart grow
SMALLEST = 1e-6  # a band of no height could not be seen
MOST_COMPARED = 100  # references from which the usual height of differences is taken
REFERENCE_BAR, SAMPLE_BAR = (0.0, 1.0), (0.25, 0.5)  # where in a bin they begin, and how wide they are


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
    return max(float(np.percentile(index.references, USUAL)), SMALLEST)


def usual_difference(index: ChannelIndex, distance: str) -> float:
    """Return a height that nearly all elements stay under, from a reference to the other most like it."""
    count = len(index.references)
    if count < 2:
        return 1.0
    parts = []
    for k in np.linspace(0, count - 1, min(count, MOST_COMPARED)).astype(int):
        differences = DISTANCES[distance](index.references[k], index)
        differences[k] = np.inf
        best = index.references[differences.argmin()]
        parts.append(contributions(distance, index.references[k], best, index))
    return max(float(np.percentile(parts, USUAL)), SMALLEST)


def bands_of(bins: int) -> tuple[RGBA, ...]:
    """Return one band per color if each color has 28 bins, else a single band."""
    return RED_GREEN_BLUE if bins == PLANES * BINS else (PLAIN,)


MOST = 240  # bars of a block
GAP = 0.3  # between blocks, in widths of a channel


@dataclass(frozen=True, slots=True, eq=False)
class Bars:
    """How the descriptors of C channels become the E bars of a block."""

    channels: tuple[str, ...]
    starts: I32  # (E,) first element of each bar, in all channels' descriptors end to end
    firsts: I32  # (C,) first bar of each channel
    counts: I32  # (C,) bars of each channel
    shares: F32  # (E,) one over elements in the bar and the channel's usual span: drawn 1 high
    bottoms: F32  # (E,) height that nearly all of the channel's elements stay over, drawn at 0
    lefts: F64  # (E,) left edge along x, in a block that begins at 0
    widths: F64  # (E,)

    def heights(self, descriptors: Sequence[F32]) -> F32:
        """Return means (E,) of groups of elements of C descriptors, in shares of the usual span."""
        means = np.add.reduceat(np.concatenate(descriptors), self.starts) * self.shares
        return np.asarray(means - self.bottoms, np.float32)

    def divided(self, amounts: Sequence[float], parts: Sequence[F32]) -> F32:
        """Divide each channel's amount (C) among its bars (E,), in proportion to its elements' parts (D,)."""
        sums = np.add.reduceat(np.concatenate(parts), self.starts)
        totals = np.add.reduceat(sums, self.firsts)
        each = np.divide(amounts, totals, out=np.zeros(len(totals)), where=totals > 0)
        return np.asarray(sums * each.repeat(self.counts), np.float32)

    def left_of(self, block: int) -> float:
        """Return where a block begins along x."""
        return block * (len(self.channels) + GAP)


def bars_for(channels: tuple[str, ...], library: Library) -> Bars:
    """Group the descriptors of these channels, as long as the library has them."""
    starts, sizes, shares, bottoms = list[F64](), list[F64](), list[F64](), list[F64]()
    begin = 0
    most = max(MOST // len(channels), 1)
    for channel in channels:
        index = library.index[channel]
        size = index.references.shape[1]
        edges = np.append(np.arange(0, size, -(-size // most)), size)
        low, span = usual_span(index)
        starts.append(begin + edges[:-1])
        sizes.append(np.diff(edges) / size)
        shares.append(1 / (np.diff(edges) * span))
        bottoms.append(np.full(len(edges) - 1, low / span))
        begin += size
    counts = np.array([len(some) for some in starts], np.int32)
    lefts = [number + np.cumsum(some) - some for number, some in enumerate(sizes)]
    return Bars(
        channels=channels,
        starts=np.concatenate(starts).astype(np.int32),
        firsts=(np.cumsum(counts) - counts).astype(np.int32),
        counts=counts,
        shares=np.concatenate(shares).astype(np.float32),
        bottoms=np.concatenate(bottoms).astype(np.float32),
        lefts=np.concatenate(lefts),
        widths=np.concatenate(sizes),
    )


def usual_span(index: ChannelIndex) -> tuple[float, float]:
    """Return what nearly all elements of the library stay over, and how far above it nearly all end."""
    low = float(np.percentile(index.references, 100 - USUAL))
    return low, max(usual_height(index) - low, SMALLEST)
