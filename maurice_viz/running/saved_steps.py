"""The steps of saved runs: restored with pictures and comparisons, and the few numbers kept of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import SavedRun
from maurice_loaders.runs.writer import StepRows, moment_of, picture_hash, record_of, weighted_of
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.events import EventDetector, RunEvent
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import Belief, Comparison, Sighting, StepRecord
from maurice_mcl.values.session import Moment, Session

from ..errors import Listener
from ..playback import ResultCollector, RunResult
from ..style import MISSING, Scale
from ..text.causes import with_failures

NO_PICTURE: U8 = np.full((90, 120, 3), MISSING, np.uint8)  # shown where the session's picture is not there


@dataclass(slots=True)
class Pictures:
    """The session's pictures, step by step, as long as they are those that the run saw."""

    session: Session | None = None
    warn: Callable[[str], None] = lambda text: None
    readings: Mapping[str, float] = field(default_factory=dict)  # of the last step asked for
    scan: LaserScan | None = None  # the same
    _moments: Iterator[Moment] | None = field(init=False)

    def __post_init__(self) -> None:
        self._moments = None if self.session is None else iter(self.session.moments())

    def of(self, rows: StepRows) -> U8 | None:
        """Return the picture of the next step; None from the first on that is missing or another."""
        if self._moments is None:
            return None
        try:
            frame = next(self._moments).frame
            image, self.readings, self.scan = frame.image, frame.readings, frame.scan
            problem = "is not the one that the run saw"
        except (InputError, StopIteration) as stop:
            image, problem = NO_PICTURE, f"is not there ({stop})"
        if picture_hash(image, self.scan) == rows.step["picture_sha256"]:
            return image
        self._moments = self.scan = None
        step = rows.step["step"]
        self.warn(f"the picture of step {step} {problem}; from here on its panels stay empty")
        return None


@dataclass(frozen=True, slots=True)
class Restored:
    """One saved run, and the filter that it was made with, if session and library are still there."""

    saved: SavedRun
    localizer: Localizer | None  # None: session or library is gone

    @property
    def sensor(self) -> SensorModel | None:
        """What compares pictures with the library, if that is there."""
        return None if self.localizer is None else self.localizer.sensor

    @property
    def start(self) -> F64 | None:
        """Where the run began (3,); None: anywhere."""
        start = self.saved.manifest.start
        return None if start is None else np.array(start)

    def record(self, rows: StepRows, moment: Moment, image: U8 | None) -> StepRecord:
        """Return the record of one update, its comparison made again where possible."""
        origin, radii = np.array(self.saved.manifest.origin_m), self.saved.manifest.radii
        if self.sensor is None or image is None:
            record = record_of(rows, moment.frame, nothing_seen(rows.particles.height), origin, radii)
            recorded = self.saved.manifest.recorded
            return replace(record, belief=without_heirs(record.belief)) if recorded else record
        comparison = self.sensor.see(moment.frame)
        sighting = self.sensor.at(comparison, weighted_of(rows, origin).poses)
        return record_of(rows, moment.frame, sighting, origin, radii)


def restored_together(
    runs: Sequence[Restored], pictures: Pictures
) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
    """Go through saved runs of one session side by side, as far as the shortest goes."""
    for rows in zip(*(run.saved.steps() for run in runs), strict=False):
        image = pictures.of(rows[0])
        moment = moment_of(rows[0], NO_PICTURE if image is None else image, pictures.readings, pictures.scan)
        parts = zip(runs, rows, strict=True)
        yield moment, {run.saved.manifest.label: run.record(row, moment, image) for run, row in parts}


def nothing_seen(particles: int) -> Sighting:
    """Make a sighting without any reference, for when comparisons cannot be made again.

    Which particles are in a wall is unknown, so that all count as in free space.
    """
    none, table = np.zeros(0, np.float32), np.zeros((0, 0), np.float32)
    comparison = Comparison((), {}, table, table, none, table, none, none)
    unknown = np.full(particles, np.nan, np.float32)
    return Sighting(comparison, np.zeros(particles, np.int32), unknown)


def without_heirs(belief: Belief) -> Belief:
    """Return a recorded cloud, of which nobody knows whom the particles of the next one come from.

    Lines from particle to particle are drawn where a cloud is as large as the one before it was left, so that
    one of no weight is added.
    """
    poses = np.append(belief.poses, belief.poses[:1], axis=0)
    return Belief(poses, np.append(belief.log_weights, -np.inf), belief.origin)


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One run of a report: its table, and the events that are worth a look."""

    label: str
    table: RunTable
    events: Sequence[RunEvent] = ()


@dataclass(frozen=True, slots=True)
class Collected:
    """All runs of a report, on the same steps."""

    tracks: Sequence[Track]
    results: Sequence[RunResult]
    picture_size: tuple[int, int] | None  # width and height in pixels

    @property
    def steps(self) -> int:
        """How many updates there are."""
        return self.tracks[0].table.updates


def collect(
    runs: Sequence[Restored],
    pictures: Pictures,
    scale: Scale,
    arena: Arena,
    listener: Listener,
) -> Collected:
    """Go through all updates of saved runs once."""
    runs_by_label = {run.saved.manifest.label: run for run in runs}
    events = {label: list[RunEvent]() for label in runs_by_label}
    detectors = {label: EventDetector(scale.say) for label in runs_by_label}
    localizers = {label: run.localizer for label, run in runs_by_label.items()}
    starts = {label: run.start for label, run in runs_by_label.items()}
    scores = ResultCollector(list(runs_by_label), arena, scale.say, localizers=localizers, starts=starts)
    size: tuple[int, int] | None = None
    for moment, records in restored_together(runs, pictures):
        scores.add(moment, records)
        size = size or (moment.frame.image.shape[1], moment.frame.image.shape[0])
        for label, record in records.items():
            events[label].extend(detectors[label].see(moment, record, scores.run(label)))
        listener.progress(moment.frame.step, runs[0].saved.manifest.pictures, "read")
    for label, event in scores.partings().items():
        events[label].append(event)
    results = scores.results()
    tracks = []
    for run in results:
        table = scores.table(run.label)
        times_s = dict(zip(table.steps.tolist(), table.times_s.tolist(), strict=True))
        run_events = with_failures(events[run.label], run.verdict.failures, times_s, scale)
        tracks.append(Track(run.label, table, run_events))
    return Collected(tracks, results, size)
