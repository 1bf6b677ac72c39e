"""The explanation of a step: the references that matter, side by side.

Columns are the reference nearest to the truth (where it is known), the one nearest to the estimate, and the
winner. A chart has one color, so channels are distinguished by tints behind the bars, in the table's order.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.analysis.explanation import (
    ASKED,
    ESTIMATE,
    TRUTH,
    WINNER,
    Explained,
    StepExplanation,
    explain_step,
)
from maurice_mcl.arrays import F32, U8
from maurice_mcl.sensor.descriptors.edges import edge_image
from maurice_mcl.sensor.model import SensorModel

from .. import entities
from .. import style as look
from ..drawing.bars import REFERENCE, REFERENCE_BAR, SAMPLE, SAMPLE_BAR, Bars, bars_for, place_bars, tensor_of
from ..drawing.canvas import brightened, jpeg, put_text, text_size
from ..drawing.contact_sheet import CELL_PX, KEPT, NOT_KEPT, cell_height, thumbnail_of
from ..drawing.keys import explain_key
from ..entities import Phase, RunPaths
from ..scene import SceneInfo
from ..style import BAR, GROUND, MISSING, PALE, RANK, RGB, TINTS
from ..text.explanation import say_behind
from ..text.explanation_table import markdown_table
from .camera import draw_jpeg, prepare_jpeg
from .panel import MARKDOWN, DrawnRun, Panel, StepUpdate, set_phase
from .views import MAP, bars_view, map_view, picture_view

COLORS: dict[str, RGB] = {TRUTH: look.TRUTH, ESTIMATE: look.ESTIMATE, WINNER: RANK, ASKED: (86, 180, 233)}
NAMES = {TRUTH: "truth's", ESTIMATE: "estimate's", WINNER: "winner", ASKED: "asked for"}
OUTSIDE = "outside free space"
NOT_KNOWN = "truth not known here"
KINDS = ("sample", "reference", "cost")  # of bars

Column = tuple[str, Explained | None]  # which reference; None: the truth is not known at this update


def columns_of(has_truth: bool) -> tuple[str, ...]:
    """Return the references that have a column."""
    return (TRUTH, ESTIMATE, WINNER) if has_truth else (ESTIMATE, WINNER)


FOOT_NATS = 0.3  # height of the tints in the chart of costs; higher bars make the chart grow
ARROW = 0.035  # length of the arrows on the map, as a share of the arena's long side
THICKNESS = (4.5, 3.0, 1.5)  # radii in points: arrows on top of each other are all visible
LEFT_OUT = "Not drawn at this update (`--detail`)."
NO_LIBRARY = "What the picture was compared with is not available."
CARD_PX = 120  # width: with 144 px three of them were 16 kB an update
CARD_GAP_PX = 4  # between picture and edges
CARD_QUALITY = 60  # 3.8 kB a card; edges are most of it
CARD_TEXT_PX = 9.0
CARD_TITLES = {TRUTH: "Truth's reference", ESTIMATE: "Estimate's reference", WINNER: "Winning reference"}
MOST_NAMED = 6  # channels that a title lists
LOSES = "of each channel: nats it loses · distance D · quality · rank"
SIDES = {2: "left {}, right {}", 3: "left {}, middle {}, right {}"}


class ExplanationPanel(Panel):
    """Draws the explanation of each step; empty for a saved run without its library."""

    def __init__(self, run: DrawnRun) -> None:
        super().__init__(run)
        self._has_truth = run.has_truth
        self._references = None if run.sensor is None else _References(run.sensor)
        self._cards: dict[str, bytes] = {}  # last logged, by column

    def prepare(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            rec.log(
                self._paths.explain("table"), rr.TextDocument(NO_LIBRARY, media_type=MARKDOWN), static=True
            )
            return
        whose = columns_of(self._has_truth)
        rec.log(self._paths.explain("table"), rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        for who in whose:
            prepare_jpeg(rec, self._paths.explain("card", who), order=-10.0)
        _prepare_charts(rec, self._paths, self._references.bars, len(whose))
        thick = rr.components.Radius.ui_points(THICKNESS[-len(whose) :])
        colors = [COLORS[who] for who in whose]
        style = rr.Arrows2D.from_fields(colors=colors, radii=thick, draw_order=60.0)
        rec.log(self._paths.explain("marks"), style, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, references = update.record, self._references
        if not update.whole or references is None or not len(record.sighting.comparison.quality):
            return
        step = explain_step(record, references.sensor, update.moment.truth if self._has_truth else None)
        shown = [(who, step.of(who)) for who in columns_of(self._has_truth)]
        set_phase(rec, update.moment, Phase.ESTIMATE)
        for who, explained in shown:
            card = references.card(explained)
            if self._cards.get(who) != card:  # most of the size, and it often stays
                draw_jpeg(rec, self._paths.explain("card", who), card)
                self._cards[who] = card
        _draw_charts(rec, self._paths, references.bars, step, shown)
        self._draw_marks(rec, shown, references.sensor)
        text = f"{headline(step)}\n\n{markdown_table(step, self._scale)}"
        rec.log(self._paths.explain("table"), rr.TextDocument.from_fields(text=text))

    def clear(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            return
        charts = [self._paths.explain("chart", kind) for kind in KINDS]
        cards = [self._paths.explain("card", who) for who in columns_of(self._has_truth)]
        for path in (*charts, *cards, self._paths.explain("marks")):
            rec.log(path, rr.Clear(recursive=False))
        rec.log(self._paths.explain("table"), rr.TextDocument.from_fields(text=LEFT_OUT))
        self._cards.clear()

    def _draw_marks(self, rec: rr.RecordingStream, shown: Sequence[Column], sensor: SensorModel) -> None:
        entries = [None if explained is None else explained.entry for _, explained in shown]
        poses = np.array([np.zeros(3) if entry is None else entry.pose for entry in entries])
        arrow = ARROW * self._scale.length(max(sensor.library.arena.size_m))
        length = np.where([entry is None for entry in entries], 0.0, arrow)
        along = np.column_stack([np.cos(poses[:, 2]), -np.sin(poses[:, 2])]) * length[:, None]
        marks = rr.Arrows2D.from_fields(
            origins=self._scale.screen(poses[:, :2]), vectors=np.asarray(along, np.float32)
        )
        rec.log(self._paths.explain("marks"), marks)


class _References:
    """The references of a sensor model, as bars and as cards."""

    def __init__(self, sensor: SensorModel) -> None:
        self.sensor = sensor
        self.bars = bars_for(tuple(sensor.parameters.weights), sensor.library)
        self._thumbnail = cell_height(sensor.library.pictures)
        self._height = max(1, round(CARD_PX * self._thumbnail / CELL_PX))  # of one picture on a card

    def card(self, explained: Explained | None) -> bytes:
        """Return the card of a reference: its picture over its edges, as a JPEG."""
        if explained is None or explained.entry is None:
            return blank_card(self._height, NOT_KNOWN if explained is None else OUTSIDE)
        return card_of(self.sensor.library.pictures[explained.entry.entry], self._thumbnail, self._height)


@lru_cache(maxsize=KEPT)
def card_of(path: Path | None, cell_height: int, height: int) -> bytes:
    """Return the card of a reference's picture; gray with a reason if the picture is not available."""
    thumbnail = None if path is None else thumbnail_of(path, cell_height)
    if thumbnail is None:
        return blank_card(height, NOT_KEPT)
    picture = np.asarray(cv2.resize(thumbnail, (CARD_PX, height), interpolation=cv2.INTER_AREA), np.uint8)
    return jpeg(_stacked(picture, brightened(edge_image(picture))), CARD_QUALITY)


