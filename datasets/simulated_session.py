"""A simulated session without files: pictures are rendered as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maurice_mcl.session import Frame, Moment, SessionInfo

from .maurice import session_info
from .robot.segments import Happened, Moved
from .simulation import SimulationPlan, Stage, stage


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSession:
    """The session of a plan: the same moments as its log would hold, but for JPEG and text rounding none."""

    set_up: Stage
    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        """Drive and look from the beginning, on every call."""
        camera = self.set_up.camera
        for number, segment in enumerate(self.set_up.course.segments(), start=1):
            motions = [entry.motion for entry in segment.entries if isinstance(entry, Moved)]
            told = tuple(entry.text for entry in segment.entries if isinstance(entry, Happened))
            frame = Frame(
                step=number,
                time_s=segment.t_s,
                motions=np.array(motions).reshape(-1, 3),
                image=camera.take(number, segment.pose),
                picture="",
            )
            yield Moment(frame, segment.pose, (*told, *camera.events(number)))


def simulated_session(plan: SimulationPlan) -> SimulatedSession:
    """Set a plan's session up. InputError for worlds and recordings that cannot be used."""
    set_up = stage(plan)
    return SimulatedSession(set_up, session_info(set_up))
