"""What pose sensors want shown: a sentence, pictures, and marks in the pictures and on the map.

Marks that agree with the estimate and marks that do not have a color each; those that are not judged are
pale.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.arrays import F32, F64
from maurice_mcl.pose_sensor import PoseSensor, Shown, ShownMarks

from .. import entities
from ..drawing.arrow import row_of, text_of
from ..drawing.canvas import jpeg
from ..drawing.keys import WEIGHTS
from ..entities import Phase, RunPaths
from ..scene import RunView, SceneInfo
from ..style import AGREES, DISAGREES, PALE, RGB, font_safe
from .belief import run_key
from .camera import draw_jpeg, prepare_jpeg
from .panel import MARKDOWN, Panel, StepUpdate, set_phase
from .views import MAP, map_view

ON_MAP = "map"  # the view of marks in the map's frame
POINT, STROKE = 3.0, 1.25  # ui points
QUALITY = 88  # of a picture: small letters and thin lines are drawn over it


class SensorsPanel(Panel):
    """Draws what each pose sensor of a run shows of an update."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the kinds of texts and pictures, static."""
        self._marks = {name: DrawnMarks() for name in self._sensors}
        for name, sensor in self._sensors.items():
            text = rr.TextDocument.from_fields(media_type=MARKDOWN)
            rec.log(self._paths.sensor(name, "words"), text, static=True)
            for title in titles_of(sensor):
                prepare_jpeg(rec, self._paths.sensor(name, slug(title)), order=-10.0)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log what the sensors read, against the estimate and, where known, the truth."""
        if not update.whole or not self._sensors:
            return
        set_phase(rec, update.moment, Phase.MEASURE)
        poses: dict[str, F64] = {"estimate": update.record.estimate.pose}
        if update.moment.truth is not None:
            poses["truth"] = update.moment.truth
        read = {one.name: one.reading for one in update.record.sighting.comparison.sensed}
        for name, sensor in self._sensors.items():
            nothing = f"{name.capitalize()}: nothing in this frame."
            shown = sensor.shown(read[name], poses) if name in read else Shown(nothing)
            self._draw(rec, name, shown)

    def clear(self, rec: rr.RecordingStream) -> None:
        for name, marks in self._marks.items():
            self._draw_words(rec, name, "Not drawn at this step.")
            marks.draw(rec, {})

    @property
    def _sensors(self) -> dict[str, PoseSensor]:
        return {} if self._run.sensor is None else dict(self._run.sensor.sensors)

    def _draw(self, rec: rr.RecordingStream, name: str, shown: Shown) -> None:
        self._draw_words(rec, name, shown.words)
        for title, image in shown.pictures.items():
            draw_jpeg(rec, self._paths.sensor(name, slug(title)), jpeg(image, QUALITY))
        marks: dict[str, tuple[ShownMarks, F32]] = {}
        for one in shown.marks:
            place = self._paths.sensor(name, slug(one.view), slug(one.name))
            drawn = one.strips if one.view != ON_MAP else self._on_map(one.strips)
            marks[place] = one, drawn
        self._marks[name].draw(rec, marks)

    def _draw_words(self, rec: rr.RecordingStream, name: str, words: str) -> None:
        text = text_of(font_safe(words))
        rec.log(self._paths.sensor(name, "words"), row_of(rr.TextDocument, text=text))

    def _on_map(self, strips: F32) -> F32:
        flat = self._scale.screen(strips.reshape(-1, 2).astype(np.float64))
        return flat.reshape(strips.shape)


@dataclass(slots=True)
class DrawnMarks:
    """The marks of one sensor; those of the step before are emptied."""

    _kinds: dict[str, bool] = field(default_factory=dict)  # by entity: whether they are points

    def draw(self, rec: rr.RecordingStream, marks: dict[str, tuple[ShownMarks, F32]]) -> None:
        """Log marks by entity, with their strips as drawn; empty those that are not among them."""
        for path, is_points in self._kinds.items():
            if path not in marks:
                rec.log(path, rr.Points2D([]) if is_points else rr.LineStrips2D([]))
        for path, (one, strips) in marks.items():
            is_points = strips.shape[1] == 1
            self._kinds[path] = is_points
            colors = _colors(one)
            if is_points:
                radii = rr.components.Radius.ui_points(POINT)
                rec.log(path, rr.Points2D(strips[:, 0], colors=colors, radii=radii, draw_order=30.0))
            else:
                radii = rr.components.Radius.ui_points(STROKE)
                rec.log(path, rr.LineStrips2D(strips, colors=colors, radii=radii, draw_order=30.0))


def _colors(marks: ShownMarks) -> list[RGB]:
    if marks.agrees is None:
        return [PALE]
    return [AGREES if agrees else DISAGREES for agrees in marks.agrees]


def slug(name: str) -> str:
    """Return a name as one part of an entity path."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def titles_of(sensor: PoseSensor) -> tuple[str, ...]:
    """Return the titles of the pictures that a sensor shows."""
    return tuple(getattr(sensor, "pictures", ()))


def sensor_map_view(paths: RunPaths, scene: SceneInfo, names: tuple[str, ...]) -> rrb.Spatial2DView:
    """Show the map with the cloud, and what the sensors mark on it."""
    contents = [*MAP, f"{paths.phase_key(WEIGHTS)}/**", f"{paths.at('belief')}/**"]
    contents += [f"{paths.sensor(name, ON_MAP)}/**" for name in names]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    title = f"Map, and what {' and '.join(names)} marks on it ({scene.scale.units.name})"
    return map_view(title, contents, scene, key=run_key(WEIGHTS, scene.has_truth))


def sensor_words_view(paths: RunPaths, name: str) -> rrb.TextDocumentView:
    """Show what a sensor says in words."""
    return rrb.TextDocumentView(name=f"What {name} says", origin=paths.sensor(name, "words"))


def sensor_picture_views(run: RunView, paths: RunPaths, name: str) -> list[rrb.Spatial2DView]:
    """Show the pictures of a sensor, with its marks: green where they agree with the estimate, else red."""
    titles = () if run.sensor is None else titles_of(run.sensor.sensors[name])
    views = []
    for title in titles:
        path = paths.sensor(name, slug(title))
        views.append(rrb.Spatial2DView(name=f"{title} (px)", origin=path))
    return views
