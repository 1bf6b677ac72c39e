"""The river of modes: how the weight was shared among the modes of the cloud over the last updates.

Every mode has a color that it keeps as long as it lives; modes are stacked by age, the oldest at the
bottom, so that a band does not jump when another overtakes it. Weight in no mode stays empty at the top.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from maurice_mcl.mode_tracks import TrackedMode
from maurice_mcl.typing import U8

from .look import EMPTY, MODE_COLORS, PALE, RULER
from .raster import png

LENGTH = 60  # updates that are seen at once, a column each
HEIGHT = 24  # rows for the whole weight
LABELS = ((0.0, f"{LENGTH} steps ago"), (LENGTH / 2, f"{LENGTH // 2}"), (LENGTH - 0.5, "now"))
MARGIN = (7.0, 4.0, 2.0, 7.0)  # left, right, top, bottom of the drawing, in columns


@dataclass(slots=True)
class River:
    """Draws the river of one run."""

    path: str
    _past: deque[tuple[TrackedMode, ...]] = field(default_factory=lambda: deque(maxlen=LENGTH))

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the frame and its labels, static."""
        frame = np.array([[0, 0], [LENGTH, 0], [LENGTH, HEIGHT], [0, HEIGHT], [0, 0]])
        radius = rr.components.Radius.ui_points
        below = [(x, HEIGHT + 2.6) for x, _ in LABELS]
        beside = [(-3.6, HEIGHT - 0.8), (-3.6, 0.8)]
        rec.log(
            f"{self.path}/frame",
            rr.LineStrips2D([frame], colors=[RULER], radii=radius(0.5), draw_order=5.0),
            rr.Points2D(
                [*below, *beside],
                labels=[*(text for _, text in LABELS), "0 %", "100 %"],
                show_labels=True,
                colors=[PALE],
                radii=radius(0.1),
            ),
            static=True,
        )
        kind = rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)
        rec.log(f"{self.path}/bands", kind, static=True)

    def draw(self, rec: rr.RecordingStream, modes: tuple[TrackedMode, ...]) -> None:
        """Take in an update's modes, and log the river up to it."""
        self._past.append(modes)
        rec.log(f"{self.path}/bands", rr.EncodedImage.from_fields(blob=png(bands(self._past))))


def bands(past: Sequence[tuple[TrackedMode, ...]]) -> U8:
    """Draw the river (HEIGHT, LENGTH, 3) RGB, the latest update at the right."""
    image = np.full((HEIGHT, LENGTH, 3), EMPTY, np.uint8)
    for ago, modes in enumerate(reversed(past)):
        mass = 0.0
        for mode in sorted(modes, key=lambda mode: mode.identity):
            base, mass = mass, mass + mode.estimate.mass
            rows = slice(HEIGHT - round(mass * HEIGHT), HEIGHT - round(base * HEIGHT))
            image[rows, LENGTH - 1 - ago] = MODE_COLORS[mode.identity % len(MODE_COLORS)]
    return image
