"""The explanation panel of a replay: the references that matter, side by side.

A chart has one color, so channels are told apart by tints behind the bars, in the order of the table.

Columns are the reference nearest to the truth (where it is known), the one nearest to the estimate, and the
winner: each with its picture, all of them in one chart of descriptors, one chart of what each element costs
and one table, and as arrows on the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from maurice_mcl.analysis.explanation import ESTIMATE, TRUTH, Explained, StepExplanation, explain_step
from maurice_mcl.arrays import F32, F64
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.session import Moment

from ..drawing.arrow import tensor_of
from ..drawing.contact_sheet import CELL_PX, cell_height
from ..entities import RunPaths
from ..explanations.paths import (
    COLORS,
    KINDS,
    NAMES,
    NOT_KNOWN,
    OUTSIDE,
    Column,
    card_path,
    chart_path,
    columns,
    columns_of,
    marks_path,
    table_path,
)
from ..explanations.table import markdown_table
from ..explanations.words import say_behind
from ..style import BAR, RGB, TINTS, Scale
from .explanation_cards import Bars, bars_for, blank_card, card_height, card_of
from .histograms import REFERENCE, REFERENCE_BAR, SAMPLE, SAMPLE_BAR

# Charts of explanations at every update: all references in one row of bars, a block a reference.

FOOT_NATS = 0.3  # height of the tints in the chart of costs; higher bars make the chart grow


def prepare_charts(rec: rr.RecordingStream, paths: RunPaths, bars: Bars, blocks: int) -> None:
    """Log what does not change: tints, colors, and where the bars stand."""
    for kind, height in (("tints", 1.0), ("feet", FOOT_NATS)):
        for number in range(len(bars.channels)):
            band = rr.BarChart(
                np.full(blocks, height, np.float32),
                abscissa=np.array([bars.left_of(block) + number for block in range(blocks)], np.float32),
                widths=np.ones(blocks, np.float32),
                color=TINTS[number % len(TINTS)],
            )
            rec.log(f"{chart_path(paths, kind)}/{number}", band, static=True)
    lefts = np.concatenate([bars.lefts + bars.left_of(block) for block in range(blocks)])
    widths = np.tile(bars.widths, blocks)
    for kind, color, offset, width in (
        ("reference", REFERENCE, *REFERENCE_BAR),
        ("sample", SAMPLE, *SAMPLE_BAR),
        ("cost", BAR, 0.0, 1.0),
    ):
        _place_bars(rec, chart_path(paths, kind), color, lefts + offset * widths, width * widths)


def draw_charts(
    rec: rr.RecordingStream, paths: RunPaths, bars: Bars, step: StepExplanation, blocks: Sequence[Column]
) -> None:
    """Log for each reference its descriptors, under those of the picture, and what each element costs."""
    sample = bars.heights([channel.sample for channel in step.winner.channels])
    heights = [_block(bars, column) for column in blocks]
    shown = (
        np.tile(sample, len(blocks)),
        np.concatenate([reference for reference, _ in heights]),
        np.concatenate([cost for _, cost in heights]),
    )
    for kind, values in zip(KINDS, shown, strict=True):
        rec.log(chart_path(paths, kind), rr.BarChart.from_fields(values=tensor_of(values)))


def _block(bars: Bars, column: Column) -> tuple[F32, F32]:
    """Give heights of one reference's descriptors and costs; none where there is no reference."""
    _, explained = column
    if explained is None or explained.entry is None:
        nothing = np.zeros(len(bars.starts), np.float32)
        return nothing, nothing
    channels = explained.entry.channels
    costs = bars.divided([c.loses for c in channels], [c.contributions for c in channels])
    return bars.heights([c.reference for c in channels]), costs


def _place_bars(rec: rr.RecordingStream, path: str, color: RGB, lefts: F64, widths: F64) -> None:
    chart = rr.BarChart(
        np.zeros(len(lefts), np.float32),
        color=color,
        abscissa=np.asarray(lefts, np.float32),
        widths=np.asarray(widths, np.float32),
    )
    # all but the values: static values would hide all later ones, and from_fields() insists on values
    style = [
        part
        for part in chart.as_component_batches()
        if not part.component_descriptor().component.endswith("values")
    ]
    rec.log(path, style, static=True)


# The panel of explanations in a replay's recording: the references that matter, side by side.

ARROW = 0.035  # length of the arrows on the map, as a share of the arena's long side
THICKNESS = (4.5, 3.0, 1.5)  # radii in points: of arrows that lie upon each other all can be seen
MARKDOWN = "text/markdown"
LEFT_OUT = "Not drawn at this update (`--detail`)."
NO_LIBRARY = "What the picture was compared with is not at hand."


@dataclass(frozen=True, slots=True, eq=False)
class _Tools:
    """What is made once when a run begins."""

    sensor: SensorModel
    bars: Bars
    thumbnail: int  # height of the library's thumbnails in pixels
    height: int  # of one picture on a card
    arrow: float  # in display units


