"""What is in a log or a recording: what it holds, how fast, how complete."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.values import F64, LaserScan, SessionInfo, is_kidnapping

from ..errors import InputError, PictureError, ReadingNotes
from ..files.pictures import decode_picture, picture_format
from ..formats.registry import open_recording
from ..reading.options import Reading
from ..reading.recording import (
    PLACEHOLDER,
    LeftOut,
    Motion,
    Note,
    Picture,
    Readings,
    Record,
    Scan,
    TruthPose,
    checked,
)
from ..reading.session import RecordedSession
from ..reading.time_alignment import TimeSpan
from ..session_log.header import Kind
from ..session_log.reader import LogRecording, is_survey
from .findings import Finding
from .gathering import Gathering
from .plausibility import implausible

MOST_EVENTS = 100
KINDS, OTHERS = ("odometry", "image", "covered", "truth", "event"), ("reading", "scan")


@dataclass(frozen=True, slots=True)
class Inspection:
    """What a log holds. Rates and distances are None if there is nothing to compute them from."""

    path: str
    kind: str  # "session" or "survey"
    name: str
    records: dict[str, int]  # lines of each kind: odometry, image, covered, truth, event, reading, scan
    duration_s: float  # from the first to the last record
    picture_rate_hz: float | None
    odometry_rate_hz: float | None
    pictures: dict[str, int]  # readable pictures by format and size, as "JPEG 176x144"
    distance_odometry_m: float | None  # as the robot measured it
    distance_truth_m: float | None  # between truth records, kidnappings left out
    scans: dict[str, int]  # by beams and reach, as "180 beams over 180 deg, up to 50 m"
    scans_used: int | None  # that a replay uses; None without any
    truth_share: float | None  # of a session's pictures (not covered), or scans used, whose pose is known
    cameras: tuple[str, ...]  # in the header
    events: tuple[str, ...]  # the first 100
    survey: str | None  # the survey or library that the header names
    survey_found: bool | None  # None when it names none
    has_map: bool
    problem_count: int
    problems: tuple[str, ...]  # the first 100, each with its line
    warnings: tuple[str, ...]
    display_units: str = "m"  # of the header, for tables; distances here are in meters
    implausible: tuple[Finding, ...] = ()  # what cannot be, by the numbers alone


def inspect_file(path: Path, options: Reading) -> Inspection:
    """Read a recording or a survey to its end; InputError as for `open_recording`."""
    if options.format is None and is_survey(path):
        return inspect_recording(RecordedSession(LogRecording(path, options, any_kind=True), options))
    return inspect_recording(RecordedSession(open_recording(path, options), options))


def inspect_recording(session: RecordedSession) -> Inspection:
    """Read a recording to its end, every picture included. InputError only if nothing more can be read."""
    notes = ReadingNotes(keep_going=True)
    tally = _Tally(session.path, notes)
    for record in checked(session.recording, notes):
        tally.add(record)
    info = session.info
    if info.survey is not None and not info.survey.exists():
        notes.warning(f"the header names {info.survey}, which is not there")
    if len(tally.pictures) > 1:
        notes.warning(f"pictures differ in format or size: {', '.join(sorted(tally.pictures))}")
    if getattr(session.recording, "kind", "session") == "survey":
        return tally.inspection("survey", info, None)
    truths, scans = _known(session, notes) if tally.used or tally.scans else (None, None)
    whole = tally.used or scans
    share = truths / whole if whole and truths is not None else None
    return tally.inspection("session", info, share, scans if tally.scans else None, session.remarks)


def _known(session: RecordedSession, notes: ReadingNotes) -> tuple[int | None, int | None]:
    """Count the moments with a known pose, and those with a scan; None where they cannot be read."""
    again = RecordedSession(session.recording, session.options)
    second = ReadingNotes(keep_going=True)  # problems are counted already
    try:
        truths = scans = 0
        for moment in again.glances(second):
            truths += moment.truth is not None
            scans += moment.frame.scan is not None
    except InputError as problem:  # the clocks disagree; the rest can still be reported
        notes.problem(problem)
        return None, None
    finally:
        for text in second.warnings:
            notes.warning(text)
    return truths, scans


class _Tally:
    def __init__(self, path: Path, notes: ReadingNotes) -> None:
        self._path, self._notes = path, notes
        self._before: dict[str, F64] = {}  # the last pose of a kind
        self._distance_m = {"odometry": 0.0, "truth": 0.0}
        self._spans: defaultdict[str, TimeSpan] = defaultdict(TimeSpan)
        self._all = TimeSpan()
        self._events: list[str] = []
        self.records: Counter[str] = Counter()
        self.pictures: Counter[str] = Counter()
        self.scans: Counter[str] = Counter()
        self._gathering = Gathering()
        self.used = 0  # pictures that are part of the drive

    def add(self, record: Record) -> None:
        """Take in the next record."""
        self._gathering.add(record)
        if isinstance(record, Note):
            self._add_event(record.t_s, record.text)
        elif isinstance(record, Readings):
            self._count("reading", record.t_s)
        elif isinstance(record, Scan):
            self._count("scan", record.t_s)
            self.scans[_laser(record.scan)] += 1
        elif isinstance(record, LeftOut):
            self._add_picture(record.picture)
        elif isinstance(record, Picture):
            if record.name != PLACEHOLDER:
                self.used += 1
                self._add_picture(record)
        elif isinstance(record, Motion):
            self._count("odometry", record.t_s)
            self._move("odometry", record.motion)
        else:
            kind = "truth" if isinstance(record, TruthPose) else "odometry"
            self._count(kind, record.t_s)
            self._move(kind, record.pose - self._before.get(kind, record.pose))
            self._before[kind] = record.pose

    def _count(self, kind: str, t_s: float) -> None:
        self.records[kind] += 1
        self._spans[kind].add(t_s)
        self._all.add(t_s)

    def _move(self, kind: str, motion: F64) -> None:
        self._distance_m[kind] += float(np.hypot(*motion[:2]))

    def _add_event(self, t_s: float, text: str) -> None:
        """Take in an event; truth is not joined across a kidnapping."""
        self._count("event", t_s)
        if is_kidnapping(text):
            self._before.pop("truth", None)
        if len(self._events) < MOST_EVENTS:
            self._events.append(text)

    def _add_picture(self, picture: Picture) -> None:
        self._count("covered" if picture.covered else "image", picture.t_s)
        try:
            encoded = None if picture.encoded is None else picture.encoded()
            image = picture.read() if encoded is None else decode_picture(encoded)
        except PictureError as problem:
            self._notes.problem(InputError(self._path, f"{picture.name}: {problem}", picture.line))
        else:
            kind = "" if encoded is None else f"{picture_format(encoded)} "
            height, width = image.shape[:2]
            self.pictures[f"{kind}{width}x{height}"] += 1

    def inspection(
        self,
        kind: Kind,
        info: SessionInfo,
        truth_share: float | None,
        scans_used: int | None = None,
        remarks: tuple[str, ...] = (),
    ) -> Inspection:
        counts, notes = self.records, self._notes
        return Inspection(
            path=str(self._path),
            kind=kind,
            name=info.name,
            records={key: counts[key] for key in KINDS} | {key: counts[key] for key in OTHERS if counts[key]},
            duration_s=self._all.last_s - self._all.first_s,
            picture_rate_hz=_rate_hz(self._spans["image"]),
            odometry_rate_hz=_rate_hz(self._spans["odometry"]),
            pictures=dict(self.pictures),
            distance_odometry_m=self._distance_m["odometry"] if counts["odometry"] else None,
            distance_truth_m=self._distance_m["truth"] if counts["truth"] else None,
            scans=dict(self.scans),
            scans_used=scans_used,
            truth_share=truth_share,
            cameras=tuple(camera.name for camera in info.cameras),
            events=tuple(self._events),
            survey=None if info.survey is None else str(info.survey),
            survey_found=None if info.survey is None else info.survey.exists(),
            has_map=info.arena is not None,
            problem_count=notes.count,
            problems=tuple(str(problem) for problem in notes.problems),
            warnings=tuple(dict.fromkeys((*remarks, *notes.warnings))),
            display_units=info.display_units,
            implausible=tuple(implausible(self._gathering.drive(), self._gathering.scans)),
        )


def _laser(scan: LaserScan) -> str:
    span_deg = np.degrees(abs(scan.step_rad) * (scan.size - 1))
    return f"{scan.size} beams over {span_deg:.0f} deg, up to {scan.max_m:.4g} m"


def _rate_hz(span: TimeSpan) -> float | None:
    length_s = span.last_s - span.first_s
    return (span.count - 1) / length_s if length_s > 0 else None
