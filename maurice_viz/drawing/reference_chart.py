"""What a reference loses, as one drawing: nats by channel as a stacked bar, over a small chart per channel.

A small chart has the reference's descriptor filled under the picture's line, its name on the
axis, and below it what each element costs. Two-dimensional histograms are heat maps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.reasons.explanation import ChannelExplanation, EntryExplanation
from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values import F32, F64, U8

from ..style import (
    BAR,
    CHANNEL_COLORS,
    EMPTY,
    GROUND,
    PALE,
    PICTURE,
    PLAIN,
    RED_GREEN_BLUE,
    REFERENCE,
    RGB,
    RGBA,
)
from .canvas import blank, put_text, text_size
from .heat import CHART, EMPTY_INK, HEATS, LEAST_HEIGHT, grid_of, heat_of, place_heat
from .indexed import fill, write

CHART_PX = (288, 260)  # width and height, in a recording of many updates
BAR_SHARE = 0.23  # of the height, with the axis below it
TEXT_SHARE = 0.052  # height of capitals, of the width
COST_SHARE = 0.32  # of a small chart's height: what each element costs
TICK_NATS = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # nats between two marks of the axis
MOST_MARKS = 5
PLANES = ("R", "G", "B")  # equal thirds of a descriptor

# numbers of the colors of charts
SAMPLE_INK, REFERENCE_INK, COST_INK = (CHART.flat(color) for color in (PICTURE, REFERENCE, BAR))
TEXT_INK = CHART.ramp(GROUND, PALE)
GROUND_INK, PALE_INK = CHART.flat(GROUND), CHART.flat(PALE)
BAR_INKS = {color: CHART.ramp(color, GROUND) for color in CHANNEL_COLORS}  # a bar, and letters on it


def channel_color(channel: str) -> RGB:
    """Return the color of a sensor channel: the same in every run; after the ninth channel they repeat."""
    known = list(CHANNELS)
    return CHANNEL_COLORS[(known.index(channel) if channel in known else 0) % len(CHANNEL_COLORS)]


def bands_of(bins: int) -> tuple[RGBA, ...]:
    """Return one band per color if each color has 28 bins, else a single band."""
    return RED_GREEN_BLUE if bins == len(PLANES) * BINS else (PLAIN,)


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
    for channels in by_channel:
        both = np.concatenate([part for c in channels for part in (c.sample, c.reference)])
        low = min(float(both.min()), 0.0)
        spans.append((low, max(float(both.max()), low + LEAST_HEIGHT)))
        costs.append(max(LEAST_HEIGHT, *(float(c.nats.max()) for c in channels)))
    nats = max(sum(c.loses for c in entry.channels) for entry in entries)
    return ChartScale(max(nats, 1.0), tuple(spans), tuple(costs))


def draw_reference_chart(entry: EntryExplanation | None, scale: ChartScale) -> U8:
    """Draw (H, W) what a reference loses, in colors of the palette `CHART`; empty without a reference."""
    size = CHART_PX
    if entry is None:
        return np.full(size[::-1], GROUND_INK, np.uint8)
    channels = tuple((c.channel, len(c.sample)) for c in entry.channels)
    image = _with_axis(channels, size, scale.nats).copy()
    _draw_bar(image, entry, scale.nats, size)
    for number, place in enumerate(_places(len(entry.channels), size)):
        _draw_channel(image[place], entry.channels[number], number, scale, TEXT_SHARE * size[0])
    return image


Place = tuple[slice, slice]  # rows and columns of an image


def _places(count: int, size: tuple[int, int]) -> Iterator[Place]:
    """Yield the places of the small charts under the bar."""
    width, height = size
    under = round(BAR_SHARE * height)
    columns = math.ceil(math.sqrt(count))
    rows = -(-count // columns)
    for number in range(count):
        row, column = divmod(number, columns)
        top, end = (under + (row + k) * (height - under) // rows for k in (0, 1))
        left, right = ((column + k) * width // columns for k in (0, 1))
        yield slice(top, end), slice(left + 4, right - 4)


@lru_cache(maxsize=16)
def _ground(channels: tuple[tuple[str, int], ...], size: tuple[int, int]) -> U8:
    """Draw what no update changes: the axis, and names and grounds of channels, each with its elements."""
    image = np.full(size[::-1], GROUND_INK, np.uint8)
    text = TEXT_SHARE * size[0]
    _, high, end = _bar_place(size)
    image[high + 2, 4 : round(end)] = PALE_INK
    for number, (name, elements) in enumerate(channels):
        part = image[list(_places(len(channels), size))[number]]
        width = part.shape[1]
        _write_name(part, name, text)
        if grid_of(name, elements) is None:
            levels, costs = _levels_and_costs(part, text)
            levels[:] = _grounds(elements)[np.arange(width) * len(_grounds(elements)) // width]
            costs[:] = EMPTY_INK
            _name_planes(levels, elements, 0.95 * text)
    return image


def _write_name(part: U8, name: str, text: float) -> None:
    """Write the name of a channel below its chart, after a square of its color, in place."""
    height, width = part.shape
    square = round(text)
    room = width - 1.9 * text  # a text's width is not quite in proportion to its height
    small = min(text, text * room / max(text_size(name, text)[0], 1))
    left = max((room - text_size(name, small)[0]) / 2, 0)
    low = round(height - 0.45 * text)
    part[low - square : low, round(left) : round(left) + square] = BAR_INKS[channel_color(name)]
    write(part, name, left + 1.5 * text, low, small, TEXT_INK)


def _name_planes(levels: U8, elements: int, text: float) -> None:
    """Write R, G and B over the thirds of a descriptor that has them, in place."""
    width = levels.shape[1]
    grounds = _grounds(elements)
    if len(grounds) == len(PLANES):
        for number, (plane, ground) in enumerate(zip(PLANES, grounds.tolist(), strict=True), 1):
            at = number * width / len(PLANES) - 1.4 * text
            write(levels, plane, at, 1.6 * text, text, _PLANE_INKS[ground])


def _bar_place(size: tuple[int, int]) -> tuple[int, int, float]:
    """Return the first row of the bar, the row after it, and where its axis ends."""
    width, height = size
    text, high = TEXT_SHARE * width, 0.12 * round(BAR_SHARE * height)
    return round(high), round(high + 2.1 * text), width - 4 - 3.2 * text


def _draw_bar(image: U8, entry: EntryExplanation, most: float, size: tuple[int, int]) -> None:
    """Draw the nats of all channels end to end, over the axis."""
    text = TEXT_SHARE * size[0]
    low, high, end = _bar_place(size)
    at = 4.0
    for channel in entry.channels:
        after = at + channel.loses / most * (end - 4)
        ink = BAR_INKS[channel_color(channel.channel)]
        image[low:high, round(at) : round(after)] = ink
        label = f"{channel.channel} {channel.loses:.1f}"
        for words in (label, channel.channel):
            if _width(words, 0.95 * text) < after - at - 4:
                write(image, words, at + 3, high - 0.6 * text, 0.95 * text, ink)
                break
        at = after
    total = sum(channel.loses for channel in entry.channels)
    write(image, f"{total:.1f}", at + 4, high - 0.6 * text, text, TEXT_INK)


@lru_cache(maxsize=2)
def _with_axis(channels: tuple[tuple[str, int], ...], size: tuple[int, int], most: float) -> U8:
    """Draw what all charts of an update share: their ground, and the marks of the axis of the bars."""
    image, text = _ground(channels, size).copy(), TEXT_SHARE * size[0]
    _, high, end = _bar_place(size)
    step = next((t for t in TICK_NATS if most / t <= MOST_MARKS), TICK_NATS[-1])
    marks = np.arange(0, most + 1e-9, step).tolist()
    for mark in marks:
        x = 4 + mark / most * (end - 4)
        image[high + 2 : high + 6, round(x) : round(x) + 1] = PALE_INK
        words = f"{mark:g} nats" if mark == marks[-1] else f"{mark:g}"
        write(image, words, max(x - 0.4 * text, 0), high + 9 + 0.95 * text, 0.95 * text, TEXT_INK)
    return image


@lru_cache(maxsize=1024)
def _width(text: str, height_px: float) -> int:
    return text_size(text, height_px)[0]


def _draw_channel(
    image: U8, channel: ChannelExplanation, number: int, scale: ChartScale, text: float
) -> None:
    """Draw the descriptors of one channel, and what each element costs."""
    grid = grid_of(channel.channel, len(channel.sample))
    if grid is not None:
        _, most = scale.spans[number]
        amounts = (channel.sample, channel.reference, channel.nats)
        tops = (most, most, scale.costs[number])
        maps = [heat_of(a.reshape(grid), t, ink) for a, t, ink in zip(amounts, tops, HEATS, strict=True)]
        place_heat(image[: _under(image, text)], maps)
        return
    levels, costs = _levels_and_costs(image, text)
    draw_levels(levels, channel.sample, channel.reference, scale.spans[number])
    _draw_costs(costs, channel.nats, scale.costs[number])


def _under(image: U8, text: float) -> int:
    """Return how many rows of a channel's place are above its name."""
    return round(len(image) - 1.9 * text)


