"""Frames for drives without pictures: one a row of readings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import InputError, ReadingNotes
from ..reading.recording import Picture, Readings, Record, Recording, RecordingWrapper
from ..reading.transforms import gray_picture


@dataclass(frozen=True, slots=True, eq=False)
class FramesOfReadings(RecordingWrapper):
    """A recording of readings without pictures: a gray one goes with every row of readings.

    Where names come in turn, not together, a row ends with the one that came first.
    """

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, a gray picture after all of a time at which a row came."""
        names: set[str] = set()  # of the first row
        due_s = math.inf
        for record in self.measured.records(notes):
            if record.t_s > due_s:
                yield gray_picture(due_s)
                due_s = math.inf
            if isinstance(record, Readings) and record.values:
                names = names or set(record.values)
                due_s = record.t_s if names & set(record.values) else due_s
            yield record
        if due_s < math.inf:
            yield gray_picture(due_s)


def with_frames(recording: Recording) -> Recording:
    """Give a recording that has readings and no picture a gray one a row; any other stays as it is."""
    readings = False
    try:
        for record in recording.records(ReadingNotes(keep_going=True)):
            if isinstance(record, Picture):
                return recording
            readings = readings or isinstance(record, Readings)
    except InputError:
        return recording  # told where the drive is read
    return FramesOfReadings(recording) if readings else recording
