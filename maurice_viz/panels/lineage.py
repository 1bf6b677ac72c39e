"""Inside an update: how particles moved, and whom the survivors come from.

A copy stands where its parent stood, so lines from parents to children are drawn where they can be seen: in
the phase `predict` from where each copy was made to where it has moved, and in the phase `resample` along
the ancestors of a few survivors over the last updates.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from maurice_mcl.analysis.ancestry import Ancestry
from maurice_mcl.arrays import F64
from maurice_mcl.records import Belief, StepRecord

from ..drawing.arrow import strips_of
from ..entities import RunPaths
from ..style import FAMILY, MOVED, Scale
from .belief import positions

MOST_MOVES = 150  # lines of moved particles: more cannot be told apart
MOST_FAMILIES = 40
LINE = 0.6  # radius in points of the screen

_NO_LINES = rr.LineStrips2D.from_fields(strips=[])


@dataclass(slots=True)
class Lineage:
    """Draws the lines of one run; remembers the last updates."""

    paths: RunPaths
    ancestry: Ancestry = field(default_factory=Ancestry)
    _before: Belief | None = None  # what the last update handed on

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change."""
        radius = rr.components.Radius.ui_points
        moved = rr.LineStrips2D.from_fields(colors=[MOVED], radii=radius(LINE), draw_order=15.0)
        family = rr.LineStrips2D.from_fields(colors=[FAMILY], radii=radius(LINE), draw_order=16.0)
        rec.log(self.paths.moves, moved, static=True)
        rec.log(self.paths.families, family, static=True)

    def draw_moves(self, rec: rr.RecordingStream, predicted: Belief, scale: Scale) -> None:
        """Log lines from where some particles were to where the motion model put them; clear the others."""
        rec.log(self.paths.families, _NO_LINES)
        before = self._before
        if before is None or before.size != predicted.size:  # dual draws and other sizes have no one parent
            return
        some = spread_over(predicted.size, MOST_MOVES)
        ends = np.stack([positions(before, scale)[some], positions(predicted, scale)[some]], axis=1)
        rec.log(self.paths.moves, rr.LineStrips2D.from_fields(strips=strips_of(ends)))

    def clear_moves(self, rec: rr.RecordingStream) -> None:
        """Take the lines away: the next phase has other things to show."""
        rec.log(self.paths.moves, _NO_LINES)

    def clear_families(self, rec: rr.RecordingStream) -> None:
        """Take the lines of ancestors away, so that particles drawn anew can be seen."""
        rec.log(self.paths.families, _NO_LINES)

    def draw_families(self, rec: rr.RecordingStream, record: StepRecord, scale: Scale) -> None:
        """Log the ways by which the ancestors of some survivors came here."""
        if record.parents is None:
            return
        ways = [scale.screen(way) for way in self.ancestry.lines(MOST_FAMILIES) if len(way) > 1]
        rec.log(self.paths.families, rr.LineStrips2D.from_fields(strips=strips_of(ways)))

    def remember(self, record: StepRecord) -> None:
        """Take in an update: before its families are drawn, after its moves are."""
        self.ancestry.see(record)
        self._before = record.belief


def spread_over(count: int, most: int) -> F64:
    """Give at most so many indices, spread evenly over so many things."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64) if count else np.zeros(0, int)
