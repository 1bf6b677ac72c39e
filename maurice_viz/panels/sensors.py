"""What pose sensors want shown: a sentence, pictures, and marks in the pictures and on the map.

Marks that agree with the estimate and marks that do not have a color each; those that are not judged are
pale.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from maurice_mcl.sensor.descriptors.registry import reduced
from maurice_mcl.sensor.laser.sensor import LASER
from maurice_mcl.values import F32, F64, U8, Arena, Beside, PoseSensor, Shown, ShownMarks

from .. import entities
from ..drawing.arrow import (
    Values,
    colors_of,
    floats_of,
    places_of,
    points_of,
    row_of,
    space_strips_of,
    strips_of,
    text_of,
    ui_points_of,
)
from ..drawing.canvas import blank, jpeg
from ..drawing.contact_sheet import read_picture
from ..drawing.keys import WEIGHTS
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import (
    AGREES,
    BEYOND,
    DISAGREES,
    GROUND,
    MISSING,
    OBSTACLE,
    PALE,
    RGB,
    SHORT,
    TRUTH,
    UNMAPPED,
    WALL,
    Order,
    Scale,
    font_safe,
    packed,
)
from ..text.explanation_table import say_shown
from .belief import run_key
from .camera import draw_jpeg, prepare_jpeg
from .panel import MARKDOWN, Panel, StepUpdate, set_phase
from .views import MAP, SEPARATED, map_view

ON_MAP, IN_SPACE = "map", "space"  # the views of marks in the map's frame
POINT_PT, SMALL_POINT_PT, STROKE_PT = 3.0, 1.5, 1.0  # ui points
JPEG_QUALITY = 88  # of a picture: small letters and thin lines are drawn over it
NO_PICTURE = np.full((3, 4, 3), MISSING, np.uint8)  # in place of a picture that a sensor did not show
MARK_WORDS = "Marks: green agree with the estimate, red do not, white are where the truth has them."
BEAM_WORDS = (
    "Dots: the scan at the estimate in the run's color, at the truth in white. Lines go from where a beam "
    "ends to the wall of the map: red short of it, violet beyond it. Gray: where nobody has mapped."
)
BEAMS = {"short": SHORT, "beyond": BEYOND, "unknown": UNMAPPED}  # of a laser, by what they are
OBSTACLE_M = 0.5  # height that obstacles are drawn with in space: a map does not tell it
Kind = type[rr.Points2D | rr.LineStrips2D | rr.Points3D | rr.LineStrips3D]
# by whether they are points, and whether they are flat: archetype, its field, and what fills that
MARK_KINDS: dict[tuple[bool, bool], tuple[Kind, str, Callable[[F32], Values]]] = {
    (True, True): (rr.Points2D, "positions", points_of),
    (False, True): (rr.LineStrips2D, "strips", strips_of),
    (True, False): (rr.Points3D, "positions", places_of),
    (False, False): (rr.LineStrips3D, "strips", space_strips_of),
}
NO_MARKS = {kind: np.zeros((0, 1, 2 if kind[1] else 3), np.float32) for kind in MARK_KINDS}


class SensorsPanel(Panel):
    """Draws what each pose sensor of a run shows of an update."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the kinds of texts and pictures, static."""
        self._marks = {name: DrawnMarks(self._run.color) for name in self._sensors}
        for name, sensor in self._sensors.items():
            text = rr.TextDocument.from_fields(media_type=MARKDOWN)
            rec.log(self._paths.sensor(name, "words"), text, static=True)
            for title in titles_of(sensor):
                prepare_jpeg(rec, self._paths.sensor(name, slug(title)))
            if in_space(sensor):
                draw_room(rec, self._paths.sensor(name, IN_SPACE), self._library.arena, self._scale)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log what the sensors read, against the estimate and, where known, the truth."""
        if not update.whole or not self._sensors:
            return
        set_phase(rec, update.moment, Phase.MEASURE)
        poses: dict[str, F64] = {"estimate": update.record.estimate.pose}
        if update.moment.truth is not None:
            poses["truth"] = update.moment.truth
        readings = {reading.name: reading for reading in update.record.sighting.comparison.read}
        for name in self._sensors:
            nothing = f"{name.capitalize()}: nothing in this frame."
            self._draw(rec, name, readings[name].shown(poses) if name in readings else Shown(nothing))

    def clear(self, rec: rr.RecordingStream) -> None:
        for name, marks in self._marks.items():
            self._draw_words(rec, name, "Not drawn at this step.")
            marks.draw(rec, {})

    @property
    def _sensors(self) -> dict[str, PoseSensor]:
        return {} if self._run.sensor is None else dict(self._run.sensor.sensors)

    def _draw(self, rec: rr.RecordingStream, name: str, shown: Shown) -> None:
        words = say_shown(shown, self._library.arena, self._scale)
        if shown.marks and not hasattr(self._sensors[name], "verify"):  # which judges no pose
            words += f"\n\n{BEAM_WORDS if name == LASER else MARK_WORDS}"
        self._draw_words(rec, name, words)
        for title in titles_of(self._sensors[name]):
            image = self._image(shown.pictures.get(title, NO_PICTURE))
            draw_jpeg(rec, self._paths.sensor(name, slug(title)), jpeg(image, JPEG_QUALITY))
        marks: dict[str, tuple[ShownMarks, F32]] = {}
        for mark in shown.marks:
            shown_marks = self._inside(mark) if mark.view == ON_MAP else mark
            place = self._paths.sensor(name, slug(shown_marks.view), slug(shown_marks.name))
            marks[place] = shown_marks, self._drawn(shown_marks)
        self._marks[name].draw(rec, marks)

    def _image(self, picture: U8 | Beside) -> U8:
        """Return a picture as it is drawn, with that of the reference that it is beside of."""
        if not isinstance(picture, Beside):
            return picture
        path = self._library.pictures[picture.reference]
        other = None if path is None else _reference(path)
        height, width = picture.image.shape[:2]
        other = np.full_like(picture.image, MISSING) if other is None else other
        rows = max(height, len(other))
        both = blank(rows, picture.right_px + other.shape[1], GROUND)
        both[:height, :width] = picture.image
        both[: len(other), picture.right_px :] = other
        return both

    def _drawn(self, marks: ShownMarks) -> F32:
        if marks.view == ON_MAP:
            return self._on_map(marks.strips)
        strips = _spaced(marks.strips, self._scale) if marks.view == IN_SPACE else marks.strips
        return strips.astype(np.float32)

    def _draw_words(self, rec: rr.RecordingStream, name: str, words: str) -> None:
        text = text_of(font_safe(words))
        rec.log(self._paths.sensor(name, "words"), row_of(rr.TextDocument, text=text))

    def _inside(self, marks: ShownMarks) -> ShownMarks:
        """Leave out marks outside of the map: they would cover its key."""
        x_min, y_min, x_max, y_max = self._library.arena.bounds
        x, y = marks.strips[..., 0], marks.strips[..., 1]
        inside = ((x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)).all(axis=1)
        agrees = None if marks.agrees is None else marks.agrees[inside]
        return replace(marks, strips=marks.strips[inside], agrees=agrees)

    def _on_map(self, strips: F32 | F64) -> F32:
        flat = self._scale.screen(strips.reshape(-1, 2).astype(np.float64))
        return flat.reshape(strips.shape)


@dataclass(slots=True)
class DrawnMarks:
    """The marks of one sensor; those of the step before are emptied."""

    color: RGB  # of the run's estimate
    _kinds: dict[str, tuple[bool, bool]] = field(default_factory=dict)  # keys of `KINDS`, by entity

    def draw(self, rec: rr.RecordingStream, marks: dict[str, tuple[ShownMarks, F32]]) -> None:
        """Log marks by entity, with their strips as drawn; empty those that are not among them."""
        for path, kind in self._kinds.items():
            if path not in marks:
                archetype, values, values_of = MARK_KINDS[kind]
                rec.log(path, row_of(archetype, **{values: values_of(NO_MARKS[kind])}))
        for path, (shown_marks, strips) in marks.items():
            kind = self._kinds[path] = strips.shape[1] == 1, strips.shape[2] == 2
            is_large = shown_marks.of is None or shown_marks.of in BEAMS
            size = STROKE_PT if not kind[0] else POINT_PT if is_large else SMALL_POINT_PT
            look = {"colors": colors_of(self._colors(shown_marks)), "radii": ui_points_of([size])}
            if kind[1]:
                look["draw_order"] = floats_of([Order.MARKS if shown_marks.of is None else Order.TRUTH])
            archetype, values, values_of = MARK_KINDS[kind]
            rec.log(path, row_of(archetype, **{values: values_of(strips)}, **look))

    def _colors(self, marks: ShownMarks) -> NDArray[np.uint32]:
        """Return packed colors, one or one a mark."""
        if marks.of in BEAMS:
            return np.array([packed(BEAMS[marks.of])], np.uint32)
        if marks.agrees is not None:
            return np.where(marks.agrees, packed(AGREES), packed(DISAGREES)).astype(np.uint32)
        color = {"truth": TRUTH, "estimate": self.color}.get(marks.of or "", PALE)
        return np.array([packed(color)], np.uint32)


@lru_cache(maxsize=4)
def _reference(path: Path) -> U8 | None:
    """Return the reduced picture of a reference: several updates in a row mostly have the same one beside."""
    picture = read_picture(path)
    return None if picture is None else reduced(picture)


def slug(name: str) -> str:
    """Return a name as one part of an entity path."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def in_space(sensor: PoseSensor) -> bool:
    """Return whether a sensor shows marks in space."""
    return bool(getattr(sensor, "in_space", False))