@dataclass(slots=True)
class ExplainPanel:
    """Draws the panel of one run. `sensor` is None for a saved run whose library is gone."""

    paths: RunPaths
    sensor: SensorModel | None
    scale: Scale
    has_truth: bool
    _tools: _Tools | None = field(init=False, default=None)
    _cards: dict[str, bytes] = field(init=False, default_factory=dict)  # last logged, a column

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change."""
        if self.sensor is None:
            rec.log(table_path(self.paths), rr.TextDocument(NO_LIBRARY, media_type=MARKDOWN), static=True)
            return
        self._tools = tools = _tools_for(self.sensor, self.scale)
        whose = columns_of(self.has_truth)
        rec.log(table_path(self.paths), rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        for who in whose:
            picture = rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=-10.0)
            rec.log(card_path(self.paths, who), picture, static=True)
        prepare_charts(rec, self.paths, tools.bars, len(whose))
        thick = rr.components.Radius.ui_points(THICKNESS[-len(whose) :])
        colors = [COLORS[who] for who in whose]
        style = rr.Arrows2D.from_fields(colors=colors, radii=thick, draw_order=60.0)
        rec.log(marks_path(self.paths), style, static=True)

    def draw(self, rec: rr.RecordingStream, moment: Moment, record: StepRecord) -> None:
        """Log the panel of one update; the time is set."""
        tools = self._tools
        if tools is None or not len(record.sighting.comparison.quality):
            return
        step = explain_step(record, tools.sensor, moment.truth if self.has_truth else None)
        shown = columns(step, self.has_truth)
        for column in shown:
            self._draw_card(rec, column, tools)
        draw_charts(rec, self.paths, tools.bars, step, shown)
        self._draw_marks(rec, shown, tools)
        text = f"{headline(step)}\n\n{markdown_table(step, self.scale)}"
        rec.log(table_path(self.paths), rr.TextDocument.from_fields(text=text))

    def draw_left_out(self, rec: rr.RecordingStream) -> None:
        """Empty the panel where updates are not drawn whole, or it would show an earlier one."""
        if self._tools is None:
            return
        charts = [chart_path(self.paths, kind) for kind in KINDS]
        cards = [card_path(self.paths, who) for who in columns_of(self.has_truth)]
        for path in (*charts, *cards, marks_path(self.paths)):
            rec.log(path, rr.Clear(recursive=False))
        rec.log(table_path(self.paths), rr.TextDocument.from_fields(text=LEFT_OUT))
        self._cards.clear()

    def _draw_card(self, rec: rr.RecordingStream, column: Column, tools: _Tools) -> None:
        who, explained = column
        card = _card(explained, tools)
        if self._cards.get(who) != card:  # most of the size, and it often stays
            rec.log(card_path(self.paths, who), rr.EncodedImage.from_fields(blob=card))
            self._cards[who] = card

    def _draw_marks(self, rec: rr.RecordingStream, shown: Sequence[Column], tools: _Tools) -> None:
        entries = [None if explained is None else explained.entry for _, explained in shown]
        poses = np.array([np.zeros(3) if entry is None else entry.pose for entry in entries])
        length = np.where([entry is None for entry in entries], 0.0, tools.arrow)
        along = np.column_stack([np.cos(poses[:, 2]), -np.sin(poses[:, 2])]) * length[:, None]
        marks = rr.Arrows2D.from_fields(
            origins=self.scale.screen(poses[:, :2]),
            vectors=np.asarray(along, np.float32),
        )
        rec.log(marks_path(self.paths), marks)


def _tools_for(sensor: SensorModel, scale: Scale) -> _Tools:
    library = sensor.library
    thumbnail = cell_height(library.pictures)
    return _Tools(
        sensor=sensor,
        bars=bars_for(tuple(sensor.parameters.weights), library),
        thumbnail=thumbnail,
        height=card_height(thumbnail, CELL_PX),
        arrow=ARROW * scale.length(max(library.arena.size_m)),
    )


def _card(explained: Explained | None, tools: _Tools) -> bytes:
    if explained is None or explained.entry is None:
        return blank_card(tools.height, NOT_KNOWN if explained is None else OUTSIDE)
    return card_of(tools.sensor.library.pictures[explained.entry.entry], tools.thumbnail, tools.height)


def labels_on_map(shown: Sequence[Column]) -> list[str]:
    """Name each arrow; those of one reference are named together, at the last of them: "all" for all."""
    entries = [None if e is None or e.entry is None else e.entry.entry for _, e in shown]
    labels = []
    for k, entry in enumerate(entries):
        alike = [NAMES[shown[j][0]] for j, other in enumerate(entries) if other == entry]
        last = entry is not None and entry not in entries[k + 1 :]
        together = "all" if len(alike) == len(shown) > 1 else ", ".join(alike)
        labels.append(together if last else "")
    return labels


def headline(step: StepExplanation) -> str:
    """Say in a sentence or two who wins, and by how much over the reference that should."""
    winner = step.winner
    first = f"**Step {step.step}**: entry {winner.entry} matches best of {winner.entries}."
    rival = step.of(TRUTH) or step.of(ESTIMATE)
    if rival is None or rival.entry is None:
        return first
    of = "truth" if rival.who == TRUTH else "estimate"
    if rival.entry.entry == winner.entry:
        return f"{first} It is also the reference nearest to the {of}."
    most, costs = rival.entry.costliest(winner), rival.entry.lost_to(winner)
    gap = say_behind(rival.entry.behind)
    second = f"The one nearest to the {of}, entry {rival.entry.entry}, is {gap}"
    return f"{first} {second}; {float(costs.max()):.1f} of it by {most.channel}."
