"""The explanation of a step: camera and the references that matter, side by side.

Columns are the camera, the winner, which matches best, the reference nearest to the truth (where it is
known), and the one nearest to the estimate. Under each picture are its edges and a chart of what its
channels lose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.explanation import (
    ESTIMATE,
    TRUTH,
    WINNER,
    Explained,
    explain_step,
)
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import U8

from .. import entities
from .. import style as look
from ..drawing.arrow import blob_of, points_of, row_of, text_of
from ..drawing.canvas import Extent, png
from ..drawing.contact_sheet import (
    CARD_GAP_PX,
    CARD_PX,
    blank_card,
    card_height,
    card_of,
    cell_height,
    edges_of,
)
from ..drawing.heat import CHART
from ..drawing.keys import EXPLAINED, explain_key
from ..drawing.reference_chart import draw_chart_key, draw_reference_chart, scale_of
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import RANK, RGB
from ..text.explanation import GLOSSARY, say_step
from ..text.explanation_table import brief_table, winner_first
from ..text.lesson import say_lesson
from .camera import SEES, draw_jpeg, draw_name, named_view, prepare_jpeg
from .panel import MARKDOWN, Panel, StepUpdate, set_phase
from .story import place_of
from .views import MAP, map_view, picture_view, plane_view

OUTSIDE_WORDS = "outside free space"
NO_TRUTH_WORDS = "truth not known here"

Column = tuple[str, Explained | None]  # which reference; None: the truth is not known at this update


def colors_of(run_color: RGB) -> dict[str, RGB]:
    """Return the color of each reference's arrow: the estimate's is the run's."""
    return {TRUTH: look.TRUTH, ESTIMATE: run_color, WINNER: RANK}


def columns_of(has_truth: bool) -> tuple[str, ...]:
    """Return the references that have a column."""
    return (WINNER, TRUTH, ESTIMATE) if has_truth else (WINNER, ESTIMATE)


ARROW_SHARE = 0.035  # length of the arrows on the map, as a share of the arena's long side
ARROW_PT = (4.5, 3.0, 1.5)  # radii in points: arrows on top of each other are all visible
LEFT_OUT_WORDS = "Not drawn at this step (`--detail`)."
ALIKE = "The picture fits all references alike."
NO_LIBRARY = "What the picture was compared with is not available."
CAMERA_CARD = "camera"
NARROW = 0.17  # of a card's width: how far above it its name stands
NAMES = {WINNER: "best match", TRUTH: "nearest to truth", ESTIMATE: "nearest to estimate"}


