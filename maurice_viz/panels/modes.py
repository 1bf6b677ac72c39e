"""Modes over time: how the weight was shared among the modes of the cloud over the last updates.

Every mode has a color that it keeps as long as it lives; modes are stacked by age, the oldest at the
bottom, so that a band does not jump when another overtakes it. Weight in no mode stays empty at the top.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.analysis.modes import TrackedMode
from maurice_mcl.arrays import U8

from ..drawing.canvas import Extent
from ..drawing.raster import png, put_text, text_size
from ..entities import Phase, RunPaths
from ..style import EMPTY, GROUND, MODE_COLORS, PALE, RULER
from .panel import DrawnRun, Panel, StepUpdate, set_phase
from .views import plane_view

LENGTH = 60  # updates that are seen at once, a column each
HEIGHT = 24  # rows for the whole weight
LABELS = ((0.0, f"{LENGTH} steps ago"), (LENGTH / 2, f"{LENGTH // 2}"), (LENGTH, "now"))
MARGIN = (6.0, 3.5, 1.5, 3.5)  # left, right, top, bottom of the drawing, in columns
FRAME_PX = 16  # pixels a column of the frame's drawing
TEXT_PX = 18.0


class ModesPanel(Panel):
    """Draws the bands of one run."""

    def __init__(self, run: DrawnRun) -> None:
        self._path = run.paths.modes
        self._past: deque[tuple[TrackedMode, ...]] = deque(maxlen=LENGTH)

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the frame with its labels, and what kind of pictures will come."""
        left, _, top, _ = MARGIN
        rec.log(
            f"{self._path}/frame",
            rr.EncodedImage(contents=png(frame()), media_type="image/png", draw_order=-20.0),
            rr.Transform3D(translation=[-left, -top, 0], scale=1 / FRAME_PX),
            static=True,
        )
        kind = rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)
        rec.log(f"{self._path}/bands", kind, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the bands up to this update."""
        self._past.append(update.modes)
        set_phase(rec, update.moment, Phase.ESTIMATE)
        rec.log(f"{self._path}/bands", rr.EncodedImage.from_fields(blob=png(bands(self._past))))


def frame() -> U8:
    """Draw the frame (H, W, 3) RGB with labels below and beside it.

    Labels of the viewer's own cannot be read in its light theme, on a ground that is dark.
    """
    left, right, top, bottom = MARGIN
    size = round((top + HEIGHT + bottom) * FRAME_PX), round((left + LENGTH + right) * FRAME_PX)
    image = np.full((*size, 3), GROUND, np.uint8)
    corner = np.array([left, top]) * FRAME_PX
    far = corner + np.array([LENGTH, HEIGHT]) * FRAME_PX
    image[round(corner[1]) - 2 : round(far[1]) + 2, round(corner[0]) - 2 : round(far[0]) + 2] = RULER
    for column, text in LABELS:
        at = corner[0] + column * FRAME_PX - text_size(text, TEXT_PX)[0] / 2
        put_text(image, text, max(at, 4), far[1] + 2 * TEXT_PX, TEXT_PX, PALE)
    for row, text in ((0.0, "100 %"), (HEIGHT / 2, "50 %"), (float(HEIGHT), "0 %")):
        width, height = text_size(text, TEXT_PX)
        put_text(image, text, corner[0] - width - 12, corner[1] + row * FRAME_PX + height / 2, TEXT_PX, PALE)
    return image


def bands(past: Sequence[tuple[TrackedMode, ...]]) -> U8:
    """Draw the bands (HEIGHT, LENGTH, 3) RGB, the latest update at the right."""
    image = np.full((HEIGHT, LENGTH, 3), EMPTY, np.uint8)
    for ago, modes in enumerate(reversed(past)):
        mass = 0.0
        for mode in sorted(modes, key=lambda mode: mode.identity):
            base, mass = mass, mass + mode.estimate.mass
            rows = slice(HEIGHT - round(mass * HEIGHT), HEIGHT - round(base * HEIGHT))
            image[rows, LENGTH - 1 - ago] = MODE_COLORS[mode.identity % len(MODE_COLORS)]
    return image


def modes_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show how the weight was shared among the modes of the last updates."""
    left, right, top, bottom = MARGIN
    extent = Extent(-left, LENGTH + right, -top, HEIGHT + bottom)
    return plane_view("Modes: share of the weight (%), a color each", f"{paths.modes}/**", extent)
