"""Cards and bars of explanations: a reference's picture over its edges, and descriptors in one row of bars.

A block of bars stands for one reference; in it the channels follow one another, each 1 wide along x. Long
descriptors are grouped, so that a block has at most `MOST` bars however many channels there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arrays import F32, F64, I32, U8
from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.sensor.descriptors.edges import edge_image

from ..drawing.contact_sheet import KEPT, NOT_KEPT, thumbnail_of
from ..drawing.raster import jpeg, put_text, text_size
from ..style import GROUND, MISSING, PALE
from .histograms import SMALLEST, USUAL, usual_height
from .pictures import brightened

# Descriptors of several channels in one row of bars, short enough to be logged at every update.

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


# Cards: a reference's picture over its edge picture, as one small JPEG that is kept once it was made.

CARD_PX = 120  # width: with 144 px three of them were 16 kB an update
GAP_PX = 4  # between picture and edges
QUALITY = 60  # 3.8 kB a card; edges are most of it
TEXT_PX = 9.0


def card_height(cell_height: int, cell_width: int) -> int:
    """Give the height of one picture of a card, from the shape that thumbnails of this library have."""
    return max(1, round(CARD_PX * cell_height / cell_width))


@lru_cache(maxsize=KEPT)
def card_of(path: Path | None, cell_height: int, height: int) -> bytes:
    """Give the card of a reference's picture; gray with words on it where the picture is not to be had."""
    thumbnail = None if path is None else thumbnail_of(path, cell_height)
    if thumbnail is None:
        return blank_card(height, NOT_KEPT)
    picture = np.asarray(cv2.resize(thumbnail, (CARD_PX, height), interpolation=cv2.INTER_AREA), np.uint8)
    return jpeg(_stacked(picture, brightened(edge_image(picture))), QUALITY)


@lru_cache(maxsize=8)
def blank_card(height: int, words: str) -> bytes:
    """Give a card without a picture that says why."""
    gray = np.full((height, CARD_PX, 3), MISSING, np.uint8)
    width, _ = text_size(words, TEXT_PX)
    small = min(TEXT_PX, TEXT_PX * (CARD_PX - 6) / max(width, 1))
    worded = gray.copy()
    put_text(worded, words, 3, height / 2 + small / 2, small, PALE)
    return jpeg(_stacked(worded, gray), QUALITY)


def _stacked(picture: U8, edges: U8) -> U8:
    between = np.full((GAP_PX, picture.shape[1], 3), GROUND, np.uint8)
    return np.concatenate([picture, between, edges])
