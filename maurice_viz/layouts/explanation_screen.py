"""One update explained at full size, as a recording of its own: full pictures and charts."""

from __future__ import annotations

from dataclasses import dataclass

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
)
from maurice_mcl.arrays import U8
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.descriptors.edges import edge_image
from maurice_mcl.session import Moment

from .. import entities
from ..drawing.canvas import EDGE_GAIN, brightened, jpeg, long_side, png, put_text
from ..drawing.contact_sheet import NOT_KEPT, read_picture
from ..drawing.heat import CHART
from ..drawing.reference_chart import draw_chart_key, draw_reference_chart, scale_of
from ..entities import Phase, RunPaths
from ..panels.belief import draw_cloud, estimate_marker, prepare_cloud, truth_marker
from ..panels.camera import camera_view, draw_camera, edges_view, prepare_camera
from ..panels.explanation import ARROW, OUTSIDE, colors_of, figures_view, headline, labels_on_map
from ..panels.panel import MARKDOWN, set_phase
from ..panels.references import MatchCircles
from ..panels.views import MAP, map_view, picture_view, window
from ..panels.world import draw_world
from ..scene import SceneInfo
from ..style import MISSING, PALE, RUN_COLORS, Scale
from ..text.explanation import say_step
from ..text.explanation_table import markdown_table, winner_first
from ..text.sensors import say_sensors

GRAY = (144, 176)  # rows and columns of the gray picture in place of a missing one
WHO = {TRUTH: "Truth's", ESTIMATE: "Estimate's", WINNER: "Best match", ASKED: "Asked for"}
ROWS = [0.9, 0.9, 1.35]  # shares of picture, edges and chart in a column
FINE_PX = (640, 600)  # width and height of a chart
NOTES = """
**Map**: circles are references, smaller the less likely (a dot: 8 or more nats below the best);
particles pale, truth a white disk, estimate an orange one.

**Charts**: the bar adds up to minus the log-likelihood; one nat less is 2.7 times less likely. Below
it each channel's descriptor and what its elements cost.

**Rank** 1 is the nearest, **quality** 0 the worst for this picture, **D** the channel's own distance.
"""


@dataclass(frozen=True, slots=True, eq=False)
class ExplainedUpdate:
    """The update to draw."""

    moment: Moment
    record: StepRecord
    step: StepExplanation
    library: Library
    scale: Scale

    @property
    def of_sensors(self) -> list[str]:
        """What the pose sensors say, a paragraph each."""
        return say_sensors(self.record, self.moment.truth, self.library.arena, self.scale)

    @property
    def has_truth(self) -> bool:
        """Whether the truth is known at this update."""
        return self.moment.truth is not None


def costliest_first(step: StepExplanation) -> list[int]:
    """Return channel numbers by what they cost the first reference other than the winner, else the winner."""
    others = [e.entry for e in step.shown if e.entry is not None and e.entry.entry != step.winner.entry]
    costs = others[0].lost_to(step.winner) if others else np.array([c.loses for c in step.winner.channels])
    return [int(k) for k in np.argsort(-costs, kind="stable")]


def draw_explanation(rec: rr.RecordingStream, paths: RunPaths, update: ExplainedUpdate) -> None:
    """Log everything, on all three timelines at the update's own place."""
    draw_world(rec, update.library, update.scale)
    set_phase(rec, update.moment, Phase.WEIGHT)
    prepare_camera(rec)
    draw_camera(rec, update.moment.frame.image)
    _draw_map(rec, paths, update)
    for explained in update.step.shown:
        _draw_pictures(rec, paths, explained, update.library)
    _draw_charts(rec, paths, update.step)
    sentences = say_step(update.step, update.scale) + update.of_sensors
    words = "\n\n".join([f"## {headline(update.step)}", f"**Step {update.step.step}**", *sentences])
    rec.log(paths.explain("notes"), rr.TextDocument(NOTES, media_type=MARKDOWN))
    rec.log(paths.explain("words"), rr.TextDocument(words, media_type=MARKDOWN))
    step = winner_first(update.step)
    table = markdown_table(step, update.scale, costliest_first(step))
    rec.log(paths.explain("table"), rr.TextDocument(table, media_type=MARKDOWN))


def _draw_map(rec: rr.RecordingStream, paths: RunPaths, update: ExplainedUpdate) -> None:
    record, scale = update.record, update.scale
    circles = MatchCircles(update.library, scale)
    circles.prepare(rec, paths)
    circles.draw(rec, paths, record.sighting.comparison)
    prepare_cloud(rec, paths.particles)
    draw_cloud(rec, paths.particles, record.weighted, scale)
    arena = update.library.arena
    markers = [(estimate_marker(paths.estimate, arena, scale), record.estimate.pose)]
    if update.moment.truth is not None:
        markers.append((truth_marker(entities.TRUTH, arena, scale), update.moment.truth))
    for marker, pose in markers:
        marker.prepare(rec)
        marker.draw(rec, pose)
    _draw_marks(rec, paths, update, ARROW * long_side(arena, scale))


