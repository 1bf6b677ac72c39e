"""Line charts over the steps; `drawings.html` writes the SVG. And the templates of all pages."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from maurice_mcl.values import F64

from ..style import LUT, RGB, RUN_COLORS

WIDTH, HEIGHT = 520.0, 250.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 10.0, 46.0, 38.0  # margins of the plot inside the drawing
MAX_POINTS = 1600  # a longer line keeps the lowest and the highest point of each of half as many stretches
X_TICKS, Y_TICKS = 7, 5
DASHES = ("", "7 3", "2 3", "9 3 2 3")  # tell runs apart without color as well
BADGE = 8.5  # radius of an event's number
ROWS = 3  # numbers that would overlap go to different rows


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """The box of a plot in a drawing, and the values at its edges."""

    x: tuple[float, float]  # at left and right
    y: tuple[float, float]  # at bottom and top
    left: float  # of the box, in px
    top: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Right edge in px."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """Lower edge in px."""
        return self.top + self.height

    def at(self, xy: F64) -> F64:
        """Return points (K, 2) in px, y pointing down."""
        across = (xy[:, 0] - self.x[0]) / (self.x[1] - self.x[0] or 1.0)
        up = (xy[:, 1] - self.y[0]) / (self.y[1] - self.y[0] or 1.0)
        return np.column_stack([self.left + across * self.width, self.bottom - up * self.height])

    def points(self, xy: F64) -> str:
        """Return points (K, 2) as SVG writes them."""
        return " ".join(f"{px(x)},{px(y)}" for x, y in self.at(xy).tolist())


def px(value: float) -> str:
    """Return a coordinate with at most two decimals, the same on every machine."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


@dataclass(frozen=True, slots=True, eq=False)
class ChartLine:
    """One run's values over its steps; NaN leaves a gap."""

    label: str
    run: int  # number of the run: chooses color and dashes
    x: F64  # (U,)
    y: F64  # (U,)


@dataclass(frozen=True, slots=True)
class Mark:
    """An event on the step axis: a number where it has a picture, else a small tick."""

    step: int
    text: str
    number: int | None = None


@dataclass(frozen=True, slots=True)
class Chart:
    """What a chart shows."""

    title: str
    unit: str
    text: str  # what it means, in a sentence
    top: float | None = None  # of the y axis, where it is fixed
    from_zero: bool = True
    is_told: bool = True  # in the words about one step


@dataclass(frozen=True, slots=True, eq=False)
class DrawnChart:
    """A chart as the template writes it."""

    chart: Chart
    lines: Sequence[ChartLine]
    marks: Sequence[Mark]
    width: float = WIDTH
    height: float = HEIGHT

    @property
    def axes(self) -> Axes:
        """The plot's box; its y axis holds all values."""
        x, y = (np.concatenate([getattr(line, name) for line in self.lines]) for name in "xy")
        y = y[np.isfinite(y)]
        low, high = (float(y.min()), float(y.max())) if len(y) else (0.0, 1.0)
        low = min(low, 0.0) if self.chart.from_zero else low
        high = high if self.chart.top is None else self.chart.top
        room = 0.06 * (high - low) or 0.5
        y_axis = (low if self.chart.from_zero else low - room, high if self.chart.top else high + room)
        x_axis = (float(x.min()) - 0.5, float(x.max()) + 0.5)
        return Axes(x_axis, y_axis, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM)

    @property
    def y_ticks(self) -> list[tuple[float, str]]:
        """Height in px and label of each tick."""
        values = np.array(ticks(*self.axes.y, Y_TICKS))
        places = self.axes.at(np.column_stack([np.zeros(len(values)), values]))[:, 1]
        return [(y, f"{value:.6g}") for y, value in zip(places.tolist(), values.tolist(), strict=True)]

    @property
    def x_ticks(self) -> list[tuple[float, str]]:
        """Position in px and label of each tick: steps are integers."""
        values = [value for value in ticks(*self.axes.x, X_TICKS) if value == round(value)]
        return [(self._across(value), f"{value:.0f}") for value in values]

    @property
    def small_marks(self) -> list[tuple[float, Mark]]:
        """Events without a number, and their position in px."""
        return [(self._across(mark.step), mark) for mark in self.marks if mark.number is None]

    @property
    def numbered_marks(self) -> Iterator[tuple[float, float, Mark]]:
        """Events with a number, and where the number's center is; close ones alternate between rows."""
        taken = [-math.inf] * ROWS
        for mark in sorted((m for m in self.marks if m.number is not None), key=lambda m: m.step):
            x = self._across(mark.step)
            row = min(range(ROWS), key=lambda k: (taken[k] + 2 * BADGE > x, taken[k]))
            taken[row] = x
            yield x, BADGE + row * (2 * BADGE - 1), mark

    def parts(self, line: ChartLine) -> Iterator[str]:
        """Yield the points of each stretch of a line without gaps."""
        axes, xy = self.axes, np.column_stack(thin_chart(line.x, line.y))
        known = np.flatnonzero(np.isfinite(xy[:, 1]))
        for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
            if len(part):
                yield axes.points(xy[part])

    @property
    def label(self) -> str:
        """What the lines show, in words, for readers who do not see them."""
        known = [(line.label, line.y[np.isfinite(line.y)]) for line in self.lines]
        ranges = [
            f"{label}: from {y.min():.3g} to {y.max():.3g}, mean {y.mean():.3g}."
            for label, y in known
            if len(y)
        ]
        return f"{self.chart.title} in {self.chart.unit} over the steps. {' '.join(ranges)}"

    def _across(self, step: float) -> float:
        return float(self.axes.at(np.array([[step, 0.0]]))[0, 0])