class ExplanationPanel(Panel):
    """Draws the explanation of each step; empty for a saved run without its library."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._has_truth = scene.has_truth
        self._references = None if run.sensor is None else _References(run.sensor)
        self._cards: dict[str, bytes] = {}  # last logged, by column
        self._camera, self._edges = (run.paths.explain(CAMERA_CARD, *part) for part in ((), ("edges",)))
        self._width = 0  # of the camera's pictures, in pixels; 0: not known yet

    def prepare(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            rec.log(
                self._paths.explain("table"), rr.TextDocument(NO_LIBRARY, media_type=MARKDOWN), static=True
            )
            return
        whose = columns_of(self._has_truth)
        for part in ("table", "words"):
            rec.log(self._paths.explain(part), rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        colors = colors_of(self._run.color)
        prepare_jpeg(rec, self._edges)
        draw_name(rec, self._camera, SEES, CARD_PX, look.TRUTH, NARROW)
        for who in whose:
            prepare_jpeg(rec, self._paths.explain("card", who))
            draw_name(rec, self._paths.explain("card", who), NAMES[who], CARD_PX, colors[who], NARROW)
            chart = rr.EncodedImage.from_fields(media_type="image/png", draw_order=look.Order.GROUND)
            rec.log(self._paths.explain("chart", who), chart, static=True)
        key = rr.EncodedImage(contents=png(draw_chart_key()), media_type="image/png")
        rec.log(self._paths.explain("key"), key, static=True)
        arrows = (*whose[1:], whose[0])  # the winner's, the thinnest, is on top
        thick = rr.components.Radius.ui_points(ARROW_PT[-len(arrows) :])
        style = rr.Arrows2D.from_fields(
            colors=[colors[who] for who in arrows], radii=thick, draw_order=look.Order.EXPLAINED
        )
        rec.log(self._paths.explain("marks"), style, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, references = update.record, self._references
        if not update.whole or references is None or not len(record.sighting.comparison.quality):
            return
        truth = update.moment.truth if self._has_truth else None
        step = winner_first(explain_step(record, references.sensor, truth))
        shown = [(who, step.of(who)) for who in columns_of(self._has_truth)]
        set_phase(rec, update.moment, Phase.MEASURE)  # with the camera's picture, which is not logged twice
        self._draw_edges(rec, update.moment.frame.image)
        for who, explained in shown:
            card = references.card(explained)
            if self._cards.get(who) != card:  # most of the size, and it often stays
                draw_jpeg(rec, self._paths.explain("card", who), card)
                self._cards[who] = card
        self._draw_charts(rec, shown)
        self._draw_marks(rec, [*shown[1:], shown[0]], references.sensor)
        place = place_of(update.moment, record, self._scene, None)
        lesson = say_lesson({self._run.label: place}, self._scale) or ALIKE
        words = "\n\n".join([f"#### {lesson}", *say_step(step, self._scale)[1:]])
        table = f"{brief_table(step, self._scale)}\n\n{GLOSSARY}"
        for part, text in (("words", words), ("table", table)):
            rec.log(self._paths.explain(part), row_of(rr.TextDocument, text=text_of(text)))

    def clear(self, rec: rr.RecordingStream) -> None:
        if self._references is None:
            return
        whose = columns_of(self._has_truth)
        charts = [self._paths.explain("chart", who) for who in whose]
        cards = [self._paths.explain("card", who) for who in whose]
        for path in (*charts, *cards, self._edges, self._paths.explain("marks")):
            rec.log(path, rr.Clear(recursive=False))
        for part in ("table", "words"):
            rec.log(self._paths.explain(part), rr.TextDocument.from_fields(text=LEFT_OUT_WORDS))
        self._cards.clear()

    def _draw_edges(self, rec: rr.RecordingStream, image: U8) -> None:
        """Log the edges of the camera's picture (H, W, 3), which stand under it as on a card."""
        height, width = image.shape[:2]
        if width != self._width:  # seen from here, the picture is as wide as a card
            self._width = width
            rec.log(self._camera, rr.Transform3D(scale=width / CARD_PX), static=True)
            below = [0, CARD_PX * height / width + CARD_GAP_PX, 0]
            rec.log(self._edges, rr.Transform3D(translation=below), static=True)
        draw_jpeg(rec, self._edges, edges_of(image))

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
        arrow = ARROW_SHARE * self._scale.length(max(sensor.library.arena.size_m))
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
        self._height = card_height(sensor.library.pictures)

    def card(self, explained: Explained | None) -> bytes:
        """Return the card of a reference: its picture over its edges, as a JPEG."""
        if explained is None or explained.entry is None:
            return blank_card(self._height, NO_TRUTH_WORDS if explained is None else OUTSIDE_WORDS)
        return card_of(self.sensor.library.pictures[explained.entry.entry], self._thumbnail, self._height)


def references_map_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show where the references of the columns are, over the match circles and under truth and estimate."""
    contents = [
        *MAP,
        paths.key(EXPLAINED),
        paths.circles,
        paths.says_nothing,
        paths.explain("marks"),
        f"{paths.estimate}/**",
    ]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    name = f"References explained ({scene.scale.units.name})"
    return map_view(name, contents, scene, key=explain_key(scene.has_truth))


def camera_card_view(run: RunView, scene: Scene) -> rrb.Spatial2DView:
    """Show what the robot saw by name, over its edges, as large as the cards beside it."""
    path, camera = run.paths.explain(CAMERA_CARD), entities.camera_of(run.label, run.own_drive)
    extent = Extent(0, CARD_PX, -NARROW * CARD_PX, 2 * card_height(scene.library.pictures) + CARD_GAP_PX)
    return plane_view(SEES, [camera, f"{path}/**"], extent, origin=path)


def card_view(paths: RunPaths, who: str) -> rrb.Spatial2DView:
    """Show the picture of a reference by name, over its edges."""
    return named_view(NAMES[who], paths.explain("card", who))


def chart_view(paths: RunPaths, who: str) -> rrb.Spatial2DView:
    """Show what a reference loses; under the camera the key of all charts."""
    if who == CAMERA_CARD:
        return picture_view("Key of the charts", paths.explain("key"))
    return picture_view(f"What {NAMES[who]} loses", paths.explain("chart", who))


def sentence_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show why the winner wins and where the others lose, in sentences."""
    return rrb.TextDocumentView(name="Why the best match wins", origin=paths.explain("words"))


def figures_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show the figures of all references in a table."""
    return rrb.TextDocumentView(name="Figures", origin=paths.explain("table"))
