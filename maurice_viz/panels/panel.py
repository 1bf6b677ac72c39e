"""What a panel is: it logs what does not change, then draws every update of its run.

A panel owns the entities that it draws: no other panel logs them. Beside the class, its file holds the view
(or views) in which layouts show it, with the title.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from maurice_mcl.filter.localizer import EXPANDED
from maurice_mcl.reasons.failures.kinds import Failure
from maurice_mcl.scoring.events import RunEvent
from maurice_mcl.scoring.modes import TrackedMode
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.sensor.references import NearestReference, nearest_reference
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.library import Library
from maurice_mcl.values.radii import USUAL, Radii
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment

from ..drawing.canvas import png
from ..entities import PHASE, SESSION, STEP, Phase, RunPaths, phase_number
from ..style import RGB, RUN_COLORS, Scale

MARKDOWN = "text/markdown"


@dataclass(frozen=True, slots=True, eq=False)
class EntryFinder:
    """Finds the library entry that represents a pose, by the library's own rule."""

    nearest: NearestReference
    origin: F64  # (2,)

    @classmethod
    def of(cls, library: Library) -> EntryFinder:
        """Return the finder of a library with at least one entry."""
        return cls(nearest_reference(library.poses, library.arena), library.origin)

    def entry_at(self, pose: F64) -> int:
        """Return the entry nearest to a pose (3,) in the map's frame; -1 outside free space."""
        relative = (pose - np.append(self.origin, 0)).astype(np.float32)
        return int(self.nearest.entries(relative[None], self.origin)[0])


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRun:
    """What the panels of a run know before its first picture."""

    paths: RunPaths
    library: Library  # of another localizer's run, or of a saved run without it: no entries
    scale: Scale
    distances: Mapping[str, str]  # of the sensor model, by channel
    finder: EntryFinder | None = None  # None: the library has no entries
    sensor: SensorModel | None = None  # None: nothing can be explained
    has_truth: bool = True
    draws_scene: bool = True  # whether this run draws what all runs share: map, camera, truth
    updates: int = 0  # how many there will be; 0 where that is not known
    radii: Radii = USUAL  # by which the run is judged
    color: RGB = RUN_COLORS[0]  # of its estimate, everywhere

    @property
    def is_recorded(self) -> bool:
        """Whether another localizer ran it: its sensor model is not known, and nothing is drawn afresh."""
        return not self.distances and not (self.sensor is not None and self.sensor.sensors)


@dataclass(frozen=True, slots=True, eq=False)
class StepUpdate:
    """One update of a run as panels draw it."""

    moment: Moment
    record: StepRecord
    events: tuple[RunEvent, ...] = ()
    status: str = ""  # the localization status after this update
    knows: float | None = None  # probability that the estimate is right, without truth; None: not known
    modes: tuple[TrackedMode, ...] = ()  # heaviest first
    whole: bool = True  # draw in full; else only what is cheap
    is_first: bool = False

    @property
    def is_reseeded(self) -> bool:
        """Whether this update ended with particles drawn anew, or all moved at random."""
        return self.record.injected is not None or EXPANDED in self.record.events


class Panel:
    """One panel of one run. The defaults do nothing."""

    def __init__(self, run: DrawnRun) -> None:
        self._run, self._paths, self._scale, self._library = run, run.paths, run.scale, run.library

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change, static."""

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log one update; sets the time of what it logs."""

    def clear(self, rec: rr.RecordingStream) -> None:
        """Empty what is not drawn until the next full update, or it would show an earlier one."""

    def diagnosed(self, rec: rr.RecordingStream, failures: Sequence[Failure]) -> None:
        """Log why the run failed; called when it is over, before `finish`."""

    def finish(self, rec: rr.RecordingStream) -> None:
        """Log what is known only when the run is over."""


def set_phase(rec: rr.RecordingStream, moment: Moment, phase: Phase) -> None:
    """Set all three timelines to one phase of one update."""
    set_place(rec, moment.frame.step, moment.frame.time_s, phase)


def set_place(rec: rr.RecordingStream, step: int, time_s: float, phase: Phase) -> None:
    """Set all three timelines to one phase of the update of this number and time."""
    rec.set_time(STEP, sequence=step)
    rec.set_time(SESSION, duration=time_s)
    rec.set_time(PHASE, sequence=phase_number(step, phase))


def set_phase_only(rec: rr.RecordingStream, moment: Moment, phase: Phase) -> None:
    """Set the phase timeline alone: what is logged now hides nothing on the others."""
    set_phase(rec, moment, phase)
    rec.disable_timeline(STEP)
    rec.disable_timeline(SESSION)


def place_drawing(
    rec: rr.RecordingStream, path: str, image: U8, corner: tuple[float, float], scale: float, order: float
) -> None:
    """Log a drawing (H, W, 3), static, with its upper left corner there and its pixels this large."""
    picture = rr.EncodedImage(contents=png(image), media_type="image/png", draw_order=order)
    rec.log(path, picture, rr.Transform3D(translation=[*corner, 0], scale=scale), static=True)
