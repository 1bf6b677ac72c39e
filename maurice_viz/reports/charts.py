"""Line charts as inline SVG: both axes with a unit, events as numbered lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F64

from .markup import Markup, joined, number, tag

WIDTH, HEIGHT = 520.0, 250.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 10.0, 46.0, 38.0  # of the plot, inside the drawing
MOST_POINTS = 1600  # a longer line is drawn by the lowest and highest of each of so many halves
X_TICKS, Y_TICKS = 7, 5
DASHES = (None, "7 3", "2 3", "9 3 2 3")  # so that runs are told apart without color as well
CIRCLE = 8.5  # radius of an event's number
ROWS = 3  # numbers that would touch stand in so many rows


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One run's values over its steps; NaN leaves a gap."""

    label: str
    run: int  # number of the run, which says its color and its dashes
    x: F64  # (S,)
    y: F64  # (S,)


@dataclass(frozen=True, slots=True)
class Mark:
    """An event on the step axis: a number where there is a picture of it, else a small tick."""

    step: int
    text: str
    number: int | None = None


@dataclass(frozen=True, slots=True)
class Chart:
    """What a chart shows."""

    title: str
    unit: str
    text: str  # what it means, in a sentence
    top: float | None = None  # of the axis, where it is fixed; the axis then begins at 0
    from_zero: bool = True


@dataclass(frozen=True, slots=True)
class Axes:
    """From values to the drawing's coordinates."""

    x: tuple[float, float]
    y: tuple[float, float]

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Place a point."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM)


def draw_chart(chart: Chart, lines: Sequence[Line], marks: Sequence[Mark]) -> Markup:
    """Draw a chart as a figure with a caption."""
    axes = _axes(chart, lines)
    parts = [*_grid(axes, chart.unit), *_marks(axes, marks)]
    parts += [tag("g", _line(axes, line), class_=f"run{line.run}") for line in lines]
    svg = tag(
        "svg",
        parts,
        viewBox=f"0 0 {number(WIDTH)} {number(HEIGHT)}",
        role="img",
        aria_label=f"{chart.title} in {chart.unit} over the steps. {_said(lines)}",
    )
    caption = tag("figcaption", tag("strong", f"{chart.title} ({chart.unit})"), f" {chart.text}")
    return tag("figure", svg, caption, class_="chart")


def _said(lines: Sequence[Line]) -> str:
    """Say in words what the lines show, for those who do not see them."""
    said = []
    for line in lines:
        known = line.y[np.isfinite(line.y)]
        if len(known):
            said.append(
                f"{line.label}: from {known.min():.3g} to {known.max():.3g}, mean {known.mean():.3g}."
            )
    return " ".join(said)


def _axes(chart: Chart, lines: Sequence[Line]) -> Axes:
    x = np.concatenate([line.x for line in lines])
    y = np.concatenate([line.y for line in lines])
    y = y[np.isfinite(y)]
    low, high = (float(y.min()), float(y.max())) if len(y) else (0.0, 1.0)
    low = min(low, 0.0) if chart.from_zero else low
    high = high if chart.top is None else chart.top
    room = 0.06 * (high - low) or 0.5
    return Axes(
        (float(x.min()) - 0.5, float(x.max()) + 0.5),
        (low if chart.from_zero else low - room, high if chart.top else high + room),
    )


def ticks(low: float, high: float, most: int) -> list[float]:
    """Give round values, 1, 2 or 5 times a power of ten apart, at most so many."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _grid(axes: Axes, unit: str) -> Iterator[Markup]:
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    for value in ticks(*axes.y, Y_TICKS):
        _, y = axes.at(axes.x[0], value)
        yield tag("line", x1=LEFT, x2=right, y1=y, y2=y, class_="grid")
        yield tag("text", f"{value:.6g}", x=LEFT - 6, y=y + 4.5, text_anchor="end")
    for value in ticks(*axes.x, X_TICKS):
        if value == round(value):
            x, _ = axes.at(value, axes.y[0])
            yield tag("line", x1=x, x2=x, y1=bottom, y2=bottom + 4, class_="axis")
            yield tag("text", f"{value:.0f}", x=x, y=bottom + 17, text_anchor="middle")
    yield tag("line", x1=LEFT, x2=right, y1=bottom, y2=bottom, class_="axis")
    yield tag("text", "step", x=right, y=bottom + 33, text_anchor="end", class_="name")
    yield tag("text", unit, x=LEFT - 6, y=TOP - 10, text_anchor="end", class_="name")


def _marks(axes: Axes, marks: Sequence[Mark]) -> Iterator[Markup]:
    """Draw ticks first, numbers over them; numbers that are close take turns in rows."""
    bottom = HEIGHT - BOTTOM
    for mark in marks:
        x, _ = axes.at(mark.step, 0)
        if mark.number is None:
            line = tag("line", x1=x, x2=x, y1=bottom, y2=bottom - 6, class_="tick")
            yield tag("g", tag("title", f"step {mark.step}: {mark.text}"), line)
    taken = [-math.inf] * ROWS
    for mark in sorted((m for m in marks if m.number is not None), key=lambda m: m.step):
        x, _ = axes.at(mark.step, 0)
        row = min(range(ROWS), key=lambda k: (taken[k] + 2 * CIRCLE > x, taken[k]))
        taken[row] = x
        y = CIRCLE + row * (2 * CIRCLE - 1)
        yield tag(
            "g",
            tag("title", f"step {mark.step}: {mark.text}"),
            tag("line", x1=x, x2=x, y1=y, y2=bottom, class_="event"),
            badge(x, y, mark.number or 0),
        )


def badge(x: float, y: float, label: int) -> Markup:
    """Draw an event's number in a disk, as it stands beside its picture."""
    disk = tag("circle", cx=x, cy=y, r=CIRCLE, class_="badge")
    return joined([disk, tag("text", str(label), x=x, y=y + 4, text_anchor="middle", class_="badge")])


def _line(axes: Axes, line: Line) -> Markup:
    shown = [_placed(axes, *part) for part in _parts(*thinned(line.x, line.y))]
    return joined(
        tag("polyline", points=points, class_="line", stroke_dasharray=DASHES[line.run % len(DASHES)])
        if " " in points
        else tag("circle", cx=points.split(",")[0], cy=points.split(",")[1], r=2.5, class_="dot")
        for points in shown
    )


def _placed(axes: Axes, x: F64, y: F64) -> str:
    points = (axes.at(float(a), float(b)) for a, b in zip(x, y, strict=True))
    return " ".join(f"{number(a)},{number(b)}" for a, b in points)


def _parts(x: F64, y: F64) -> Iterator[tuple[F64, F64]]:
    """Cut a line (S,) at what is not known."""
    known = np.flatnonzero(np.isfinite(y))
    for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        if len(part):
            yield x[part], y[part]


def thinned(x: F64, y: F64) -> tuple[F64, F64]:
    """Keep of a long line the lowest and the highest of each stretch, in order, so that no peak is lost."""
    if len(x) <= MOST_POINTS:
        return x, y
    kept: set[int] = set()
    for part in np.array_split(np.arange(len(x)), MOST_POINTS // 2):
        known = part[np.isfinite(y[part])]
        kept |= (
            {int(known[y[known].argmin()]), int(known[y[known].argmax()])} if len(known) else {int(part[0])}
        )
    order = np.array(sorted(kept))
    return x[order], y[order]
