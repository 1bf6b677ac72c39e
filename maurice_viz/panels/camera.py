"""What the robot saw: the picture, its edges, and histograms of it over those of its best match.

Static bands behind the bars separate red, green and blue, and fix the height, so that steps can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.sensor.descriptors.histograms import edge_image
from maurice_mcl.values.arrays import F32, U8

from .. import entities
from ..drawing.arrow import blob_of, row_of, tensor_of
from ..drawing.bars import (
    REFERENCE_BAR,
    SAMPLE_BAR,
    bands_of,
    place_bars,
    usual_height,
)
from ..drawing.canvas import EDGE_GAIN, brightened, jpeg, put_text
from ..drawing.heat import AXES_WORDS, CHART, GRIDS, HEATS, grid_of, heat_of, titled_heat
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import GROUND, MISSING, PALE, PICTURE, REFERENCE, RGB, TRUTH, font_safe
from .panel import Panel, StepUpdate, set_phase, set_phase_only
from .views import bars_view, picture_view

NAME, SEES = "name", "the robot sees"
EDGES_QUALITY = 75  # for display; the channel measures the picture itself


class CameraPanel(Panel):
    """Draws the picture of each update, and its edges."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        prepare_camera(rec)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the picture; in the very first phase, before a picture is taken, a gray one."""
        image = update.moment.frame.image
        if update.is_first:
            draw_name(rec, entities.CAMERA, SEES, image.shape[1], TRUTH)
        if update.whole and update.is_first:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            gray = np.full(image.shape, MISSING, np.uint8)
            height, width = image.shape[:2]
            put_text(gray, "not taken yet", width * 0.08, height / 2, width / 14, PALE)
            for path in (entities.CAMERA, entities.EDGES):
                draw_jpeg(rec, path, jpeg(gray))
        set_phase(rec, update.moment, Phase.MEASURE)
        draw_camera(rec, image)


def prepare_camera(rec: rr.RecordingStream) -> None:
    """Log the media type of camera and edges, static."""
    for path in (entities.CAMERA, entities.EDGES):
        prepare_jpeg(rec, path)


def draw_camera(rec: rr.RecordingStream, image: U8) -> None:
    """Log a picture (H, W, 3) RGB and its edge image, which the edge channel measures."""
    draw_jpeg(rec, entities.CAMERA, jpeg(image))
    draw_jpeg(rec, entities.EDGES, jpeg(brightened(edge_image(image)), EDGES_QUALITY))


NAME_ABOVE = 0.08  # of a picture's width: its name stands so far above it; in a narrow view more


def draw_name(
    rec: rr.RecordingStream, path: str, text: str, width: float, color: RGB, above: float = NAME_ABOVE
) -> None:
    """Log the name of a picture of this width above it, static. Its size is that of all labels."""
    name = rr.Points2D(
        [[width / 2, -above * width]],
        colors=[color],
        radii=rr.components.Radius.ui_points(0.0),
        labels=[font_safe(text)],
        show_labels=True,
    )
    rec.log(f"{path}/{NAME}", name, static=True)


def named_view(name: str, path: str) -> rrb.Spatial2DView:
    """Show one picture with its name above it, as large as there is room."""
    return rrb.Spatial2DView(name=name, origin=path, contents=[path, f"{path}/{NAME}"], background=GROUND)


def prepare_jpeg(rec: rr.RecordingStream, path: str, order: float | None = None) -> None:
    """Log the media type, static."""
    kind = rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=order)
    rec.log(path, kind, static=True)