@lru_cache(maxsize=8)
def blank_card(height: int, words: str) -> bytes:
    """Return a card with the reason why it has no picture."""
    gray = np.full((height, CARD_PX, 3), MISSING, np.uint8)
    width, _ = text_size(words, CARD_TEXT_PX)
    small = min(CARD_TEXT_PX, CARD_TEXT_PX * (CARD_PX - 6) / max(width, 1))
    worded = gray.copy()
    put_text(worded, words, 3, height / 2 + small / 2, small, PALE)
    return jpeg(_stacked(worded, gray), CARD_QUALITY)


def _stacked(picture: U8, edges: U8) -> U8:
    between = np.full((CARD_GAP_PX, picture.shape[1], 3), GROUND, np.uint8)
    return np.concatenate([picture, between, edges])


def _prepare_charts(rec: rr.RecordingStream, paths: RunPaths, bars: Bars, blocks: int) -> None:
    for kind, height in (("tints", 1.0), ("feet", FOOT_NATS)):
        for number in range(len(bars.channels)):
            at = np.array([bars.left_of(block) + number for block in range(blocks)], np.float32)
            tops, wide = np.full(blocks, height, np.float32), np.ones(blocks, np.float32)
            band = rr.BarChart(tops, abscissa=at, widths=wide, color=TINTS[number % len(TINTS)])
            rec.log(f"{paths.at('explain', 'chart', kind)}/{number}", band, static=True)
    lefts = np.concatenate([bars.lefts + bars.left_of(block) for block in range(blocks)])
    widths = np.tile(bars.widths, blocks)
    for kind, color, offset, width in (
        ("reference", REFERENCE, *REFERENCE_BAR),
        ("sample", SAMPLE, *SAMPLE_BAR),
        ("cost", BAR, 0.0, 1.0),
    ):
        place_bars(rec, paths.explain("chart", kind), color, lefts + offset * widths, width * widths)


