"""Looking a log over without replaying it: what is in it, how fast, how whole."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import F64

from .errors import LogError
from .findings import Findings
from .header import Kind
from .log_records import Record as LogRecord
from .log_records import Event, Odometry, PictureRecord, Truth, read_header, read_records
from .pictures import PictureError, decode_picture, picture_format
from .session_log import picture_bytes
from .truth import is_kidnapping, with_truth


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
    """Read a log to its end, every picture included. LogError only when it has no readable header."""
    info, kind = read_header(path)
    findings = Findings(keep_going=True)
    tally = _Tally(path, findings)
    for record, truth in with_truth(read_records(path, kind, findings)):
        tally.add(record, truth)
    if info.survey is not None and not info.survey.exists():
        findings.warning(f"the header names {info.survey}, which is not there")
    if len(tally.pictures) > 1:
        findings.warning(f"pictures differ in format or size: {', '.join(sorted(tally.pictures))}")
    return _inspection(path, kind, info, tally, findings)


class _Tally:
    """Counts while the records pass by; holds sums and never the records."""

    def __init__(self, path: Path, findings: Findings) -> None:
        self._path = path
        self._findings = findings
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
        if isinstance(record, Odometry):
            self.records["odometry"] += 1
            self.spans["odometry"].add(record.t_s)
            self.odometry_m += float(np.hypot(*record.motion[:2]))
        elif isinstance(record, Truth):
            self._add_truth(record)
        elif isinstance(record, Event):
            self._add_event(record)
        else:
            self._add_picture(record, truth)

    def _add_truth(self, record: Truth) -> None:
        self.records["truth"] += 1
        if self._before is not None:
            self.truth_m += float(np.hypot(*(record.pose - self._before)[:2]))
        self._before = record.pose

    def _add_event(self, record: Event) -> None:
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
            self._findings.problem(LogError(self._path, f"{where}{problem}", record.line))
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


def _inspection(path: Path, kind: Kind, info: SessionInfo, tally: _Tally, findings: Findings) -> Inspection:
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
        problem_count=findings.count,
        problems=tuple(str(problem) for problem in findings.problems),
        warnings=findings.warnings,
    )