def draw_jpeg(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded picture."""
    rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))


@dataclass(slots=True)
class CaptionedPicture:
    """A picture in a cell, over its caption. Only what changed is logged."""

    path: str
    height: int  # of the picture, in pixels
    _shown: dict[str, bytes] = field(default_factory=dict)  # by entity

    def prepare(self, rec: rr.RecordingStream, left: float, top: float) -> None:
        """Log where it is and what is drawn, static."""
        for path, kind, at in (
            (self.path, "image/jpeg", [left, top, 0]),
            (f"{self.path}/caption", "image/png", [0, self.height, 0]),
        ):
            picture = rr.EncodedImage.from_fields(media_type=kind, draw_order=0.0)
            rec.log(path, picture, rr.Transform3D(translation=at), static=True)

    def draw(self, rec: rr.RecordingStream, picture: bytes, caption: bytes) -> None:
        """Log a JPEG and a PNG."""
        for path, data in ((self.path, picture), (f"{self.path}/caption", caption)):
            if self._shown.get(path) != data:
                rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))
                self._shown[path] = data


def seen_views(runs: Sequence[RunView]) -> list[rrb.Spatial2DView]:
    """Show what the robot saw, by name; of runs over different drives what each robot saw."""
    own = [entities.camera_of(run.label) for run in runs if run.own_drive]
    return [named_view("The robot sees", path) for path in (entities.CAMERA, *own)]


def camera_view(title: str = "") -> rrb.Spatial2DView:
    """Show what the robot saw."""
    return picture_view(f"{title or 'Camera'} (px)", entities.CAMERA)


def edges_view() -> rrb.Spatial2DView:
    """Show the edge image of what the robot saw."""
    return picture_view(f"Edges x {EDGE_GAIN} (px)", entities.EDGES)


# Histograms: the picture's over that of its best match.

KINDS = ("sample", "reference")
MAPS = "maps"  # of a two-dimensional histogram, instead of bars


class HistogramsPanel(Panel):
    """Draws for each channel the picture's descriptor over that of its best match."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._tops: dict[str, float] = {}  # usual height of an element

    def prepare(self, rec: rr.RecordingStream) -> None:
        for channel in self._run.distances:
            index = self._library.index[channel]
            bins = len(index.relevance)
            usual = self._tops[channel] = usual_height(index)
            if grid_of(channel, bins) is not None:
                heat = rr.EncodedImage.from_fields(media_type="image/png")
                rec.log(self._paths.histogram(channel, MAPS), heat, static=True)
                continue
            self._place_bands(rec, channel, "bands", bins, usual)
            bin_width = len(bands_of(bins)) / bins
            for kind, color, offset, width in (
                ("reference", REFERENCE, *REFERENCE_BAR),
                ("sample", PICTURE, *SAMPLE_BAR),
            ):
                path, lefts = self._paths.histogram(channel, kind), (np.arange(bins) + offset) * bin_width
                place_bars(rec, path, color, lefts, np.full(bins, width * bin_width))

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        comparison = update.record.sighting.comparison
        if not update.whole or not len(comparison.quality):
            return
        set_phase(rec, update.moment, Phase.MEASURE)
        best = int(comparison.quality.argmax())
        for channel in comparison.channels:
            sample, index = comparison.descriptors[channel], self._library.index[channel]
            reference = index.references[best]
            grid = grid_of(channel, len(sample))
            if grid is not None:
                self._draw_heat(rec, channel, grid, (sample, reference))
                continue
            for kind, values in zip(KINDS, (sample, reference), strict=True):
                bars = row_of(rr.BarChart, values=tensor_of(values))
                rec.log(self._paths.histogram(channel, kind), bars)

    def clear(self, rec: rr.RecordingStream) -> None:
        rec.log(self._paths.at("histogram"), rr.Clear(recursive=True))

    def _draw_heat(
        self, rec: rr.RecordingStream, channel: str, grid: tuple[int, int], parts: tuple[F32, F32]
    ) -> None:
        """Log a two-dimensional histogram: picture and match side by side."""
        top = self._tops[channel]
        maps = [heat_of(part.reshape(grid), top, ink) for part, ink in zip(parts, HEATS, strict=False)]
        drawn = CHART.png(titled_heat(maps, ("picture", "best match"), AXES_WORDS))
        rec.log(self._paths.histogram(channel, MAPS), row_of(rr.EncodedImage, blob=blob_of(drawn)))

    def _place_bands(self, rec: rr.RecordingStream, channel: str, kind: str, bins: int, top: float) -> None:
        for plane, color in enumerate(bands_of(bins)):
            band = rr.BarChart([top], abscissa=[float(plane)], widths=[1.0], color=color)
            rec.log(self._paths.histogram(channel, f"{kind}/{plane}"), band, static=True)


def histogram_views(paths: RunPaths, channels: Sequence[str]) -> list[rrb.BarChartView | rrb.Spatial2DView]:
    """Show the picture's histogram over its best match's, one view per channel."""
    return [_histogram_view(paths, channel) for channel in channels]


def _histogram_view(paths: RunPaths, channel: str) -> rrb.BarChartView | rrb.Spatial2DView:
    if channel in GRIDS:
        return picture_view(channel.capitalize(), paths.histogram(channel, MAPS))
    kinds = ("bands", "reference", "sample")
    return bars_view(channel.capitalize(), [paths.histogram(channel, kind) for kind in kinds])
