"""Playback saved runs: updates as they were, with pictures and comparisons from elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.runs.rows import StepRows, moment_of, picture_hash, record_of, weighted_of
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.arrays import U8
from maurice_mcl.records import Comparison, Sighting, StepRecord
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.session import Moment, Session

from ..style import MISSING

NO_PICTURE: U8 = np.full((90, 120, 3), MISSING, np.uint8)  # shown where the session's picture is not there


@dataclass(slots=True)
class Pictures:
    """The session's pictures, step by step, as long as they are those that the run saw."""

    session: Session | None
    warn: Callable[[str], None]
    _moments: Iterator[Moment] | None = field(init=False)

    def __post_init__(self) -> None:
        self._moments = None if self.session is None else iter(self.session.moments())

    def of(self, rows: StepRows) -> U8 | None:
        """Give the picture of the next step; None from the first one on that is not there or another one."""
        if self._moments is None:
            return None
        try:
            image = next(moment.frame.image for moment in self._moments)
            problem = "is not the one that the run saw"
        except (InputError, StopIteration) as stop:
            image, problem = NO_PICTURE, f"is not there ({stop})"
        if picture_hash(image) == rows.step["picture_sha256"]:
            return image
        self._moments = None
        step = rows.step["step"]
        self.warn(f"the picture of step {step} {problem}; from here on its panels stay empty")
        return None


@dataclass(frozen=True, slots=True)
class Restored:
    """One saved run, and what compares pictures with the library it was made with, if that is there."""

    saved: SavedRun
    sensor: SensorModel | None
    bookmarks: Mapping[int, Sequence[str]] = field(default_factory=dict)  # notes of one's own, by step

    def record(self, rows: StepRows, moment: Moment, image: U8 | None) -> StepRecord:
        """Give the record of one update, with the comparison made again where that can be."""
        origin = np.array(self.saved.manifest.origin_m)
        if self.sensor is None or image is None:
            return record_of(rows, moment.frame, nothing_seen(rows.particles.height), origin)
        comparison = self.sensor.compare(self.sensor.measure(image))
        sighting = self.sensor.at(comparison, weighted_of(rows, origin).poses)
        return record_of(rows, moment.frame, sighting, origin)


def restored_together(
    runs: Sequence[Restored], pictures: Pictures
) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
    """Go through saved runs of one session side by side, as far as the shortest of them got."""
    for rows in zip(*(run.saved.steps() for run in runs), strict=False):
        image = pictures.of(rows[0])
        moment = moment_of(rows[0], NO_PICTURE if image is None else image)
        parts = zip(runs, rows, strict=True)
        yield moment, {run.saved.manifest.label: run.record(row, moment, image) for run, row in parts}


def nothing_seen(particles: int) -> Sighting:
    """Make a sighting without any reference, for when comparisons cannot be made again."""
    none, table = np.zeros(0, np.float32), np.zeros((0, 0), np.float32)
    comparison = Comparison((), {}, table, table, none, table, none, none)
    unknown = np.full(particles, np.nan, np.float32)
    return Sighting(comparison, np.full(particles, -1, np.int32), unknown)
