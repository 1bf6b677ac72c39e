"""Inside an update: how particles moved, and which ancestors the survivors come from.

A copy stands where its parent stood, so lines from parents to children are drawn where they can be seen: in
the phase `predict` from where each copy was made to where it has moved, and in the phase `resample` along
the ancestors of a few survivors over the last updates.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from maurice_mcl.analysis.ancestry import Ancestry
from maurice_mcl.records import Belief, StepRecord

from ..drawing.arrow import strips_of
from ..entities import Phase, RunPaths
from ..style import FAMILY, MOVED
from .belief import copies_of, positions
from .panel import DrawnRun, Panel, StepUpdate, set_phase, set_phase_only
from .views import plot

MOST_MOVES = 150  # lines of moved particles: more cannot be distinguished
MOST_FAMILIES = 40
LINE = 0.6  # radius in points of the screen
SURVIVORS = "survivors"
ANCESTORS = "ancestors"

_NO_LINES = rr.LineStrips2D.from_fields(strips=[])


class AncestryPanel(Panel):
    """Draws the lines of one run, and traces how many survive; remembers the last updates."""

    def __init__(self, run: DrawnRun) -> None:
        self._paths, self._scale = run.paths, run.scale
        self._ancestry = Ancestry()
        self._before: Belief | None = None  # what the last update handed on

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the looks of the lines."""
        radius = rr.components.Radius.ui_points
        for path, color, order in ((self._paths.moves, MOVED, 15.0), (self._paths.families, FAMILY, 16.0)):
            lines = rr.LineStrips2D.from_fields(colors=[color], radii=radius(LINE), draw_order=order)
            rec.log(path, lines, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log moves and ancestors in the phases in which they can be seen, and the shares at the end."""
        if update.whole:
            self._draw_moves(rec, update)
        record = update.record
        self._ancestry.see(record)
        self._before = record.belief
        if update.whole and record.parents is not None:
            self._draw_ancestors(rec, update)
        if update.whole and update.is_reseeded:  # so that particles drawn anew can be seen
            set_phase_only(rec, update.moment, Phase.RESEED)
            rec.log(self._paths.families, _NO_LINES)
        set_phase(rec, update.moment, Phase.ESTIMATE)
        rec.log(self._paths.trace(SURVIVORS), rr.Scalars(survivors(record)))
        rec.log(self._paths.trace(ANCESTORS), rr.Scalars(self._ancestry.distinct() / record.belief.size))

    def clear(self, rec: rr.RecordingStream) -> None:
        """Remove all lines."""
        for path in (self._paths.moves, self._paths.families):
            rec.log(path, rr.Clear(recursive=True))

    def _draw_moves(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log lines from where some particles were to where the motion model put them, in one phase."""
        before, after = self._before, update.record.predicted
        set_phase_only(rec, update.moment, Phase.PREDICT)
        rec.log(self._paths.families, _NO_LINES)
        if before is not None and before.size == after.size:  # else particles have no one parent
            some = spread_over(after.size, MOST_MOVES)
            ends = np.stack([positions(before, self._scale)[some], positions(after, self._scale)[some]], 1)
            rec.log(self._paths.moves, rr.LineStrips2D.from_fields(strips=strips_of(ends)))
        set_phase_only(rec, update.moment, Phase.MEASURE)
        rec.log(self._paths.moves, _NO_LINES)

    def _draw_ancestors(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the paths by which the ancestors of some survivors came here."""
        set_phase_only(rec, update.moment, Phase.RESAMPLE)
        lines = [self._scale.screen(line) for line in self._ancestry.lines(MOST_FAMILIES) if len(line) > 1]
        rec.log(self._paths.families, rr.LineStrips2D.from_fields(strips=strips_of(lines)))


def spread_over(count: int, most: int) -> NDArray[np.int64]:
    """Return at most `most` indices, spread evenly over `count` things."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64) if count else np.zeros(0, int)


def survivors(record: StepRecord) -> float:
    """Return the share of the weighted particles that left a copy; 1 where there was no resampling."""
    return float((copies_of(record.parents, record.weighted.size) > 0).mean())


def ancestry_plot(paths: RunPaths) -> rrb.TimeSeriesView:
    """Plot how many particles survive, and from how many the cloud descends."""
    lines = [paths.trace(SURVIVORS), paths.trace(ANCESTORS)]
    return plot("Survivors pink, ancestors 10 steps back green (share)", lines, top=1.1)
