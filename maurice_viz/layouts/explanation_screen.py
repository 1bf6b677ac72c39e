"""One update explained at full size, as a recording of its own: full pictures, one chart per channel."""

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
    ChannelExplanation,
    Explained,
    StepExplanation,
)
from maurice_mcl.arrays import U8
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.descriptors.edges import edge_image
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.session import Moment

from .. import entities
from ..drawing.bars import REFERENCE, REFERENCE_BAR, SAMPLE, SAMPLE_BAR, SMALLEST, bands_of
from ..drawing.canvas import EDGE_GAIN, brightened, jpeg, long_side, put_text
from ..drawing.contact_sheet import NOT_KEPT, read_picture
from ..entities import Phase, RunPaths
from ..panels.belief import draw_cloud, estimate_marker, prepare_cloud, truth_marker
from ..panels.camera import camera_view, draw_camera, edges_view, prepare_camera
from ..panels.explanation import ARROW, COLORS, OUTSIDE, figures_view, labels_on_map
from ..panels.panel import MARKDOWN, set_phase
from ..panels.references import MatchCircles
from ..panels.views import MAP, bars_view, map_view, picture_view, window
from ..panels.world import draw_world
from ..scene import SceneInfo
from ..style import BAR, MISSING, PALE, Scale
from ..text.explanation import say_step
from ..text.explanation_table import markdown_table

GRAY = (144, 176)  # rows and columns of the gray picture in place of a missing one
WHO = {TRUTH: "Truth's", ESTIMATE: "Estimate's", WINNER: "Winner", ASKED: "Asked for"}
NOTES = """
**Columns**: the references nearest to truth and estimate, and the winner, which matches best.

**Map**: particles white, truth a white disk, estimate an orange one.

**Descriptors**: the picture's blue, the reference's orange; bins of red, green and blue on
grounds of their color.

**Nats**: what each element costs. All bars of a reference, over all channels, add up to minus its
log-likelihood. One nat less is 2.7 times less likely.

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
        for number, channel in enumerate(update.step.channels):
            _draw_charts(rec, paths, explained, number, channel, update)
    words = "\n\n".join([f"**Step {update.step.step}**", *say_step(update.step, update.scale)])
    rec.log(paths.explain("notes"), rr.TextDocument(NOTES, media_type=MARKDOWN))
    rec.log(paths.explain("words"), rr.TextDocument(words, media_type=MARKDOWN))
    table = markdown_table(update.step, update.scale, costliest_first(update.step))
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
    marks = rr.Arrows2D(
        origins=update.scale.screen(poses[:, :2]),
        vectors=np.asarray(along, np.float32),
        colors=[COLORS[who] for who, _ in shown],
        labels=labels_on_map(shown),
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


def _draw_charts(
    rec: rr.RecordingStream,
    paths: RunPaths,
    explained: Explained,
    number: int,
    channel: str,
    update: ExplainedUpdate,
) -> None:
    """Log one channel's bars of one reference; charts of a channel are equally high for all references."""
    found = [e.entry.channels[number] for e in update.step.shown if e.entry is not None]
    mine = None if explained.entry is None else explained.entry.channels[number]
    top = max(float(max(c.sample.max(), c.reference.max())) for c in found)
    most = max(float(c.nats.max()) for c in found)
    for kind, height in (("descriptor", top), ("cost", most)):
        path = paths.explain(explained.who, channel, kind)
        for plane, color in enumerate(bands_of(len(found[0].sample))):
            ground = [max(height, SMALLEST)]
            band = rr.BarChart(ground, abscissa=[float(plane)], widths=[1.0], color=color)
            rec.log(f"{path}/ground/{plane}", band)
    if mine is not None:
        _draw_bars(rec, paths, explained.who, mine)


def _draw_bars(rec: rr.RecordingStream, paths: RunPaths, who: str, mine: ChannelExplanation) -> None:
    size = len(mine.sample)
    one = len(bands_of(size)) / size
    lefts = np.arange(size, dtype=np.float32) * np.float32(one)
    wide = np.full(size, one, np.float32)
    descriptor = paths.explain(who, mine.channel, "descriptor")
    for name, values, color, offset, width in (
        ("reference", mine.reference, REFERENCE, *REFERENCE_BAR),
        ("sample", mine.sample, SAMPLE, *SAMPLE_BAR),
    ):
        at = lefts + np.float32(offset * one)
        bars = rr.BarChart(values, abscissa=at, widths=wide * np.float32(width), color=color)
        rec.log(f"{descriptor}/{name}", bars)
    cost = rr.BarChart(mine.nats, abscissa=lefts, widths=wide, color=BAR)
    rec.log(f"{paths.at('explain', who, mine.channel, 'cost')}/nats", cost)


def explanation_blueprint(paths: RunPaths, step: StepExplanation, scene: SceneInfo) -> rrb.Blueprint:
    """Lay out map, camera and words left; a column a reference right, over the table of their figures."""
    left = rrb.Vertical(
        _map_view(paths, scene),
        rrb.Horizontal(camera_view(), edges_view()),
        rrb.TextDocumentView(name="Why the winner wins", origin=paths.explain("words")),
        row_shares=[1.7, 0.85, 2.3],
    )
    notes = rrb.TextDocumentView(name="How to read this", origin=paths.explain("notes"))
    below = rrb.Horizontal(figures_view(paths), notes, column_shares=[0.7 * len(step.shown), 1])
    columns = rrb.Horizontal(*(_column(paths, one, step) for one in step.shown))
    right = rrb.Vertical(columns, below, row_shares=[24, 8.5 + len(step.channels)])
    return window(rrb.Horizontal(left, right, column_shares=[1, 2.1]))


def _map_view(paths: RunPaths, scene: SceneInfo) -> rrb.Spatial2DView:
    name = f"Match circles (smaller: less likely), particles, references ({scene.scale.units.name})"
    contents = [*MAP, paths.circles, paths.particles, paths.explain("marks"), f"{paths.estimate}/**"]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    return map_view(name, contents, scene, paths.particles)


def _column(paths: RunPaths, explained: Explained, step: StepExplanation) -> rrb.Vertical:
    """Show one reference; the channel that costs most has the first tab, the same in all columns."""
    who, channels = explained.who, [step.channels[k] for k in costliest_first(step)]
    entry = "none" if explained.entry is None else f"entry {explained.entry.entry}"
    units = [CHANNELS[c].unit if c in CHANNELS else "its own unit" for c in channels]
    descriptors = [
        bars_view(f"{c} ({unit})", [paths.explain(who, c, "descriptor")])
        for c, unit in zip(channels, units, strict=True)
    ]
    costs = [bars_view(f"{c}, nats", [paths.explain(who, c, "cost")]) for c in channels]
    return rrb.Vertical(
        picture_view(f"{WHO[who]}: {entry}", paths.explain(who, "picture")),
        picture_view(f"Its edges x {EDGE_GAIN}", paths.explain(who, "edges")),
        rrb.Tabs(*descriptors, active_tab=0),
        rrb.Tabs(*costs, active_tab=0),
        row_shares=[0.9, 0.9, 1.2, 1.2],
    )