def _spaced(strips: F32 | F64, scale: Scale) -> F64:
    """Return points (..., 3) in the map's frame as they are drawn in space."""
    return np.asarray((strips - [*scale.origin_m, 0.0]) * scale.length(1.0), np.float64)


def draw_room(rec: rr.RecordingStream, path: str, arena: Arena, scale: Scale) -> None:
    """Log walls and obstacles in space, static, in display units and y pointing away."""
    strips = [np.column_stack([w.reshape(2, 2), [0, 0]]) for w in arena.walls]
    colors = [WALL] * len(strips)
    for obstacle in arena.obstacles:
        ring = np.concatenate([obstacle.polygon, obstacle.polygon[:1]])
        strips += [np.column_stack([ring, np.full(len(ring), z)]) for z in (0.0, OBSTACLE_M)]
        colors += [OBSTACLE] * 2
    radii = rr.components.Radius.ui_points(STROKE_PT)
    drawn = [_spaced(strip, scale) for strip in strips]
    rec.log(f"{path}/room", rr.LineStrips3D(drawn, colors=colors, radii=radii), static=True)
    rec.log(path, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)


def sensor_space_view(paths: RunPaths, scene: Scene, name: str) -> rrb.Spatial3DView:
    """Show what a sensor marks in space."""
    title = f"{name} in space ({scene.scale.units.name})"
    return rrb.Spatial3DView(name=title, origin=paths.sensor(name, IN_SPACE), background=GROUND)


