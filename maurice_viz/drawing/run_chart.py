"""A chart of many runs: each a point over a setting, with means and intervals, drawn once as a picture.

The points themselves are the viewer's, so that it can name the run under the mouse: `RunChart` says where.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.arrays import F32, F64, U8

from ..style import BAR, GROUND, PALE, RGB, RULER, RUN_COLORS
from .canvas import blank, put_text, text_size, ticks

SIZE = (1100, 820)  # width and height in pixels
LEFT, RIGHT, TOP, BOTTOM = 118, 30, 92, 112
TEXT_PX, INSET = 15.0, 0.06  # height of capitals; free beside the first and the last value, as a share
JITTER = 0.012  # of the width: points of one value are that far apart
SERIES: tuple[RGB, ...] = (*RUN_COLORS[1:], BAR)  # the first color of runs is that of the chosen one


@dataclass(frozen=True, slots=True)
class Mean:
    """The mean of some runs with its interval, at one value of the setting."""

    at: int  # number of the value
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Series:
    """Runs that differ in nothing but the setting and the seed."""

    name: str
    at: Sequence[int]  # (N,) number of each run's value
    values: F64  # (N,)
    runs: Sequence[str]  # (N,) what names each
    means: Sequence[Mean]


@dataclass(frozen=True, slots=True)
class RunChart:
    """What a chart shows; `settings` are the values along x, in order, numbers on a log scale."""

    x_label: str
    y_label: str
    settings: Sequence[object]
    series: Sequence[Series]

    @property
    def top(self) -> float:
        """Where the scale ends."""
        highest = [float(one.values.max()) for one in self.series if len(one.values)]
        return max(1.05 * max(highest, default=0.0), 1e-9)

    @property
    def numbers(self) -> F64:
        """The values along x where all are numbers above zero, else none."""
        values = [float(one) for one in self.settings if isinstance(one, (int, float)) and one > 0]
        return np.array(values if len(values) == len(self.settings) else [], np.float64)

    def x_of(self, number: int) -> float:
        """Return the column of pixels of a value."""
        values = self.numbers
        if len(values) > 1:
            logs = np.log(values)
            share = float((logs[number] - logs.min()) / np.ptp(logs))
        else:
            share = number / (len(self.settings) - 1) if len(self.settings) > 1 else 0.5
        wide = SIZE[0] - LEFT - RIGHT
        return LEFT + wide * (INSET + (1 - 2 * INSET) * share)

    def y_of(self, value: float) -> float:
        """Return the row of pixels of a figure."""
        return SIZE[1] - BOTTOM - (SIZE[1] - BOTTOM - TOP) * value / self.top

    def points(self, series: int) -> F32:
        """Return where the runs of a series are drawn (N, 2): those of one value beside each other."""
        one = self.series[series]
        beside = np.random.default_rng(0).uniform(-1, 1, len(one.values)) * JITTER * SIZE[0]
        shift = self._shift(series)
        at = [
            (self.x_of(k) + shift + off, self.y_of(float(v)))
            for k, v, off in zip(one.at, one.values, beside, strict=True)
        ]
        return np.array(at, np.float32).reshape(-1, 2)

    def _shift(self, series: int) -> float:
        return (series - (len(self.series) - 1) / 2) * 2.6 * JITTER * SIZE[0]

    def draw(self) -> U8:
        """Draw (H, W, 3) everything but the runs: axes, means with intervals, names of series."""
        image = blank(SIZE[1], SIZE[0], GROUND)
        self._draw_axes(image)
        for number, one in enumerate(self.series):
            color, shift = SERIES[number % len(SERIES)], self._shift(number)
            at = [(self.x_of(mean.at) + shift, mean) for mean in one.means]
            line = np.array([(x, self.y_of(mean.value)) for x, mean in at]).round().astype(np.int32)
            if len(self.numbers):  # between names there is nothing
                cv2.polylines(image, [line.reshape(-1, 1, 2)], False, color, 2, cv2.LINE_AA)
            for x, mean in at:
                low, high = (round(self.y_of(v)) for v in (mean.low, mean.high))
                cv2.line(image, (round(x), low), (round(x), high), color, 4, cv2.LINE_AA)
                cv2.circle(image, (round(x), round(self.y_of(mean.value))), 8, color, 2, cv2.LINE_AA)
        self._draw_names(image)
        return image

    def _draw_axes(self, image: U8) -> None:
        bottom, right = SIZE[1] - BOTTOM, SIZE[0] - RIGHT
        for value in ticks(0.0, self.top, 10 ** math.floor(math.log10(self.top / 5))):
            y = round(self.y_of(value))
            cv2.line(image, (LEFT, y), (right, y), RULER if value else PALE, 1)
            _centered(image, f"{value:g}", LEFT - 34, y + TEXT_PX / 2)
        last = -math.inf
        for number, setting in enumerate(self.settings):
            x, told = self.x_of(number), f"{setting:,}" if isinstance(setting, int) else str(setting)
            wide = text_size(told, TEXT_PX)[0]
            cv2.line(image, (round(x), bottom), (round(x), bottom + 6), PALE, 1)
            if x - wide / 2 > last + 8:
                _centered(image, told, x, bottom + 12 + TEXT_PX)
                last = x + wide / 2
        _centered(image, self.x_label, (LEFT + right) / 2, bottom + 56 + TEXT_PX)
        put_text(image, self.y_label, 20, TOP - 24, TEXT_PX, PALE)

    def _draw_names(self, image: U8) -> None:
        x = 20.0
        for number, one in enumerate(self.series):
            color = SERIES[number % len(SERIES)]
            told = f"{one.name + ': ' if one.name else ''}mean, 95 % interval"
            cv2.line(image, (round(x), 26), (round(x) + 34, 26), color, 4, cv2.LINE_AA)
            cv2.circle(image, (round(x) + 17, 26), 8, color, 2, cv2.LINE_AA)
            put_text(image, told, x + 44, 26 + TEXT_PX / 2, TEXT_PX, PALE)
            x += 70 + text_size(told, TEXT_PX)[0]


def _centered(image: U8, text: str, middle: float, base: float) -> None:
    put_text(image, text, middle - text_size(text, TEXT_PX)[0] / 2, base, TEXT_PX, PALE)
