"""Validation of live lines: a header, then records in time order on one clock."""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from maurice_mcl.values import F64, SessionInfo, motion_between

from ..errors import FieldError, PictureError, ReadingNotes, SourceError
from ..files.pictures import decode_picture
from ..reading.recording import Motion, Note, OdometryPose, Picture, Record, Scan
from ..session_log.header import header_from_json
from ..session_log.records import LineReader, LogLine, parse_object
from .clocks import LiveClock
from .source import Connected, Disconnected, Listening, LiveSource, Malformed

# Lines of a live source: a header, then records in time order.

MOST_BROKEN = 100  # consecutive invalid lines after which a peer is disconnected
GAP, CLOCK = "gap", "clock"  # first words of the events that report one, and a clock that was set back


@dataclass(frozen=True, slots=True, eq=False)
class Received:
    """A record and its line."""

    record: Record
    line: bytes  # with its end


@dataclass(slots=True)
class Counts:
    """What a source sent so far, counted."""

    records: int = 0
    pictures: int = 0
    scans: int = 0
    broken: int = 0  # lines left out
    gaps: int = 0  # interruptions

    @property
    def observed(self) -> str:
        """How many records that make moments came, in words: "14 pictures", "3 pictures and 40 scans"."""
        numbers = {"picture": self.pictures, "scan": self.scans}
        parts = [f"{count} {name}{'s' * (count != 1)}" for name, count in numbers.items() if count]
        return " and ".join(parts) or "no pictures"


