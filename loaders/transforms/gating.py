"""Which pictures make an update: those after enough movement, or every n-th."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from maurice_mcl.arrays import F64

from ..io.notes import ReadingNotes
from ..recording import Picture, Record, RecordingWrapper

# Which pictures make an update: those after enough movement (AMCL's update_min_d and update_min_a).


@dataclass(frozen=True, slots=True)
class Gate:
    """How far a robot goes before a picture is used. Nothing asked for: every picture is."""

    min_distance_m: float = 0.0  # as the crow flies since the last picture that was used
    min_angle_rad: float = 0.0  # turned since the last picture that was used

    def open_after(self, way: F64) -> bool:
        """Return whether a way (3,) makes an update: far enough, or turned enough, of what is asked.

        `way` is all that moved since, as `recording.together` joins it.
        """
        asked = (self.min_distance_m > 0, self.min_angle_rad > 0)
        far = asked[0] and math.hypot(way[0], way[1]) >= self.min_distance_m
        return not any(asked) or bool(far or (asked[1] and abs(way[2]) >= self.min_angle_rad))


# Every second, third, ... picture of a recording; what moved between them is kept.


@dataclass(frozen=True, slots=True, eq=False)
class FewerPictures(RecordingWrapper):
    """A recording of which one picture of every `stride` is there, the first among them."""

    stride: int

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records but the pictures between."""
        pictures = 0
        for record in self.measured.records(notes):
            if isinstance(record, Picture):
                pictures += 1
                if (pictures - 1) % self.stride:
                    continue
            yield record
