"""What is in a log or a recording: what it holds, how fast, how complete."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.session import SessionInfo

from ..errors import InputError, PictureError
from ..io.notes import ReadingNotes
from ..io.pictures import decode_picture, picture_format
from ..recorded_session import RecordedSession
from ..recording import Motion, Note, OdometryPose, Picture, Record, TruthPose, checked
from ..session_log.header import Kind
from ..session_log.reader import picture_bytes
from ..session_log.records import (
    EventRecord,
    OdometryRecord,
    PictureRecord,
    TruthRecord,
    read_header,
    read_records,
)
from ..session_log.records import Record as LogRecord
from ..session_log.truth import is_kidnapping, with_truth
from ..transforms.clocks import TimeSpan

# Looking a log over without replaying it: what is in it, how fast, how whole.


@dataclass(frozen=True, slots=True)
class Inspection:
    """What a log holds. Rates and distances are None where there is nothing to tell them from."""

    path: str
    kind: str  # "session" or "survey"
    name: str
    records: dict[str, int]  # lines of each kind: odometry, image, covered, truth, event
    duration_s: float  # from the first to the last record
    picture_rate_hz: float | None
    odometry_rate_hz: float | None
    pictures: dict[str, int]  # readable pictures by format and size, as "JPEG 176x144"
    distance_odometry_m: float | None  # way as the robot measured it
    distance_truth_m: float | None  # way between truth records, kidnappings left out
    truth_share: float | None  # of a session's pictures (not covered) whose true pose is known
    cameras: tuple[str, ...]  # in the header
    events: tuple[str, ...]  # the first 100
    survey: str | None  # the survey or library that the header names
    survey_found: bool | None  # None when it names none
    has_map: bool
    problem_count: int
    problems: tuple[str, ...]  # the first 100, each with its line
    warnings: tuple[str, ...]


def inspect_session(path: Path) -> Inspection:
    """Read a log to its end, every picture included. InputError only when it has no readable header."""
    info, kind = read_header(path)
    notes = ReadingNotes(keep_going=True)
    tally = _Tally(path, notes)
    for record, truth in with_truth(read_records(path, kind, notes)):
        tally.add(record, truth)
    if info.survey is not None and not info.survey.exists():
        notes.warning(f"the header names {info.survey}, which is not there")
    if len(tally.pictures) > 1:
        notes.warning(f"pictures differ in format or size: {', '.join(sorted(tally.pictures))}")
    return _inspection(path, kind, info, tally, notes)


class _Tally:
    """Counts while the records pass by; holds sums and never the records."""

    def __init__(self, path: Path, notes: ReadingNotes) -> None:
        self._path = path
        self._notes = notes
        self._begin_s: float | None = None
        self._before: F64 | None = None  # the last true pose
        self.records: Counter[str] = Counter()
        self.pictures: Counter[str] = Counter()
        self.spans = {"image": _Span(), "odometry": _Span(), "all": _Span()}
        self.odometry_m = 0.0
        self.truth_m = 0.0
        self.true_pictures = 0
        self.events: list[str] = []

    def add(self, record: LogRecord, truth: F64 | None) -> None:
        """Take in one record."""
        self.spans["all"].add(record.t_s)
        if isinstance(record, OdometryRecord):
            self.records["odometry"] += 1
            self.spans["odometry"].add(record.t_s)
            self.odometry_m += float(np.hypot(*record.motion[:2]))
        elif isinstance(record, TruthRecord):
            self._add_truth(record)
        elif isinstance(record, EventRecord):
            self._add_event(record)
        else:
            self._add_picture(record, truth)

    def _add_truth(self, record: TruthRecord) -> None:
        self.records["truth"] += 1
        if self._before is not None:
            self.truth_m += float(np.hypot(*(record.pose - self._before)[:2]))
        self._before = record.pose

    def _add_event(self, record: EventRecord) -> None:
        self.records["event"] += 1
        if is_kidnapping(record):
            self._before = None
        if len(self.events) < 100:
            self.events.append(record.text)

    def _add_picture(self, record: PictureRecord, truth: F64 | None) -> None:
        self.records["covered" if record.covered else "image"] += 1
        if not record.covered:
            self.spans["image"].add(record.t_s)
            self.true_pictures += truth is not None
        try:
            data = picture_bytes(record, self._path)
            height, width = decode_picture(data).shape[:2]
        except PictureError as problem:
            where = f"{record.path}: " if record.path else ""
            self._notes.problem(InputError(self._path, f"{where}{problem}", record.line))
        else:
            self.pictures[f"{picture_format(data)} {width}x{height}"] += 1


class _Span:
    """First and last time of something, and how often it came."""

    def __init__(self) -> None:
        self.count = 0
        self._first_s = 0.0
        self._last_s = 0.0

    def add(self, t_s: float) -> None:
        """Take in one time."""
        self._first_s = t_s if self.count == 0 else self._first_s
        self._last_s = t_s
        self.count += 1

    @property
    def length_s(self) -> float:
        """From the first to the last."""
        return self._last_s - self._first_s

    @property
    def rate_hz(self) -> float | None:
        """Intervals a second; None when there is no time between."""
        return (self.count - 1) / self.length_s if self.length_s > 0 else None


def _inspection(path: Path, kind: Kind, info: SessionInfo, tally: _Tally, notes: ReadingNotes) -> Inspection:
    counts = tally.records
    return Inspection(
        path=str(path),
        kind=kind,
        name=info.name,
        records={key: counts[key] for key in ("odometry", "image", "covered", "truth", "event")},
        duration_s=tally.spans["all"].length_s,
        picture_rate_hz=tally.spans["image"].rate_hz,
        odometry_rate_hz=tally.spans["odometry"].rate_hz,
        pictures=dict(tally.pictures),
        distance_odometry_m=tally.odometry_m if counts["odometry"] else None,
        distance_truth_m=tally.truth_m if counts["truth"] else None,
        truth_share=tally.true_pictures / counts["image"] if counts["image"] and kind == "session" else None,
        cameras=tuple(camera.name for camera in info.cameras),
        events=tuple(tally.events),
        survey=None if info.survey is None else str(info.survey),
        survey_found=None if info.survey is None else info.survey.exists(),
        has_map=info.arena is not None,
        problem_count=notes.count,
        problems=tuple(str(problem) for problem in notes.problems),
        warnings=notes.warnings,
    )


# Looking a recording of any format over: what is in it, how fast, how whole.

MOST_EVENTS = 100


def inspect_recording(session: RecordedSession) -> Inspection:
    """Read a recording to its end, every picture included. InputError only where nothing more can be read."""
    notes = ReadingNotes(keep_going=True)
    tally = _Tally_inspection(session, notes)
    for record in checked(session.recording, notes):
        tally.add(record)
    truth_share = _truth_share(session, tally.records["image"], notes)
    info = session.info
    return Inspection(
        path=str(session.path),
        kind="session",
        name=info.name,
        records={key: tally.records[key] for key in ("odometry", "image", "covered", "truth", "event")},
        duration_s=tally.spans["all"].last_s - tally.spans["all"].first_s,
        picture_rate_hz=_rate(tally.spans["image"]),
        odometry_rate_hz=_rate(tally.spans["odometry"]),
        pictures=dict(tally.pictures),
        distance_odometry_m=tally.ways["odometry"] if tally.records["odometry"] else None,
        distance_truth_m=tally.ways["truth"] if tally.records["truth"] else None,
        truth_share=truth_share,
        cameras=tuple(camera.name for camera in info.cameras),
        events=tuple(tally.events),
        survey=None if info.survey is None else str(info.survey),
        survey_found=None if info.survey is None else info.survey.exists(),
        has_map=info.arena is not None,
        problem_count=notes.count,
        problems=tuple(str(problem) for problem in notes.problems),
        warnings=notes.warnings,
    )


def _truth_share(session: RecordedSession, pictures: int, notes: ReadingNotes) -> float | None:
    """Return the share of pictures that have a true pose, and say how pairing went."""
    if not pictures:
        return None
    kept = RecordedSession(session.recording, session.options)
    try:
        with_truth = sum(glance.truth is not None for glance in kept.glances(notes))
    except InputError as problem:  # clocks disagree: worth saying, and the rest is still told
        notes.problem(problem)
        return None
    return with_truth / pictures


def _rate(span: TimeSpan) -> float | None:
    length_s = span.last_s - span.first_s
    return (span.count - 1) / length_s if length_s > 0 else None


class _Tally_inspection:
    """Counts while the records pass by; holds sums and never the records."""

    def __init__(self, session: RecordedSession, notes: ReadingNotes) -> None:
        self._session = session
        self._notes = notes
        self._before: dict[str, F64] = {}
        self.records: Counter[str] = Counter()
        self.pictures: Counter[str] = Counter()
        self.spans = {
            "image": TimeSpan(),
            "odometry": TimeSpan(),
            "truth": TimeSpan(),
            "event": TimeSpan(),
            "all": TimeSpan(),
        }
        self.ways = {"odometry": 0.0, "truth": 0.0}
        self.events: list[str] = []

    def add(self, record: Record) -> None:
        """Take in one record."""
        kind = _KINDS[type(record)]
        self.records[kind] += 1
        self.spans[kind].add(record.t_s)
        self.spans["all"].add(record.t_s)
        if isinstance(record, OdometryPose | TruthPose):
            before = self._before.get(kind, record.pose)
            self.ways[kind] += float(np.hypot(*(record.pose - before)[:2]))
            self._before[kind] = record.pose
        elif isinstance(record, Motion):
            self.ways[kind] += float(np.hypot(*record.motion[:2]))
        elif isinstance(record, Picture):
            self._add_picture(record)
        else:
            self._add_note(record)

    def _add_note(self, record: Note) -> None:
        if record.text.startswith("kidnapped"):
            self._before.pop("truth", None)
        if len(self.events) < MOST_EVENTS:
            self.events.append(record.text)

    def _add_picture(self, record: Picture) -> None:
        try:
            height, width = record.read().shape[:2]
        except PictureError as problem:
            self._notes.problem(InputError(self._session.path, f"{record.name}: {problem}"))
        else:
            self.pictures[f"{width}x{height}"] += 1


_KINDS: dict[type[Record], str] = {
    Picture: "image",
    OdometryPose: "odometry",
    Motion: "odometry",
    TruthPose: "truth",
    Note: "event",
}