def _draw_marks(rec: rr.RecordingStream, paths: RunPaths, update: ExplainedUpdate, arrow: float) -> None:
    shown = [(e.who, e) for e in update.step.shown if e.entry is not None]
    poses = np.array([e.entry.pose for _, e in shown if e.entry is not None])
    along = np.column_stack([np.cos(poses[:, 2]), -np.sin(poses[:, 2])]) * arrow
    colors = colors_of(RUN_COLORS[0])
    marks = rr.Arrows2D(
        origins=update.scale.screen(poses[:, :2]),
        vectors=np.asarray(along, np.float32),
        colors=[colors[who] for who, _ in shown],
        labels=labels_on_map(shown, max(update.library.arena.size_m)),
        show_labels=True,
        radii=rr.components.Radius.ui_points(2.0),
        draw_order=60.0,
    )
    rec.log(paths.explain("marks"), marks)


def _draw_pictures(rec: rr.RecordingStream, paths: RunPaths, explained: Explained, library: Library) -> None:
    picture = _picture(explained, library)
    edges = _gray("") if picture is None else brightened(edge_image(picture))
    if picture is None:
        picture = _gray(OUTSIDE if explained.entry is None else NOT_KEPT)
    for kind, image in (("picture", picture), ("edges", edges)):
        encoded = rr.EncodedImage(contents=jpeg(image), media_type="image/jpeg")
        rec.log(paths.explain(explained.who, kind), encoded)


def _picture(explained: Explained, library: Library) -> U8 | None:
    if explained.entry is None:
        return None
    path = library.pictures[explained.entry.entry]
    return None if path is None else read_picture(path)


def _gray(words: str) -> U8:
    gray = np.full((*GRAY, 3), MISSING, np.uint8)
    if words:
        put_text(gray, words, GRAY[1] * 0.06, GRAY[0] / 2, 10.0, PALE)
    return gray


def _draw_charts(rec: rr.RecordingStream, paths: RunPaths, step: StepExplanation) -> None:
    """Log the chart of each reference, all on one scale, and their key."""
    scale = scale_of([e.entry for e in step.shown if e.entry is not None])
    charts = {e.who: draw_reference_chart(e.entry, scale, FINE_PX) for e in step.shown}
    for who, chart in charts.items():
        rec.log(
            paths.explain(who, "chart"), rr.EncodedImage(contents=CHART.png(chart), media_type="image/png")
        )
    key = rr.EncodedImage(contents=png(draw_chart_key(FINE_PX)), media_type="image/png")
    rec.log(paths.explain("key"), key)


def explanation_blueprint(paths: RunPaths, step: StepExplanation, scene: SceneInfo) -> rrb.Blueprint:
    """Lay out map and words left; camera and references as columns right, over the table of their figures."""
    left = rrb.Vertical(
        _map_view(paths, scene),
        rrb.TextDocumentView(name="Why the best match wins", origin=paths.explain("words")),
        row_shares=[1, 1.1],
    )
    notes = rrb.TextDocumentView(name="How to read this", origin=paths.explain("notes"))
    figures = figures_view(paths, "nats lost · distance D · quality · rank")
    below = rrb.Horizontal(figures, notes, column_shares=[0.7 * len(step.shown), 1])
    shown = winner_first(step).shown
    columns = rrb.Horizontal(_camera_column(paths), *(_column(paths, one) for one in shown))
    right = rrb.Vertical(columns, below, row_shares=[24, 8.5 + len(step.channels)])
    return window(rrb.Horizontal(left, right, column_shares=[1, 2.1]))


def _map_view(paths: RunPaths, scene: SceneInfo) -> rrb.Spatial2DView:
    name = f"Match circles (smaller: less likely), particles, references ({scene.scale.units.name})"
    contents = [*MAP, paths.circles, paths.particles, paths.explain("marks"), f"{paths.estimate}/**"]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    return map_view(name, contents, scene, paths.particles)


def _camera_column(paths: RunPaths) -> rrb.Vertical:
    """Show what the robot saw, over the key of the charts beside it."""
    key = picture_view("Key of the charts", paths.explain("key"))
    return rrb.Vertical(camera_view(), edges_view(), key, row_shares=ROWS)


def _column(paths: RunPaths, explained: Explained) -> rrb.Vertical:
    """Show one reference: its picture, its edges, and what its channels lose."""
    who = explained.who
    entry = "none" if explained.entry is None else f"entry {explained.entry.entry}"
    return rrb.Vertical(
        picture_view(f"{WHO[who]}: {entry}", paths.explain(who, "picture")),
        picture_view(f"Its edges x {EDGE_GAIN}", paths.explain(who, "edges")),
        picture_view("What it loses (nats)", paths.explain(who, "chart")),
        row_shares=ROWS,
    )
