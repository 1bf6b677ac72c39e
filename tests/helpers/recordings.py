"""Recordings of records put together in a test, and what is read from recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.errors import ReadingNotes
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose, Record, Recording, TruthPose
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.session import Session, SessionInfo

GIVEN = SessionInfo("given")


@dataclass(frozen=True)
class Given:
    """Records as they are."""

    held: Sequence[Record]
    info: SessionInfo = GIVEN
    path: Path = Path("given")

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        return iter(self.held)


def read(source: Recording | Path, options: Reading | None = None) -> tuple[list[Record], tuple[str, ...]]:
    """Return all records and the warnings."""
    notes = ReadingNotes(keep_going=False)
    recording = open_recording(source, options) if isinstance(source, Path) else source
    return list(recording.records(notes)), notes.warnings


def counted(source: Recording | Path, options: Reading | None = None) -> dict[str, int]:
    return dict(Counter(type(record).__name__ for record in read(source, options)[0]))


def truths(source: Recording | Path, options: Reading | None = None) -> F64:
    return np.array([r.pose for r in read(source, options)[0] if isinstance(r, TruthPose)])


def odometry(source: Recording | Path, options: Reading | None = None) -> F64:
    return np.array([r.pose for r in read(source, options)[0] if isinstance(r, OdometryPose)])


def assert_same_drive(
    ours: Session, theirs: Session, truth: float = 0, motion: float = 0, time: float = 0
) -> None:
    """Expect what the filter is given to be the same, to the last bit but for what is allowed."""
    for one, other in zip(ours.moments(), theirs.moments(), strict=True):
        assert other.frame.step == one.frame.step
        assert other.frame.time_s == pytest.approx(one.frame.time_s, abs=time, rel=0)
        assert other.frame.motions.shape == one.frame.motions.shape
        assert np.abs(other.frame.motions - one.frame.motions).max(initial=0) <= motion
        assert np.array_equal(other.frame.image, one.frame.image)
        assert other.events == one.events
        assert dict(other.frame.readings) == dict(one.frame.readings)
        assert (other.truth is None) == (one.truth is None)
        if one.truth is not None and other.truth is not None:
            assert other.truth == pytest.approx(one.truth, abs=truth, rel=1e-6 if truth else 0)
