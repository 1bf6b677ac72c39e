"""The explanation of a step: camera and the references that matter, side by side.

Columns are the camera, the winner, which matches best, the reference nearest to the truth (where it is
known), and the one nearest to the estimate. Under each picture are its edges and a chart of what its
channels lose.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.explanation import (
    ESTIMATE,
    TRUTH,
    WINNER,
    Explained,
    StepExplanation,
    explain_step,
)
from maurice_mcl.sensor.descriptors.edges import edge_image
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values.arrays import U8

from .. import entities
from .. import style as look
from ..drawing.arrow import blob_of, points_of, row_of, text_of
from ..drawing.canvas import blank, brightened, jpeg, png, put_text, shrunk, text_size
from ..drawing.contact_sheet import CELL_PX, KEPT, NOT_KEPT, cell_height, thumbnail_of
from ..drawing.heat import CHART
from ..drawing.keys import EXPLAINED, explain_key
from ..drawing.reference_chart import draw_chart_key, draw_reference_chart, scale_of
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import GROUND, MISSING, PALE, RANK, RGB
from ..text.explanation import REFERENCES, say_step
from ..text.explanation_table import brief_table, winner_first
from .camera import draw_jpeg, prepare_jpeg
from .panel import MARKDOWN, Panel, StepUpdate, set_phase
from .views import MAP, map_view, picture_view

OUTSIDE = "outside free space"
NOT_KNOWN = "truth not known here"

Column = tuple[str, Explained | None]  # which reference; None: the truth is not known at this update


def colors_of(run_color: RGB) -> dict[str, RGB]:
    """Return the color of each reference's arrow: the estimate's is the run's."""
    return {TRUTH: look.TRUTH, ESTIMATE: run_color, WINNER: RANK}


def columns_of(has_truth: bool) -> tuple[str, ...]:
    """Return the references that have a column."""
    return (WINNER, TRUTH, ESTIMATE) if has_truth else (WINNER, ESTIMATE)


LETTER, LINE = 0.0125, 0.05  # width and height of a label's letter, as shares of the arena's long side
ARROW = 0.035  # length of the arrows on the map, as a share of the arena's long side
THICKNESS = (4.5, 3.0, 1.5)  # radii in points: arrows on top of each other are all visible
LEFT_OUT = "Not drawn at this step (`--detail`)."
NO_LIBRARY = "What the picture was compared with is not available."
CARD_PX = 120  # width: with 144 px three of them were 16 kB an update
CARD_GAP_PX = 4  # between picture and edges
CARD_QUALITY = 60  # 3.8 kB a card; edges are most of it
CARD_TEXT_PX = 9.0
CAMERA_CARD = "camera"
CAMERA_TITLE = "Camera, edges"


