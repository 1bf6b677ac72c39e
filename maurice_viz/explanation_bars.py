"""Descriptors of several channels in one row of bars, short enough to be logged at every update.

A block of bars stands for one reference; in it the channels follow one another, each 1 wide along x. Long
descriptors are grouped, so that a block has at most `MOST` bars however many channels there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.typing import F32, F64, I32

from .draw_histograms import SMALLEST, USUAL, usual_height

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
        """Give means (E,) of each group of C descriptors' elements, in shares of the channel's usual span."""
        means = np.add.reduceat(np.concatenate(descriptors), self.starts) * self.shares
        return np.asarray(means - self.bottoms, np.float32)

    def divided(self, amounts: Sequence[float], parts: Sequence[F32]) -> F32:
        """Divide each channel's amount (C) among its bars (E,), in proportion to its elements' parts (D,)."""
        sums = np.add.reduceat(np.concatenate(parts), self.starts)
        totals = np.add.reduceat(sums, self.firsts)
        each = np.divide(amounts, totals, out=np.zeros(len(totals)), where=totals > 0)
        return np.asarray(sums * each.repeat(self.counts), np.float32)

    def left_of(self, block: int) -> float:
        """Give where a block begins along x."""
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
    """Give what nearly all elements of the library stay over, and how far above it nearly all end."""
    low = float(np.percentile(index.references, 100 - USUAL))
    return low, max(usual_height(index) - low, SMALLEST)
