"""What the robot saw, and what is seen where a run is; and pictures in general, by name or over a caption.

Where a run is, the picture of the reference nearest to its estimate is seen, not the best match of the whole
library, which says nothing of where the run is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.place import reference_near
from maurice_mcl.scoring.table import LOST_RAD

from .. import entities
from ..drawing.arrow import blob_of, row_of
from ..drawing.canvas import EDGE_GAIN, jpeg, put_text
from ..drawing.contact_sheet import CELL_PX, cell_height, no_picture, reference_jpeg
from ..entities import Phase
from ..scene import RunView, Scene
from ..style import GROUND, MISSING, PALE, RGB, TRUTH, Order, font_safe
from .panel import Panel, StepUpdate, set_phase, set_phase_only
from .views import Overrides, picture_view

NAME, SEES = "name", "the robot sees"
CAMERA_QUALITY = (
    80  # three fifths of the bytes of 90, and no difference that one sees at three times the size
)


class CameraPanel(Panel):
    """Draws the picture of each update."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        prepare_jpeg(rec, entities.CAMERA)

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
            draw_jpeg(rec, entities.CAMERA, jpeg(gray))
        set_phase(rec, update.moment, Phase.MEASURE)
        draw_jpeg(rec, entities.CAMERA, jpeg(image, CAMERA_QUALITY))


NAME_ABOVE = 0.12  # of a picture's width: its name stands so far above it; in a narrow view more


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


def named_view(name: str, path: str, overrides: Overrides | None = None) -> rrb.Spatial2DView:
    """Show one picture with its name above it, as large as there is room."""
    contents = [path, f"{path}/{NAME}"]
    return rrb.Spatial2DView(
        name=name, origin=path, contents=contents, background=GROUND, overrides=overrides
    )


def prepare_jpeg(rec: rr.RecordingStream, path: str) -> None:
    """Log the media type, static."""
    kind = rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=Order.GROUND)
    rec.log(path, kind, static=True)


def draw_jpeg(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded picture."""
    rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))


NO_LIBRARY = "the library is not at hand"
LETTERS = 36  # of a name: what two pictures beside a wide map have room for at 1280 pixels


class HerePanel(Panel):
    """Draws it at every update, by name; words where no reference is near."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._height = cell_height(scene.library.pictures)
        self._shown = b""  # last logged

    def prepare(self, rec: rr.RecordingStream) -> None:
        prepare_jpeg(rec, self._paths.here)
        draw_name(rec, self._paths.here, name_of(self._run.short), CELL_PX, self._run.color)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        if update.whole and update.is_first:  # nothing is estimated yet
            set_phase_only(rec, update.moment, Phase.PREDICT)
            draw_jpeg(rec, self._paths.here, no_picture(self._height))
        picture = self._picture(update)
        if picture != self._shown:
            set_phase(rec, update.moment, Phase.WEIGHT)
            draw_jpeg(rec, self._paths.here, picture)
            self._shown = picture

    def _picture(self, update: StepUpdate) -> bytes:
        """Return the picture as a JPEG."""
        nearest, library = self._scene.nearest, self._library
        if nearest is None:
            return no_picture(self._height, NO_LIBRARY)
        estimate = update.record.estimate
        reach_m = estimate.radii.right_m
        entry = reference_near(library, nearest, estimate.pose, reach_m)
        if entry < 0:
            within = f"{self._scale.say(reach_m)} and {math.degrees(LOST_RAD):.0f} deg"
            return no_picture(self._height, f"no reference within\n{within}\nof where {self._run.label} is")
        return reference_jpeg(library.pictures[entry], self._height)


def name_of(label: str) -> str:
    """Return the name of the picture of a run: "where thesis is, it would see this", or what fits of it."""
    name, short = f"where {label} is, it would see this", " would see this"
    if len(name) <= LETTERS:
        return name
    room = LETTERS - len(short)
    return f"{label if len(label) <= room else f'{label[: room - 3]}...'}{short}"


def picture_here_view(run: RunView) -> rrb.Spatial2DView:
    """Show what is seen where a run is, by name."""
    return named_view("Where it is", run.paths.here)


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
            picture = rr.EncodedImage.from_fields(media_type=kind, draw_order=Order.GROUND)
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


def camera_view() -> rrb.Spatial2DView:
    """Show what the robot saw."""
    return picture_view("Camera (px)", entities.CAMERA)


def edges_view() -> rrb.Spatial2DView:
    """Show the edge image of what the robot saw."""
    return picture_view(f"Edges x {EDGE_GAIN} (px)", entities.EDGES)