class ExplanationPanel(Panel):
    """Draws the explanation of each step; empty for a saved run without its library."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._has_truth = scene.has_truth
        self._references = None if run.sensor is None else _References(run.sensor)
        self._cards: dict[str, bytes] = {}  # last logged, by column

    def prepare(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            rec.log(
                self._paths.explain("table"), rr.TextDocument(NO_LIBRARY, media_type=MARKDOWN), static=True
            )
            return
        whose = columns_of(self._has_truth)
        for part in ("table", "words"):
            rec.log(self._paths.explain(part), rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        for who in (CAMERA_CARD, *whose):
            prepare_jpeg(rec, self._paths.explain("card", who), order=-10.0)
        for who in whose:
            chart = rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)
            rec.log(self._paths.explain("chart", who), chart, static=True)
        key = rr.EncodedImage(contents=png(draw_chart_key()), media_type="image/png")
        rec.log(self._paths.explain("key"), key, static=True)
        arrows = (*whose[1:], whose[0])  # the winner's, the thinnest, is on top
        thick = rr.components.Radius.ui_points(THICKNESS[-len(arrows) :])
        of = colors_of(self._run.color)
        colors = [of[who] for who in arrows]
        style = rr.Arrows2D.from_fields(colors=colors, radii=thick, draw_order=60.0)
        rec.log(self._paths.explain("marks"), style, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, references = update.record, self._references
        if not update.whole or references is None or not len(record.sighting.comparison.quality):
            return
        truth = update.moment.truth if self._has_truth else None
        step = winner_first(explain_step(record, references.sensor, truth))
        shown = [(who, step.of(who)) for who in columns_of(self._has_truth)]
        set_phase(rec, update.moment, Phase.ESTIMATE)
        cards = [(who, references.card(explained)) for who, explained in shown]
        for who, card in [(CAMERA_CARD, references.card_of_camera(update.moment.frame.image)), *cards]:
            if self._cards.get(who) != card:  # most of the size, and it often stays
                draw_jpeg(rec, self._paths.explain("card", who), card)
                self._cards[who] = card
        self._draw_charts(rec, shown)
        self._draw_marks(rec, [*shown[1:], shown[0]], references.sensor)
        words = "\n\n".join([f"## {headline(step)}", *say_step(step, self._scale)[1:]])
        for part, text in (("words", words), ("table", brief_table(step, self._scale))):
            rec.log(self._paths.explain(part), row_of(rr.TextDocument, text=text_of(text)))

    def clear(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            return
        whose = columns_of(self._has_truth)
        charts = [self._paths.explain("chart", who) for who in whose]
        cards = [self._paths.explain("card", who) for who in (CAMERA_CARD, *whose)]
        for path in (*charts, *cards, self._paths.explain("marks")):
            rec.log(path, rr.Clear(recursive=False))
        for part in ("table", "words"):
            rec.log(self._paths.explain(part), rr.TextDocument.from_fields(text=LEFT_OUT))
        self._cards.clear()

    def _draw_charts(self, rec: rr.RecordingStream, shown: Sequence[Column]) -> None:
        entries = [None if explained is None else explained.entry for _, explained in shown]
        scale = scale_of([entry for entry in entries if entry is not None])
        drawn: dict[int | None, bytes] = {}  # by entry: columns often have the same
        for (who, _), entry in zip(shown, entries, strict=True):
            number = None if entry is None else entry.entry
            if number not in drawn:
                drawn[number] = CHART.png(draw_reference_chart(entry, scale))
            chart = row_of(rr.EncodedImage, blob=blob_of(drawn[number]))
            rec.log(self._paths.explain("chart", who), chart)

    def _draw_marks(self, rec: rr.RecordingStream, shown: Sequence[Column], sensor: SensorModel) -> None:
        entries = [None if explained is None else explained.entry for _, explained in shown]
        poses = np.array([np.zeros(3) if entry is None else entry.pose for entry in entries])
        arrow = ARROW * self._scale.length(max(sensor.library.arena.size_m))
        length = np.where([entry is None for entry in entries], 0.0, arrow)
        along = np.column_stack([np.cos(poses[:, 2]), -np.sin(poses[:, 2])]) * length[:, None]
        origins = points_of(self._scale.screen(poses[:, :2]))
        marks = row_of(rr.Arrows2D, origins=origins, vectors=points_of(along))
        rec.log(self._paths.explain("marks"), marks)


class _References:
    """The references of a sensor model, as cards."""

    def __init__(self, sensor: SensorModel) -> None:
        self.sensor = sensor
        self._thumbnail = cell_height(sensor.library.pictures)
        self._height = max(1, round(CARD_PX * self._thumbnail / CELL_PX))  # of one picture on a card

    def card(self, explained: Explained | None) -> bytes:
        """Return the card of a reference: its picture over its edges, as a JPEG."""
        if explained is None or explained.entry is None:
            return blank_card(self._height, NOT_KNOWN if explained is None else OUTSIDE)
        return card_of(self.sensor.library.pictures[explained.entry.entry], self._thumbnail, self._height)

    def card_of_camera(self, image: U8) -> bytes:
        """Return the card of the camera's picture (H, W, 3)."""
        return _card(image, round(CARD_PX * image.shape[0] / image.shape[1]))


@lru_cache(maxsize=KEPT)
def card_of(path: Path | None, cell_height: int, height: int) -> bytes:
    """Return the card of a reference's picture; gray with a reason if the picture is not available."""
    thumbnail = None if path is None else thumbnail_of(path, cell_height)
    if thumbnail is None:
        return blank_card(height, NOT_KEPT)
    return _card(thumbnail, height)