def _levels_and_costs(image: U8, text: float) -> tuple[U8, U8]:
    """Divide a channel's place: its descriptor's part, and the part of what each element costs."""
    under = _under(image, text)
    split = round((1 - COST_SHARE) * under)
    return image[: split - 2], image[split:under]


def draw_levels(image: U8, sample: F32, reference: F32, span: tuple[float, float]) -> None:
    """Draw a descriptor (D,) filled, and another one as a line over it."""
    height, width = image.shape
    rows = _numbers(height)
    filled, line = _row(_by_pixel(np.array([reference, sample]), width), *span, height)
    if span[0] < 0:
        zero = _row(np.zeros(1), *span, height)
        fill(image, (rows >= np.minimum(filled, zero)) & (rows < np.maximum(filled, zero)), REFERENCE_INK)
    else:  # zero is below the last row
        fill(image, rows >= filled, REFERENCE_INK)
    points = np.column_stack([_numbers(width), np.minimum(line, height - 1)]).astype(np.int32)
    cv2.polylines(image, [points], False, SAMPLE_INK, max(2, round(width / 110)))


@lru_cache(maxsize=64)
def _numbers(count: int) -> NDArray[np.int16]:
    """Return the numbers of rows of pixels (count, 1), as `_row` returns them."""
    return np.arange(count, dtype=np.int16)[:, None]


