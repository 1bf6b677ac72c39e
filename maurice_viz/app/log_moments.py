"""The moments of a native log, session or survey, with their pictures and without."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from maurice_loaders.formats.registry import open_recording
from maurice_loaders.io.notes import ReadingNotes
from maurice_loaders.recorded_session import Glance, RecordedSession
from maurice_loaders.session_log.reader import SessionLog
from maurice_mcl.session import Frame, Moment


def moments_of(log: SessionLog) -> Iterator[Moment]:
    """Give a session's moments; of a survey its pictures that are not covered, their poses as truth."""
    if log.kind == "session":
        yield from log.moments()
        return
    taken = (picture for picture in log.survey_pictures() if not picture.covered)
    for step, picture in enumerate(taken, start=1):
        name = "" if picture.path is None else str(picture.path)
        yield Moment(Frame(step, float(step), np.zeros((0, 3)), picture.image, name), picture.pose)


def glances_of(log: SessionLog) -> Iterator[Glance]:
    """Give what is known of the same moments without their pictures."""
    if log.kind == "session":
        yield from RecordedSession(open_recording(log.path)).glances(ReadingNotes(keep_going=True))
        return
    for moment in moments_of(log):
        yield Glance(moment.frame.motions, moment.truth, ())
