"""What a panel is: it logs what does not change, then draws every update of its run.

A panel owns the entities that it draws: no other panel logs them. Beside the class, its file holds the view
(or views) in which layouts show it, with the title. One with a `view` of its own is seen without a layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.filter.localizer import EXPANDED
from maurice_mcl.scoring.events import RunEvent
from maurice_mcl.scoring.modes import TrackedMode
from maurice_mcl.values import F32, U8, Moment, StepRecord

from ..drawing.canvas import png
from ..entities import PHASE, SESSION, STEP, Phase, phase_number
from ..scene import RunView, Scene
from ..style import Order

MARKDOWN = "text/markdown"


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
    """One panel of one run, made before its first picture. The defaults do nothing."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        self._run, self._scene, self._paths = run, scene, run.paths
        self._library, self._scale = scene.library, scene.scale

    @classmethod
    def view(cls, run: RunView, scene: Scene) -> rrb.View | None:
        """Return the view for the tab `more`; None: it stands in other layouts, or in none for this run."""
        return None

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change, static."""

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log one update; sets the time of what it logs."""

    def clear(self, rec: rr.RecordingStream) -> None:
        """Empty what is not drawn until the next full update, or it would show an earlier one."""

    def finish(self, rec: rr.RecordingStream) -> None:
        """Log what is known only when the run is over."""


def joined_labels(places: F32, room: float, texts: Sequence[str]) -> list[str]:
    """Return the labels of places (K, 2); of those nearer to each other than `room` the first has all."""
    labels = [""] * len(places)
    for number, (place, text) in enumerate(zip(places, texts, strict=True)):
        first = int(np.argmax(np.hypot(*(places - place).T) < room))
        first = first if labels[first] or first == number else number
        labels[first] += f", {text}" if labels[first] else text
    return labels


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
    rec.disable_timeline(STEP)
    rec.disable_timeline(SESSION)
    rec.set_time(PHASE, sequence=phase_number(moment.frame.step, phase))


def set_step_only(rec: rr.RecordingStream, moment: Moment) -> None:
    """Set the timelines without phases alone, to an update."""
    rec.disable_timeline(PHASE)
    rec.set_time(STEP, sequence=moment.frame.step)
    rec.set_time(SESSION, duration=moment.frame.time_s)


def place_drawing(
    rec: rr.RecordingStream, path: str, image: U8, corner: tuple[float, float], scale: float, order: Order
) -> None:
    """Log a drawing (H, W, 3), static, with its upper left corner there and its pixels this large."""
    picture = rr.EncodedImage(contents=png(image), media_type="image/png", draw_order=order)
    rec.log(path, picture, rr.Transform3D(translation=[*corner, 0], scale=scale), static=True)