def ticks(low: float, high: float, most: int) -> list[float]:
    """Return about `most` round values: multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def thin_chart(x: F64, y: F64) -> tuple[F64, F64]:
    """Keep the lowest and the highest point of each stretch of a long line, in order: no peak is lost."""
    if len(x) <= MAX_POINTS:
        return x, y
    rows: set[int] = set()
    for part in np.array_split(np.arange(len(x)), MAX_POINTS // 2):
        known = part[np.isfinite(y[part])]
        rows |= (
            {int(known[y[known].argmin()]), int(known[y[known].argmax()])} if len(known) else {int(part[0])}
        )
    order = np.array(sorted(rows))
    return x[order], y[order]


# The one set of templates, with their filters and colors.

DARKER = 0.7  # brightness of the colors on white, so that lines stand out


def page_of_template(name: str, **values: Any) -> str:
    """Return the page that a template makes of values; a value that it lacks is an error."""
    return templates().get_template(name).render(**values)


def templates() -> Environment:
    """Return the templates."""
    environment = Environment(
        loader=PackageLoader("maurice_viz.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "px": px,
        "jpeg_url": _url("jpeg"),
        "png_url": _url("png"),
        "only_script": only_script,
    }
    ramp = [_hex((c >> 24, c >> 16 & 255, c >> 8 & 255)) for c in LUT[::51].tolist()]
    environment.globals |= {"dashes": DASHES, "light": _colors(DARKER), "dark": _colors(1.0), "ramp": ramp}
    return environment


POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{}'; "
    "base-uri 'none'; form-action 'none'"
)
POLICY_TAG = Markup('<meta http-equiv="Content-Security-Policy" content="{}">')


def only_script(script: str) -> Markup:
    """Return the tag by which a browser runs nothing but this script, and loads nothing from elsewhere."""
    digest = base64.b64encode(sha256(script.encode()).digest()).decode("ascii")
    return POLICY_TAG.format(Markup(POLICY.format(digest)))


def _colors(brightness: float) -> dict[str, str]:
    named = {f"run{k}": color for k, color in enumerate(RUN_COLORS)} | {"estimate": RUN_COLORS[0]}
    return {name: _hex(color, brightness) for name, color in named.items()}


def _hex(color: RGB, brightness: float = 1.0) -> str:
    return "#" + "".join(f"{round(part * brightness):02x}" for part in color)


def _url(kind: str) -> Callable[[bytes], str]:
    return lambda data: f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