def titles_of(sensor: PoseSensor) -> tuple[str, ...]:
    """Return the titles of the pictures that a sensor shows."""
    return tuple(getattr(sensor, "pictures", ()))


def sensor_map_view(paths: RunPaths, scene: Scene, names: tuple[str, ...]) -> rrb.Spatial2DView:
    """Show the map with the cloud, and what the sensors mark on it."""
    contents = [*MAP, paths.key(WEIGHTS), f"{paths.at('belief')}/**"]
    contents += [f"{paths.sensor(name, ON_MAP)}/**" for name in names]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    title = f"Map with marks ({scene.scale.units.name})"
    return map_view(title, contents, scene, key=run_key(WEIGHTS, scene))


def scan_on_map(run: RunView) -> list[str]:
    """Return where a run's scan is on the map, at its estimate; nowhere for one without a laser."""
    return [run.paths.sensor(LASER, ON_MAP, slug("scan at the estimate"))] if LASER in run.sensors else []


def sensor_words_view(paths: RunPaths, name: str) -> rrb.TextDocumentView:
    """Show what a sensor says in words."""
    return rrb.TextDocumentView(name=f"{name.capitalize()} in words", origin=paths.sensor(name, "words"))


def sensor_picture_views(run: RunView, sensor: str) -> list[rrb.Spatial2DView]:
    """Show the pictures of a sensor, with its marks."""
    titles = () if run.sensor is None else titles_of(run.sensor.sensors[sensor])
    views = []
    for title in titles:
        path = run.paths.sensor(sensor, slug(title))
        contents = [f"{path}/**", SEPARATED]
        name = title.partition(":")[0]
        views.append(rrb.Spatial2DView(name=name, origin=path, contents=contents, background=GROUND))
    return views