class Intake:
    """One pass through a source. Broken lines are counted and left out; SourceError where nothing is left."""

    def __init__(
        self, source: LiveSource, listening: Listening, notes: ReadingNotes, say: Callable[[str], None]
    ) -> None:
        """`say` receives one-line remarks that the user should see at once."""
        self.info: SessionInfo | None = None  # from the first header on
        self.counts = Counts()
        self._source, self._listening, self._notes, self._say = source, listening, notes, say
        self._clock = LiveClock()
        self._place = (source.folder or Path.cwd()) / "live"  # of the log that the lines would be in
        self._reader = LineReader(self._place)
        self._header_next = True
        self._broken_running = 0
        self._why = ""  # it is away
        self._hung_up = ""  # why we hung up the last time
        self._away_since_s: float | None = None
        self._anew = False  # a header came in the middle
        self._odometry: F64 | None = None  # the last pose (3,), of a source that sends poses

    def __iter__(self) -> Iterator[Received | None]:
        """Yield the records; None when nothing came for a moment, and for a header."""
        for arrival in self._listening:
            if arrival is None:
                yield None
            elif isinstance(arrival, LogLine):
                yield from self._take(arrival)
            elif isinstance(arrival, Malformed):
                self._count(SourceError(self._source.name, arrival.why))
            elif isinstance(arrival, Connected):
                self._header_next, self._broken_running = True, 0
            else:
                self._lose(arrival)
                yield None
        if self.info is None and not self._listening.stopped:
            reason = self._hung_up or self._why
            why = f"found no session log there ({reason})" if reason else "found nothing"
            raise SourceError(self._source.name, f"{why}, expected its header; is this the right source?")

    @property
    def away(self) -> bool:
        """Whether the source is away now."""
        return self._away_since_s is not None

    def _take(self, line: LogLine) -> Iterator[Received | None]:
        if not line.data.strip():
            return
        try:
            if line.too_long:
                raise FieldError(f"found a line of more than {len(line.data) // 2**20} MiB")
            if self._header_next or _is_header(line):
                self._greet(line)
                yield None
                return
            record = self._reader.record(line)
            t_s = self._clock.time(record.t_s)
            yield from self._mind_the_gap(t_s)
            yield from self._mind_the_clock(t_s)
            received = self._as_recorded(record, line, t_s)
        except FieldError as problem:
            self._broken(line, problem)
            return
        self._broken_running = 0
        self._listening.heard()
        self.counts.records += 1
        self.counts.pictures += isinstance(record, Picture)
        self.counts.scans += isinstance(record, Scan)
        yield received

    def _greet(self, line: LogLine) -> None:
        """Process a header; the first one is kept, a later one means that the source restarted."""
        info, kind = header_from_json(parse_object(line), self._place)
        if kind != "session":
            raise FieldError(f"found a {kind} log, expected a session log")
        self._header_next = False
        self._listening.greeted()
        self._clock.restart()
        self._odometry, self._anew = None, self.counts.records > 0
        if self.info is None:
            self.info = info
        elif (info.name, info.robot, info.cameras) != (self.info.name, self.info.robot, self.info.cameras):
            self._notes.warning(
                f"{self._source.name}: came back with another header ({info.name}); the first one stays"
            )

    def _lose(self, lost: Disconnected) -> None:
        if lost.why != self._why:
            then = "waiting for it" if self._source.is_file and not lost.hung_up else "trying again"
            self._say(f"{self._source.name}: {lost.why}; {then}")
        self._why = lost.why
        self._hung_up = lost.why if lost.hung_up else self._hung_up
        if self._away_since_s is None:
            self._away_since_s = time.monotonic()

    def _mind_the_gap(self, t_s: float) -> Iterator[Received]:
        if self._away_since_s is None:
            return
        away_s, self._away_since_s, self._why = time.monotonic() - self._away_since_s, None, ""
        self._anew, self._clock.set_back_s = False, 0.0  # which the gap explains
        if self.counts.records:
            self.counts.gaps += 1
            text = f"{GAP}: the source was away for {away_s:.1f} s"
            self._say(f"{self._source.name}: back after {away_s:.1f} s")
            yield Received(Note(t_s, text), _line({"t": t_s, "event": text}))

    def _mind_the_clock(self, t_s: float) -> Iterator[Received]:
        """Yield the event of a clock that was set back, or of a session that began anew, at this record."""
        back_s, anew, self._anew = self._clock.set_back_s, self._anew, False
        if not (back_s or anew):
            return
        self._odometry = None
        what = f"set back by {back_s:.1f} s" if back_s else "begun anew"
        text = f"{CLOCK}: {what}; odometry across it is not known"
        self._say(f"{self._source.name}: its clock was {what}; goes on from there")
        yield Received(Note(t_s, text), _line({"t": t_s, "event": text}))

    def _as_recorded(self, record: Record, line: LogLine, t_s: float) -> Received:
        if isinstance(record, OdometryPose):  # a stream has no time to look for the poses around a picture
            before, self._odometry = self._odometry, record.pose
            motion = motion_between(record.pose if before is None else before, record.pose)
            record = Motion(record.t_s, motion)
            fields = parse_object(line)
            fields = fields | {"t": t_s, "odometry": motion.tolist(), "pose": fields.pop("odometry_pose")}
            return Received(replace(record, t_s=t_s), _line(fields))
        by_path = isinstance(record, Picture) and record.path is not None
        if not by_path and not self._clock.shift_s:
            return Received(record, line.data + b"\n")
        fields, record = parse_object(line) | {"t": t_s}, replace(record, t_s=t_s)
        if by_path and isinstance(record, Picture):
            data = self._encoded(record)
            fields["image"] = {"base64": base64.b64encode(data).decode("ascii")}
            record = replace(record, read=partial(decode_picture, data))
        return Received(record, _line(fields))

    def _encoded(self, picture: Picture) -> bytes:
        if self._source.folder is None or picture.encoded is None:
            raise FieldError(f"found a picture by its path {picture.path!r}, expected it inline as base64")
        try:
            return picture.encoded()
        except PictureError as problem:
            raise FieldError(f"{picture.path}: {problem}") from None

    def _broken(self, line: LogLine, problem: FieldError) -> None:
        if not line.ended and not line.too_long:
            self._notes.warning(f"{self._source.name}: the last line was cut off and was left out")
            return
        error = SourceError(self._source.name, str(problem), line.number)
        if self._header_next and self.info is None:
            raise error
        self._count(error)
        if self._source.peer and (self._header_next or self._broken_running >= MOST_BROKEN):
            self._listening.hang_up(f"did not send a session log ({problem}); hung up")

    def _count(self, error: SourceError) -> None:
        self.counts.broken += 1
        self._broken_running += 1
        self._notes.problem(error)


def _is_header(line: LogLine) -> bool:
    """Return whether a line in the middle is a header: a writer has restarted in the same file."""
    if b'"format"' not in line.data[:200] or not line.data.lstrip().startswith(b"{"):
        return False
    return "format" in parse_object(line)


def _line(value: dict[str, Any]) -> bytes:
    return (json.dumps(value, allow_nan=False) + "\n").encode()  # ASCII: a note may hold half a character