def _draw_charts(
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
        rec.log(paths.explain("chart", kind), rr.BarChart.from_fields(values=tensor_of(values)))


def _block(bars: Bars, column: Column) -> tuple[F32, F32]:
    _, explained = column
    if explained is None or explained.entry is None:
        nothing = np.zeros(len(bars.starts), np.float32)
        return nothing, nothing
    channels = explained.entry.channels
    costs = bars.divided([c.loses for c in channels], [c.contributions for c in channels])
    return bars.heights([c.reference for c in channels]), costs


def labels_on_map(shown: Sequence[Column]) -> list[str]:
    """Return the arrows' labels; arrows of one reference share one, at the last of them: "all" for all."""
    entries = [None if e is None or e.entry is None else e.entry.entry for _, e in shown]
    labels = []
    for k, entry in enumerate(entries):
        alike = [NAMES[shown[j][0]] for j, other in enumerate(entries) if other == entry]
        last = entry is not None and entry not in entries[k + 1 :]
        together = "all" if len(alike) == len(shown) > 1 else ", ".join(alike)
        labels.append(together if last else "")
    return labels


def headline(step: StepExplanation) -> str:
    """Return a sentence or two: which reference wins, and by how much over the one nearest to the truth."""
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


def references_map_view(paths: RunPaths, scene: SceneInfo) -> rrb.Spatial2DView:
    """Show where the references of the columns are, over the match circles and under truth and estimate."""
    contents = [*MAP, entities.EXPLAIN_KEY, paths.circles, paths.explain("marks"), f"{paths.estimate}/**"]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    name = f"Match circles, and the references explained ({scene.scale.units.name})"
    return map_view(name, contents, scene, key=explain_key(scene.has_truth))


def card_view(paths: RunPaths, who: str) -> rrb.Spatial2DView:
    """Show a reference's picture over its edges."""
    return picture_view(CARD_TITLES[who], paths.explain("card", who))


def descriptors_view(paths: RunPaths, whose: Sequence[str]) -> rrb.BarChartView:
    """Show the descriptors of all references, a block a reference."""
    sides = SIDES[len(whose)].format(*(NAMES[who] for who in whose))
    name = f"Descriptors (1: usual top): picture blue, reference orange, both pale; {sides}"
    return bars_view(name, [paths.explain("chart", kind) for kind in ("tints", "reference", "sample")])


def costs_view(paths: RunPaths, channels: Sequence[str]) -> rrb.BarChartView:
    """Show what each element costs each reference."""
    many = len(channels) > MOST_NAMED
    names = f"{len(channels)} channels as in the table" if many else ", ".join(channels)
    name = f"What each element costs (nats; tint {FOOT_NATS:g} high): {names}"
    return bars_view(name, [paths.explain("chart", kind) for kind in ("feet", "cost")])


def figures_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show the figures of all references in a table."""
    return rrb.TextDocumentView(name=f"Figures ({LOSES})", origin=paths.explain("table"))
