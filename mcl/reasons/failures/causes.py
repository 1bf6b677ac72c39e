"""What befell the robot or its camera during a drive: facts that can explain why a run went wrong.

They come from the log's events, from the truth beside the odometry, and from the pictures; each is left out
where its source is missing. `verdict` connects them with what a run did.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from ...filter.localizer import Localizer
from ...values.arrays import F64
from ...values.geometry import compose_motions
from ...values.map import SOLID, Region
from ...values.radii import Radii
from ...values.records import StepRecord
from ...values.session import Moment
from .light import mean_level

CARRIED = "carried"  # the log says so: expected None, actual meters
JUMPED = "jumped"  # the truth moved much farther than odometry says: expected and actual meters
SLIPPED = "slipped"  # odometry went on while the robot did not: expected and actual meters
OVERSTATED = "overstated"  # the same where odometry is made from pictures: no wheel slipped
TURNED = "turned"  # the log tells of a slip: its words
DARK = "dark"  # pictures darker than any before: expected and actual mean gray level, 0 to 255
LIGHTS = "lights"  # the log tells of another light: its words

SLIP_SHARE = 0.5  # of the longer distance that truth and odometry must differ by
DARKER = 2 / 3  # of the darkest picture before
DARK_FOR = 3  # updates in a row, unless the log tells of another light
KNOWN = 5  # pictures that must have been seen before one is dark
DEEP_CELLS = 1.0  # of the map's raster: nearer to its outline a pose may be off, or a cell too large
ALIKE = 0.5  # of the usual scatter of the references' likelihoods: below it they score alike


@dataclass(frozen=True, slots=True)
class Cause:
    """One thing that befell a drive, from one step to another; the kinds above say what the values are."""

    kind: str
    step: int
    last: int
    expected: float | None = None
    actual: float | None = None
    words: str = ""  # of the log
    alike: bool = False  # of dark pictures: whether this run's references score alike since then

    @property
    def shown_at(self) -> int:
        """The step at which it is seen best: a slip at its end, all else at once."""
        return self.last if self.kind in (SLIPPED, OVERSTATED) else self.step


@dataclass(slots=True)
class CauseFinder:
    """Follows the drive of one run update by update; keeps a few numbers."""

    found: tuple[Cause, ...] = ()
    too_long: str = SLIPPED  # what a movement is called that odometry says is much longer than it was
    _truth: F64 | None = None  # of the update before
    _gray: list[float] = field(default_factory=list)  # of the last pictures before it got dark
    _scatter: list[float] = field(default_factory=list)  # of the references' likelihoods, of the same
    _least: float = np.inf  # gray level of the darkest of all these
    _seen: int = 0
    _dark: list[tuple[int, float, float]] = field(default_factory=list)  # step, gray and scatter since then

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        self.drive(moment, record.estimate.radii)
        self._look(moment.frame.step, record, bool(moment.told("lights")))

    def drive(self, moment: Moment, radii: Radii) -> None:
        """Process what truth, odometry and log tell of the next update, without its picture."""
        step, truth, before = moment.frame.step, moment.truth, self._truth
        moved_m = None if truth is None or before is None else float(np.hypot(*(truth - before)[:2]))
        self._truth = truth
        if moment.kidnapped:
            self._add(Cause(CARRIED, step, step, None, moved_m))
        elif moved_m is not None:
            told = any("deg" not in text for text in moment.told("slip"))
            slip_m = 0.0 if told else radii.confidence_m / 2
            self._compare(step, moment.frame.motions, moved_m, slip_m, radii.lost_m)
        turned = [text for text in moment.told("slip") if "deg" in text]
        for kind, texts in ((TURNED, turned), (LIGHTS, moment.told("lights"))):
            if texts:
                self._add(Cause(kind, step, step, words=texts[0]))

    def _add(self, cause: Cause) -> None:
        self.found = (*self.found, cause)

    def _compare(self, step: int, motions: F64, moved_m: float, slip_m: float, jump_m: float) -> None:
        """Compare how far the robot moved with what odometry says."""
        driven_m = float(np.hypot(*reduce(compose_motions, motions)[:2])) if len(motions) else 0.0
        if moved_m - driven_m > jump_m:
            self._add(Cause(JUMPED, step, step, driven_m, moved_m))
        if driven_m - moved_m <= max(slip_m, SLIP_SHARE * driven_m):
            return
        last = self.found[-1] if self.found else None
        if last is not None and last.kind == self.too_long and last.last == step - 1:
            expected, actual = (last.expected or 0.0) + driven_m, (last.actual or 0.0) + moved_m
            self.found = (*self.found[:-1], replace(last, last=step, expected=expected, actual=actual))
        else:
            self._add(Cause(self.too_long, step, step, driven_m, moved_m))

    def _look(self, step: int, record: StepRecord, told: bool) -> None:
        """Look whether the picture is darker than all before; not where none was compared."""
        likelihood = record.sighting.comparison.log_likelihood
        if not len(likelihood):
            return
        gray = mean_level(record.frame.image)
        scatter = float(np.std(likelihood))
        if self._seen < KNOWN or gray >= DARKER * self._least:
            self._seen, self._least, self._dark = self._seen + 1, min(self._least, gray), []
            self._gray, self._scatter = [*self._gray, gray][-KNOWN:], [*self._scatter, scatter][-KNOWN:]
            return
        begins = len(self._dark) == (0 if told else DARK_FOR - 1)
        self._dark.append((step, gray, scatter))
        first, after = self._dark[0][0], float(np.mean([one[1] for one in self._dark]))
        alike = float(np.mean([one[2] for one in self._dark])) < ALIKE * float(np.mean(self._scatter))
        now = Cause(DARK, first, step, float(np.mean(self._gray)), after, alike=alike)
        if begins and not any(one.kind == DARK and one.step == first for one in self.found):
            self._add(now)
        else:
            self.found = tuple(now if (one.kind, one.step) == (DARK, first) else one for one in self.found)


# A robot where the map has an obstacle: a filter that trusts the map has no particle there.


@dataclass(frozen=True, slots=True)
class InObstacle:
    """Updates in a row at which the truth was inside an obstacle of the map."""

    obstacle: str  # its name
    first: int  # step
    last: int


@dataclass(slots=True)
class ObstacleFinder:
    """Follows the truth of one run; without a localizer, or with one that doubts obstacles, finds nothing."""

    localizer: Localizer | None = None
    found: tuple[InObstacle, ...] = ()
    _obstacles: tuple[Region, ...] = ()
    _deep_m: float = 0.0

    def __post_init__(self) -> None:
        if self.localizer is None or self.localizer.obstacles != SOLID:
            return
        self._deep_m = DEEP_CELLS * self.localizer.reference.grid.cell_m
        self._obstacles = self.localizer.library.arena.obstacles

    def see(self, step: int, truth: F64 | None) -> None:
        """Process the next update."""
        if truth is None:
            return
        for obstacle in self._obstacles:
            if obstacle.depth_m(truth[None, :2])[0] > self._deep_m:
                self._add(obstacle.name, step)
                return

    def _add(self, name: str, step: int) -> None:
        last = self.found[-1] if self.found else None
        if last is not None and last.obstacle == name and last.last == step - 1:
            self.found = (*self.found[:-1], replace(last, last=step))
        else:
            self.found = (*self.found, InObstacle(name, step, step))