def _card(image: U8, height: int) -> bytes:
    picture = shrunk(image, CARD_PX, max(height, 1))
    return jpeg(_stacked(picture, brightened(edge_image(picture))), CARD_QUALITY)


@lru_cache(maxsize=8)
def blank_card(height: int, words: str) -> bytes:
    """Return a card with the reason why it has no picture."""
    gray = blank(height, CARD_PX, MISSING)
    width, _ = text_size(words, CARD_TEXT_PX)
    small = min(CARD_TEXT_PX, CARD_TEXT_PX * (CARD_PX - 6) / max(width, 1))
    worded = gray.copy()
    put_text(worded, words, 3, height / 2 + small / 2, small, PALE)
    return jpeg(_stacked(worded, gray), CARD_QUALITY)


def _stacked(picture: U8, edges: U8) -> U8:
    between = blank(CARD_GAP_PX, picture.shape[1], GROUND)
    return np.concatenate([picture, between, edges])


def labels_on_map(shown: Sequence[Column], side_m: float = 0.0) -> list[str]:
    """Return the arrows' labels; those that would overlap on a map of this size share one: "all" for all."""
    poses = {k: e.entry.pose for k, (_, e) in enumerate(shown) if e is not None and e.entry is not None}
    labels = [REFERENCES[who].label if k in poses else "" for k, (who, _) in enumerate(shown)]
    groups = [[k] for k in poses]
    joined = True
    while joined:
        joined = False
        for one, other in combinations(groups, 2):
            apart = np.abs(poses[one[-1]] - poses[other[-1]])[:2] / max(side_m, 1e-9)
            letters = len(labels[one[-1]]) + len(labels[other[-1]]) + 2  # and the boxes around them
            if apart[0] <= LETTER * letters / 2 and apart[1] <= LINE:
                groups = [group for group in groups if group not in (one, other)] + [sorted(one + other)]
                last = groups[-1][-1]
                for k in groups[-1]:
                    labels[k] = ""
                labels[last] = ", ".join(REFERENCES[shown[k][0]].label for k in groups[-1])
                joined = True
                break
    everything = len(groups) == 1 and len(groups[0]) == len(shown) > 1
    return [*labels[:-1], "all"] if everything else labels


def headline(step: StepExplanation) -> str:
    """Return a sentence or two: which reference wins, and by how much over the one nearest to the truth."""
    winner = step.winner
    first = f"Best match: entry {winner.entry} of {winner.entries}"
    rival = step.of(TRUTH) or step.of(ESTIMATE)
    if rival is None or rival.entry is None:
        return f"{first}."
    of = rival.who
    if rival.entry.entry == winner.entry:
        return f"{first}, which is also the reference nearest to the {of}."
    most, costs = rival.entry.costliest(winner), rival.entry.lost_to(winner)
    by = f", {costs.max():.1f} by {most.channel}" if len(costs) > 1 else f" by {most.channel}"
    behind = f"{rival.entry.behind:.1f} nats behind{by}"
    return f"{first}. {of.capitalize()}'s reference is {behind}."


def references_map_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show where the references of the columns are, over the match circles and under truth and estimate."""
    contents = [*MAP, paths.key(EXPLAINED), paths.circles, paths.explain("marks"), f"{paths.estimate}/**"]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    name = f"Match circles, and the references explained ({scene.scale.units.name})"
    return map_view(name, contents, scene, key=explain_key(scene.has_truth))


def column_view(paths: RunPaths, who: str) -> rrb.Vertical:
    """Show a picture over its edges, and under it the chart of the reference, or the key of the charts."""
    is_camera = who == CAMERA_CARD
    chart = paths.explain("key") if is_camera else paths.explain("chart", who)
    return rrb.Vertical(
        picture_view(CAMERA_TITLE if is_camera else REFERENCES[who].title, paths.explain("card", who)),
        picture_view("Key of the charts" if is_camera else "What it loses (nats)", chart),
        row_shares=[1.25, 1],
    )


def sentence_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show why the winner wins and where the others lose, in sentences."""
    return rrb.TextDocumentView(name="Why the best match wins", origin=paths.explain("words"))


def figures_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show the figures of all references in a table."""
    return rrb.TextDocumentView(name="Figures (channels: nats lost · rank)", origin=paths.explain("table"))
