"""What a reference loses, as one drawing: nats by channel as a stacked bar, over a small chart per channel.

A small chart has the reference's descriptor filled in orange under the picture's blue line, its name on the
axis, and below it what each element costs. Two-dimensional histograms are heat maps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.analysis.explanation import ChannelExplanation, EntryExplanation
from maurice_mcl.arrays import F32, F64, I32, U8

from ..style import BAR, EMPTY, GROUND, PALE, RGB, RUN_COLORS
from .bars import REFERENCE, SAMPLE, SMALLEST, bands_of
from .canvas import blank, paint, put_text, text_size
from .heat import grid_of, heat_of, place_heat

CHART_PX = (288, 260)  # width and height, in a recording of many updates
BAR_SHARE = 0.2  # of the height, with the axis below it
TEXT_SHARE = 0.034  # height of capitals, of the width
COST_SHARE = 0.32  # of a small chart's height: what each element costs
SEGMENTS: tuple[RGB, ...] = (*RUN_COLORS[2:], (182, 90, 62), (112, 112, 205))  # of channels, in turn
TICKS = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # nats between two marks of the axis
MOST_MARKS = 5


@dataclass(frozen=True, slots=True)
class ChartScale:
    """What all charts of an update share, so that they can be compared."""

    nats: float  # where the axis of the stacked bars ends
    spans: tuple[tuple[float, float], ...]  # lowest and highest element of each channel
    costs: tuple[float, ...]  # most nats of an element of each channel


def scale_of(entries: Sequence[EntryExplanation]) -> ChartScale:
    """Return the scale of the charts of some references at one update."""
    by_channel = list(zip(*(entry.channels for entry in entries), strict=True))
    spans, costs = [], []
    for found in by_channel:
        both = np.concatenate([part for c in found for part in (c.sample, c.reference)])
        low = min(float(both.min()), 0.0)
        spans.append((low, max(float(both.max()), low + SMALLEST)))
        costs.append(max(SMALLEST, *(float(c.nats.max()) for c in found)))
    nats = max(sum(c.loses for c in entry.channels) for entry in entries)
    return ChartScale(max(nats, 1.0), tuple(spans), tuple(costs))


def draw_reference_chart(
    entry: EntryExplanation | None, scale: ChartScale, size: tuple[int, int] = CHART_PX
) -> U8:
    """Draw (H, W, 3) what a reference loses; empty without a reference."""
    width, height = size
    image = blank(height, width, GROUND)
    if entry is None:
        return image
    under = round(BAR_SHARE * height)
    _draw_bar(image[:under], entry, scale.nats)
    count = len(entry.channels)
    columns = math.ceil(math.sqrt(count))
    rows = -(-count // columns)
    for number, channel in enumerate(entry.channels):
        row, column = divmod(number, columns)
        top, left = under + row * (height - under) // rows, column * width // columns
        end, right = under + (row + 1) * (height - under) // rows, (column + 1) * width // columns
        part = image[top:end, left + 4 : right - 4]
        _draw_channel(part, channel, number, scale, TEXT_SHARE * width)
    return image


def _draw_bar(image: U8, entry: EntryExplanation, most: float) -> None:
    """Draw the nats of all channels end to end, over an axis."""
    height, width = image.shape[:2]
    text = TEXT_SHARE * width
    end = width - 4 - 3.2 * text
    low, high = round(0.12 * height), round(0.12 * height + 2.1 * text)
    at = 4.0
    for number, channel in enumerate(entry.channels):
        after = at + channel.loses / most * (end - 4)
        color = color_of(number)
        image[low:high, round(at) : round(after)] = color
        label = f"{channel.channel} {channel.loses:.1f}"
        for said in (label, channel.channel):
            if text_size(said, 0.9 * text)[0] < after - at - 4:
                put_text(image, said, at + 3, high - 0.6 * text, 0.9 * text, GROUND)
                break
        at = after
    total = sum(channel.loses for channel in entry.channels)
    put_text(image, f"{total:.1f}", at + 4, high - 0.6 * text, text, PALE)
    step = next((t for t in TICKS if most / t <= MOST_MARKS), TICKS[-1])
    image[high + 2 : high + 3, 4 : round(end)] = PALE
    marks = np.arange(0, most + 1e-9, step)
    for mark in marks.tolist():
        x = 4 + mark / most * (end - 4)
        image[high + 2 : high + 6, round(x) : round(x) + 1] = PALE
        said = f"{mark:g} nats" if mark == marks[-1] else f"{mark:g}"
        put_text(image, said, max(x - 0.4 * text, 0), high + 7 + 0.9 * text, 0.85 * text, PALE)


def color_of(number: int) -> RGB:
    """Return the color of a channel's part of the bar and of its name."""
    return SEGMENTS[number % len(SEGMENTS)]


