"""What a report keeps of a run: a few numbers a step, never a cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.analysis.events import EventDetector, RunEvent
from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..playback import ResultCollector, RunResult
from ..style import Scale
from ..text.narration import errors
from .restoring import Restored

NUMBERS = (
    "step",
    "time_s",
    "position_error_m",
    "heading_error_rad",
    "spread_m",
    "confidence",
    "effective_share",
    "effective_sample_size",
    "calibrated_evidence",
    "log_evidence",
    "odometry_m",
)
POSES = ("estimate", "truth", "odometry")
NOWHERE: F64 = np.full(3, np.nan)


@dataclass(slots=True)
class Track:
    """One run, step by step; what is not known is NaN."""

    label: str
    rows: list[tuple[float, ...]] = field(default_factory=list)  # NUMBERS
    poses: list[F64] = field(default_factory=list)  # (3, 3): POSES, each x_m, y_m, heading_rad
    events: list[RunEvent] = field(default_factory=list)
    _odometry: F64 | None = None

    def add(self, moment: Moment, record: StepRecord, start: F64 | None) -> None:
        """Take in the next update; `start` (3,) is where the run began, where that is known."""
        truth = moment.truth
        apart, angle = (np.nan, np.nan) if truth is None else errors(record.estimate, truth)
        share = record.effective_sample_size / record.weighted.size
        motions = record.frame.motions
        values = (
            float(moment.frame.step),
            moment.frame.time_s,
            apart,
            angle,
            float(np.hypot(*record.mean_estimate.sd_m)),
            record.estimate.confidence,
            share,
            record.effective_sample_size,
            record.calibrated_evidence,
            record.log_evidence,
            float(np.hypot(motions[:, 0], motions[:, 1]).sum()),
        )
        self._odometry = self._reckoned(motions, truth, start)
        known = [NOWHERE if pose is None else pose for pose in (truth, self._odometry)]
        self.rows.append(values)
        self.poses.append(np.stack([record.estimate.pose, *known]))

    def _reckoned(self, motions: F64, truth: F64 | None, start: F64 | None) -> F64 | None:
        """Add up the odometry, uncorrected, from the first true pose, or from the start."""
        if not self.rows and truth is not None:
            return truth
        pose = start if not self.rows else self._odometry
        for motion in motions:
            pose = None if pose is None else compose(pose, motion)
        return pose

    def column(self, name: str) -> F64:
        """Give one of NUMBERS for all steps (S,)."""
        return np.array([row[NUMBERS.index(name)] for row in self.rows], np.float64)

    def path(self, name: str) -> F64:
        """Give one of POSES for all steps (S, 3)."""
        return np.array([poses[POSES.index(name)] for poses in self.poses], np.float64).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class RunStart:
    """What is known of a run before its first step."""

    start: F64 | None  # (3,) where it began; None: anywhere
    bookmarks: Mapping[int, Sequence[str]]  # notes of one's own, by step


def known_of(one: Restored) -> RunStart:
    """Say what a saved run tells before its first step."""
    start = one.saved.manifest.start
    return RunStart(None if start is None else np.array(start), one.bookmarks)


@dataclass(frozen=True, slots=True)
class Collected:
    """All runs of a report, on the same steps."""

    tracks: Sequence[Track]
    results: Sequence[RunResult]
    picture_size: tuple[int, int] | None  # width and height in pixels

    @property
    def steps(self) -> int:
        """How many updates there are."""
        return len(self.tracks[0].rows)


def collect(
    updates: Iterator[tuple[Moment, Mapping[str, StepRecord]]],
    known: Mapping[str, RunStart],
    scale: Scale,
    arena_m: tuple[float, float],
    advance: Callable[[int, int], None],
    total: int,
) -> Collected:
    """Go through all updates once; `known` has what is known beforehand of each run, by its label."""
    tracks = {label: Track(label) for label in known}
    detectors = {label: EventDetector(scale.say, bookmarks=one.bookmarks) for label, one in known.items()}
    scores = ResultCollector(list(known), arena_m, scale.say)
    size: tuple[int, int] | None = None
    for moment, records in updates:
        paired = scores.add(moment, records)
        size = size or (moment.frame.image.shape[1], moment.frame.image.shape[0])
        for label, record in records.items():
            tracks[label].add(moment, record, known[label].start)
            tracks[label].events.extend(detectors[label].see(moment, record))
        for label, step in paired.items():
            tracks[label].events.extend([] if step.event is None else [step.event])
        advance(moment.frame.step, total)
    return Collected(list(tracks.values()), scores.results(), size)
