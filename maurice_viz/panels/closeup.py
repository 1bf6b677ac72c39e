"""The cloud from near: a view that follows it, with a bar that says how near.

What is drawn on the map is seen in it too: only the place and the size of the frame are logged.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from maurice_mcl.arrays import F32
from maurice_mcl.map import Arena
from maurice_mcl.records import Estimate

from ..drawing import keys
from ..drawing.canvas import long_side
from ..drawing.raster import png
from ..entities import RunPaths
from ..style import TRUTH, Scale

BARS: dict[str, tuple[float, ...]] = {  # lengths of the bar, by unit
    "in": (1.0, 2.0, 3.0, 6.0, *(12.0 * 2**k for k in range(10))),
    "m": (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0),
}
BARS_WIDE = 4.0  # the frame reaches so many bars from its middle
REACH = 3.0  # standard deviations of the cloud that are seen at least
ASIDE = 0.2  # of the frame: a cloud that is further from its middle brings it along
LOOSE = 0.35  # of the frame: a smaller cloud brings the frame nearer
KEY_WIDTH = 1.5  # of the key above, in frames (the frame is 2 wide)
LEFT, TOP, BOTTOM = -0.96, -0.98, 0.93


@dataclass(slots=True)
class Closeup:
    """Moves the frame of one run's close view."""

    paths: RunPaths
    scale: Scale
    widest: float  # the bar with which the whole map is seen, in display units
    _bar: float = 0.0
    _at: F32 = field(default_factory=lambda: np.zeros(2, np.float32))  # middle of the frame, as drawn

    def prepare(self, rec: rr.RecordingStream, has_truth: bool) -> None:
        """Log key and bar, static: they move with the frame."""
        radius = rr.components.Radius.ui_points
        end = LEFT + 1 / BARS_WIDE
        bar = np.array([[LEFT, BOTTOM - 0.02], [LEFT, BOTTOM], [end, BOTTOM], [end, BOTTOM - 0.02]])
        lines = rr.LineStrips2D([bar], colors=[TRUTH], radii=radius(1.25), draw_order=70.0)
        rec.log(f"{self.paths.closeup}/bar", lines, static=True)
        middle = [(LEFT + end) / 2, BOTTOM - 0.1]
        # no labels yet: static ones would hide all later ones
        style = rr.Points2D([middle], colors=[TRUTH], radii=radius(0.1), show_labels=True, draw_order=70.0)
        rec.log(f"{self.paths.closeup}/length", style, static=True)
        key = keys.weight_key(has_truth)
        rec.log(
            f"{self.paths.closeup}/key",
            rr.EncodedImage(contents=png(key), media_type="image/png", draw_order=60.0),
            rr.Transform3D(translation=[LEFT, TOP, 0], scale=KEY_WIDTH / key.shape[1]),
            static=True,
        )

    def draw(self, rec: rr.RecordingStream, mean: Estimate) -> None:
        """Bring the frame to a cloud with that mean, if it does not show it well."""
        needed = REACH * self.scale.length(float(np.hypot(*mean.sd_m))) / BARS_WIDE
        resized = not LOOSE * self._bar < needed <= self._bar
        if resized:
            self._bar = bar_for(min(needed, self.widest), self.scale.units.name)
            self._say(rec)
        at = self.scale.screen(mean.pose[None, :2])[0]
        if not resized and np.abs(at - self._at).max() < ASIDE * self._bar * BARS_WIDE:
            return  # a view that stands still is easier to read, and costs nothing
        self._at = at
        frame = rr.Transform3D.from_fields(translation=[*at.tolist(), 0], scale=[self._bar * BARS_WIDE] * 3)
        rec.log(self.paths.closeup, frame)

    def _say(self, rec: rr.RecordingStream) -> None:
        text = f"{self._bar:g} {self.scale.units.name}"
        rec.log(f"{self.paths.closeup}/length", rr.Points2D.from_fields(labels=[text]))


def closeup_of(paths: RunPaths, arena: Arena, scale: Scale) -> Closeup:
    """Make what moves the frame of a run on a map."""
    return Closeup(paths, scale, long_side(arena, scale) / BARS_WIDE)


def bar_for(needed: float, unit: str) -> float:
    """Give the shortest round length of a bar that is not under what is needed; the longest where none is."""
    lengths = BARS[unit]
    return next((length for length in lengths if length >= needed), lengths[-1])