def _draw_channel(image: U8, found: ChannelExplanation, number: int, scale: ChartScale, text: float) -> None:
    """Draw one channel: descriptors, what each element costs, and its name on the axis."""
    height, width = image.shape[:2]
    name = found.channel
    small = min(text, text * width / max(text_size(name, text)[0], 1))
    under = round(height - 1.9 * text)
    put_text(image, name, (width - text_size(name, small)[0]) / 2, height - 0.45 * text, small, _name(number))
    grid = grid_of(name, len(found.sample))
    if grid is not None:
        _, most = scale.spans[number]
        amounts = (found.sample, found.reference, found.nats)
        tops = (most, most, scale.costs[number])
        colors = (SAMPLE, REFERENCE, BAR)
        maps = [heat_of(a.reshape(grid), t, c) for a, t, c in zip(amounts, tops, colors, strict=True)]
        place_heat(image[:under], maps)
        return
    split = round((1 - COST_SHARE) * under)
    draw_levels(image[: split - 2], found.sample, found.reference, scale.spans[number])
    _draw_costs(image[split:under], found.nats, scale.costs[number])


def _name(number: int) -> RGB:
    red, green, blue = (min(255, part + 40) for part in color_of(number))
    return red, green, blue


def draw_levels(image: U8, sample: F32, reference: F32, span: tuple[float, float]) -> None:
    """Draw a descriptor (D,) filled, and another one as a line over it, on grounds of their colors."""
    height, width = image.shape[:2]
    grounds = _grounds(len(sample))
    for k, color in enumerate(grounds):
        first, last = k * width // len(grounds), (k + 1) * width // len(grounds) - 1
        cv2.rectangle(image, (first, 0), (last, height), color, cv2.FILLED)
    low, high = span
    rows = np.arange(height)[:, None]
    zero = _row(np.zeros(1), low, high, height)
    filled = _row(_by_pixel(reference, width), low, high, height)
    paint(image, (rows >= np.minimum(filled, zero)) & (rows < np.maximum(filled, zero)), REFERENCE)
    line = _row(_by_pixel(sample, width), low, high, height)
    points = np.column_stack([np.arange(width), np.minimum(line, height - 1)]).astype(np.int32)
    cv2.polylines(image, [points], False, SAMPLE, max(2, round(width / 110)))


@lru_cache(maxsize=16)
def _grounds(bins: int) -> tuple[RGB, ...]:
    """Return the colors behind a descriptor's elements, from left to right."""
    empty = np.array(EMPTY)
    mixed = [empty + (np.array(color) - empty) * alpha / 255 * 0.8 for *color, alpha in bands_of(bins)]
    return tuple((int(red), int(green), int(blue)) for red, green, blue in mixed)


def _draw_costs(image: U8, nats: F32, most: float) -> None:
    height, width = image.shape[:2]
    cv2.rectangle(image, (0, 0), (width, height), EMPTY, cv2.FILLED)
    paint(image, np.arange(height)[:, None] >= _row(_by_pixel(nats, width), 0.0, most, height), BAR)


def _by_pixel(values: F32, width: int) -> F64:
    """Return for each column of pixels (W,) its element, or the largest of its elements."""
    count = len(values)
    if count <= width:
        return np.asarray(values[np.arange(width) * count // width], np.float64)
    starts = np.arange(width) * count // width
    return np.asarray(np.maximum.reduceat(values, starts), np.float64)


def _row(values: F64, low: float, high: float, height: int) -> I32:
    """Return the row of pixels of each value, 0 at the top."""
    return np.asarray((high - values) / (high - low) * height, np.float64).round().astype(np.int32)


def draw_chart_key(size: tuple[int, int] = CHART_PX) -> U8:
    """Draw what the marks of a chart mean, as large as a chart."""
    width, height = size
    image = blank(height, width, GROUND)
    text = 1.1 * TEXT_SHARE * width
    under = round(BAR_SHARE * height)
    put_text(image, "what each channel costs the", 4, 0.3 * under, text, PALE)
    put_text(image, "reference; shorter is likelier", 4, 0.3 * under + 1.7 * text, text, PALE)
    lines = (
        ("this picture", SAMPLE, 3),
        ("the reference", REFERENCE, round(1.2 * text)),
        ("nats of each element", BAR, round(1.2 * text)),
    )
    for k, (said, color, thick) in enumerate(lines):
        middle = under + round((1.5 + 2.2 * k) * text)
        image[middle - thick // 2 : middle + (thick + 1) // 2, 4 : round(4 + 2.5 * text)] = color
        put_text(image, said, 4 + 3.2 * text, middle + text / 2, text, PALE)
    notes = ("1 nat: 2.7 times less likely", "all columns on one scale")
    for k, said in enumerate(notes):
        put_text(image, said, 4, under + (8.6 + 1.8 * k) * text, text, PALE)
    return image
