"""The section of charts over the steps: errors, spread, confidence, evidence."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from maurice_mcl.estimate import CONFIDENCE_M
from maurice_mcl.typing import F64

from ..look import Scale
from .charts import DASHES, Chart, Line, Mark, draw_chart
from .choosing import listed, reason
from .contents import Report
from .markup import Markup, joined, tag


def _charts(scale: Scale) -> Iterator[tuple[Chart, str, float]]:
    """Give each chart, the column of a track that it draws, and the factor to its unit."""
    unit, per_m, per_rad = scale.units.name, scale.units.per_m, 180 / np.pi
    near = f"Weight within {scale.say(CONFIDENCE_M)} of the estimate."
    explained = "How well the cloud explained each picture; higher is better."
    yield Chart("Position error", unit, "From estimate to truth."), "position_error_m", per_m
    yield Chart("Heading error", "deg", "Between estimate and truth."), "heading_error_rad", per_rad
    yield Chart("Spread", unit, "Standard deviation of the whole cloud."), "spread_m", per_m
    yield Chart("Confidence", "share", near, top=1.0), "confidence", 1.0
    yield Chart("Effective sample size", "share", "Of all particles.", top=1.0), "effective_share", 1.0
    yield Chart("Evidence", "nats", explained, from_zero=False), "calibrated_evidence", 1.0


def traces(report: Report) -> Markup:
    """Give a chart for each trace that is known, with a line for each run."""
    marks, tracks = _chart_marks(report), report.collected.tracks
    drawn, empty = list[Markup](), list[str]()
    for chart, column, factor in _charts(report.scale):
        lines = [
            Line(track.label, run, track.column("step"), finite(track.column(column) * factor))
            for run, track in enumerate(tracks)
        ]
        if any(np.isfinite(line.y).any() for line in lines):
            drawn.append(draw_chart(chart, lines, marks))
        else:
            empty.append(chart.title.lower())
    without = [tag("p", f"Not drawn, as it is not known: {', '.join(empty)}.")] if empty else []
    return joined([_legend(report), tag("div", drawn, class_="charts"), *without])


def finite(values: F64) -> F64:
    """Make what cannot be drawn a gap."""
    return np.asarray(np.where(np.isfinite(values), values, np.nan))


def _legend(report: Report) -> Markup:
    keys: list[str] = []
    if len(report.runs) > 1:
        for run, label in enumerate(report.labels):
            line = tag("line", x1=0, x2=26, y1=6, y2=6, class_="line", stroke_dasharray=DASHES[run])
            sample = tag("svg", line, viewBox="0 0 26 12", width=26, height=12, aria_hidden="true",
                         class_=f"run{run}")  # fmt: skip
            keys.append(tag("span", sample, f" {label}", class_="key"))
    words = "Numbered lines are the steps with a picture below; short ticks at the bottom are other events."
    return joined([tag("p", keys) if keys else "", tag("p", words)])


def _chart_marks(report: Report) -> list[Mark]:
    numbered = {scene.step: scene.number for scene in report.scenes}
    runs = len(report.runs)
    marks = [Mark(scene.step, "; ".join(scene.reasons), scene.number) for scene in report.scenes]
    others = [one for one in listed(report.happened) if one.event.step not in numbered]
    return marks + [Mark(one.event.step, reason(one, runs)) for one in others]
