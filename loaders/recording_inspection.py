"""Looking a recording of any format over: what is in it, how fast, how whole."""

from __future__ import annotations

from collections import Counter

import numpy as np

from maurice_mcl.typing import F64

from .errors import LogError
from .findings import Findings
from .inspection import Inspection
from .pictures import PictureError
from .recorded_session import RecordedSession
from .recording import Motion, Note, OdometryPose, Picture, Record, TruthPose, checked
from .time_bases import Span

MOST_EVENTS = 100


def inspect_recording(session: RecordedSession) -> Inspection:
    """Read a recording to its end, every picture included. LogError only where nothing more can be read."""
    findings = Findings(keep_going=True)
    tally = _Tally(session, findings)
    for record in checked(session.recording, findings):
        tally.add(record)
    truth_share = _truth_share(session, tally.records["image"], findings)
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
        problem_count=findings.count,
        problems=tuple(str(problem) for problem in findings.problems),
        warnings=findings.warnings,
    )


def _truth_share(session: RecordedSession, pictures: int, findings: Findings) -> float | None:
    """Give the share of pictures that have a true pose, and say how pairing went."""
    if not pictures:
        return None
    kept = RecordedSession(session.recording, session.pairing)
    try:
        with_truth = sum(glance.truth is not None for glance in kept.glances(findings))
    except LogError as problem:  # clocks disagree: worth saying, and the rest is still told
        findings.problem(problem)
        return None
    return with_truth / pictures


def _rate(span: Span) -> float | None:
    length_s = span.last_s - span.first_s
    return (span.count - 1) / length_s if length_s > 0 else None


class _Tally:
    """Counts while the records pass by; holds sums and never the records."""

    def __init__(self, session: RecordedSession, findings: Findings) -> None:
        self._session = session
        self._findings = findings
        self._before: dict[str, F64] = {}
        self.records: Counter[str] = Counter()
        self.pictures: Counter[str] = Counter()
        self.spans = {"image": Span(), "odometry": Span(), "truth": Span(), "event": Span(), "all": Span()}
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
            self._findings.problem(LogError(self._session.path, f"{record.name}: {problem}"))
        else:
            self.pictures[f"{width}x{height}"] += 1


_KINDS: dict[type[Record], str] = {
    Picture: "image",
    OdometryPose: "odometry",
    Motion: "odometry",
    TruthPose: "truth",
    Note: "event",
}