@lru_cache(maxsize=16)
def _grounds(bins: int) -> U8:
    """Return the inks behind a descriptor's elements, from left to right."""
    return np.array([_BAND_INKS[band] for band in bands_of(bins)], np.uint8)


def _mixed(band: RGBA) -> RGB:
    """Return the color of a band of bars on the ground of a chart."""
    empty, share = np.array(EMPTY), band[3] / 255 * 0.8
    red, green, blue = (empty + (np.array(band[:3]) - empty) * share).astype(int).tolist()
    return red, green, blue


_BAND_INKS = {band: CHART.flat(_mixed(band)) for band in (*RED_GREEN_BLUE, PLAIN)}
_PLANE_INKS = {_BAND_INKS[band]: CHART.ramp(_mixed(band), PALE) for band in RED_GREEN_BLUE}  # letters on them


def _draw_costs(image: U8, nats: F32, most: float) -> None:
    height, width = image.shape
    fill(image, _numbers(height) >= _row(_by_pixel(nats, width), 0.0, most, height), COST_INK)


def _by_pixel(values: F32, width: int) -> F64:
    """Return for each column of pixels (..., W) its element of (..., D), or the largest of its elements."""
    count = values.shape[-1]
    if count <= width:
        return np.asarray(values.take(_elements(count, width), axis=-1), np.float64)
    return np.asarray(np.maximum.reduceat(values, _elements(count, width), axis=-1), np.float64)


@lru_cache(maxsize=64)
def _elements(count: int, width: int) -> NDArray[np.int64]:
    """Return the element at each column of pixels."""
    return np.arange(width) * count // width


def _row(values: F64, low: float, high: float, height: int) -> NDArray[np.int16]:
    """Return the row of pixels of each value, 0 at the top."""
    return np.rint((high - values) / (high - low) * height).astype(np.int16)


def draw_chart_key() -> U8:
    """Draw what the marks of a chart mean, as large as a chart."""
    width, height = CHART_PX
    image = blank(height, width, GROUND)
    text = 0.95 * TEXT_SHARE * width
    under = round(BAR_SHARE * height)
    put_text(image, "what each channel costs the", 4, 0.3 * under, text, PALE)
    put_text(image, "reference; shorter is likelier", 4, 0.3 * under + 1.7 * text, text, PALE)
    lines = (
        ("this picture", PICTURE, 3),
        ("the reference", REFERENCE, round(1.2 * text)),
        ("nats of each element", BAR, round(1.2 * text)),
    )
    for k, (words, color, thick) in enumerate(lines):
        middle = under + round((1.5 + 2.2 * k) * text)
        image[middle - thick // 2 : middle + (thick + 1) // 2, 4 : round(4 + 2.5 * text)] = color
        put_text(image, words, 4 + 3.2 * text, middle + text / 2, text, PALE)
    notes = ("1 nat: 2.7 times less likely", "all columns on one scale")
    for k, words in enumerate(notes):
        put_text(image, words, 4, under + (8.6 + 1.8 * k) * text, text, PALE)
    return image
