"""A live source as a session: one thread listens and records, moments are taken from it as they come."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from threading import Condition, Event, Thread
from types import TracebackType
from typing import BinaryIO, Self

import numpy as np

from maurice_mcl.values import Frame, Moment, SessionInfo, compose_motions

from ..errors import HasReadingNotes, InputError, PictureError, ReadingNotes, SourceError
from ..files.writing import expect_absent
from ..reading.observations import SCAN_GATE, SCANS, Gate, Observations, skipped_at, with_skipped
from ..reading.options import MAX_DT_S
from ..reading.recording import PLACEHOLDER, Picture, Record
from ..reading.time_alignment import Aligned, Aligner, as_rows
from ..session_log.header import FORMAT, SESSION_LOG, header_to_json
from ..session_log.reader import CameraChoice, picture_name
from ..session_log.records import ascii_line
from .intake import Counts, Intake
from .source import Listening, LiveSource, Patience

# Pictures that wait for the filter: those that it cannot keep up with are left out and counted.

ROOM = 4  # pictures that wait: the most updates that the view lags behind
MOST = 1000  # motions and events per picture; more motions are joined two by two, more events dropped


class Backlog:
    """A queue of pictures to the filter. When full, `keep_up` leaves the oldest out; else `put` waits."""

    def __init__(self, *, keep_up: bool, room: int = ROOM) -> None:
        self.skipped = 0
        self._keep_up, self._room = keep_up, room
        self._waiting: deque[Aligned] = deque()
        self._changed = Condition()
        self._over = False

    def put(self, aligned: Aligned, stop: Event) -> Aligned | None:
        """Add a picture; without `keep_up` wait for room or for `stop`. Return the one left out, if any."""
        left_out = None
        with self._changed:
            while len(self._waiting) >= self._room and not self._keep_up and not stop.is_set():
                self._changed.wait(LOOK_S)
            self._waiting.append(aligned)
            if len(self._waiting) > self._room:
                left_out = self._waiting.popleft()
                left_out.skipped += 1
                self._waiting[0].follow(left_out, MOST)
                self.skipped += 1
            self._changed.notify_all()
        return left_out

    def close(self) -> None:
        """Note that no more will come; what waits is still delivered."""
        with self._changed:
            self._over = True
            self._changed.notify_all()

    def __iter__(self) -> Iterator[Aligned]:
        while True:
            with self._changed:
                while not self._waiting and not self._over:
                    self._changed.wait(LOOK_S)
                if not self._waiting:
                    return
                aligned = self._waiting.popleft()
                self._changed.notify_all()
            yield aligned


# The recording: one session log, written line by line, complete whenever it stops.


class LiveRecorder:
    """Writes `session.log` into a folder, pictures inline; every line is passed to the system at once."""

    def __init__(self, folder: Path, *, force: bool = False) -> None:
        """Claim the folder. InputError if it holds a session already, or cannot be written to."""
        self.path = folder / SESSION_LOG
        self.is_begun = False
        self._file: BinaryIO | None = None
        self._is_new = not folder.exists()
        if folder.exists() and not folder.is_dir():
            raise InputError(folder, "found a file, expected a folder to record to; choose another name")
        expect_absent(self.path, force=force, form=FORMAT)
        with self._recording():
            folder.mkdir(parents=True, exist_ok=True)

    def begin(self, info: SessionInfo) -> None:
        """Write the header. InputError if that fails."""
        self.is_begun = True
        header = json.dumps(header_to_json(info, "session", self.path.parent), ensure_ascii=False)
        with self._recording():
            self._file = self.path.open("wb", buffering=0)
        self.add(header.encode() + b"\n")

    def add(self, line: bytes) -> None:
        """Write a line with its end. InputError when the disk is full or gone."""
        with self._recording():
            rest = memoryview(line)
            while self._file is not None and rest:
                rest = rest[self._file.write(rest) :]

    def close(self) -> None:
        """Close the file and remove a folder made for it that is empty. Closing twice does no harm."""
        if self._file is not None:
            self._file.close()
        elif self._is_new:
            with suppress(OSError):
                self.path.parent.rmdir()

    @contextmanager
    def _recording(self) -> Iterator[None]:
        try:
            yield
        except OSError as problem:
            raise InputError(self.path, f"cannot be recorded to: {problem.strerror or problem}") from None


LATE_S = 10.0  # of session time: by then a robot may have moved from its header's start pose
CALENDAR_S = 1e8  # times from here on count from 1970, and do not show when the drive began
QUIET = 4  # polls without a line (a second) after which truth is not awaited
LOOK_S = 0.2
CLOSE_S = 5.0


@dataclass(frozen=True, slots=True)
class ListenOptions:
    """Options of listening to a source."""

    keep_up: bool | None = None  # leave pictures out when the filter is slower; None: by the kind of source
    patience: Patience = field(default_factory=Patience)
    camera: str | None = None
    gate: Gate | None = None  # decides what makes an update; None: every picture, and scans as AMCL's
    only_record: bool = False  # no moments are taken
    library: Path | None = None  # named in the recorded header instead of the source's own survey
    start_holds: bool = False  # the header's start pose is meant, however late the source was joined


class LiveSession(HasReadingNotes):
    """A drive in progress, as a `maurice_mcl.values.session.Session` to iterate once, and a context manager.

    A recorder gets everything that is valid. InputError for no session log, or when recording fails.
    """

    def __init__(
        self,
        source: LiveSource,
        listen: ListenOptions | None = None,
        recorder: LiveRecorder | None = None,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.source, self._listen = source, listen or ListenOptions()
        self.keep_up = not source.waits if self._listen.keep_up is None else self._listen.keep_up
        self._notes = ReadingNotes(keep_going=True)
        self._stop, self._greeted = Event(), Event()
        self._listening = Listening(source, self._stop, self._listen.patience)
        self._intake = Intake(source, self._listening, self._notes, say)
        self._observations = Observations(MAX_DT_S, pictures=False, wait=False, poses=False)
        self._backlog = Backlog(keep_up=self.keep_up)
        self._recorder = recorder
        self._info: SessionInfo | None = None
        self._begin_s: float | None = None
        self._recorded_s = 0.0  # time of the last line of the recording
        self._first = True  # the first picture always makes an update
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, name="listening", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop listening, and wait until the recording is complete; closing twice does no harm."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)
        if self._recorder is not None and not self._thread.is_alive():
            self._recorder.close()  # where it was stopped before it began to listen

    @property
    def path(self) -> Path:
        """The recorded file; without one the source's name."""
        return Path(self.source.name) if self._recorder is None else self._recorder.path

    @property
    def info(self) -> SessionInfo:
        """The header; waits for it. InputError when none comes."""
        while not self._greeted.wait(LOOK_S):
            pass
        if self._info is None:
            raise self._error or SourceError(self.source.name, "stopped before its header came")
        return self._info

    @property
    def info_if_any(self) -> SessionInfo | None:
        """The header, if it came already."""
        return self._info

    @property
    def begun_s(self) -> float:
        """The time of the first record by the source's own clock; 0 before it comes."""
        return self._begin_s or 0.0

    @property
    def joined_late(self) -> bool:
        """Whether the robot may have left its header's start pose; known once its first record came."""
        is_told = self.source.peer and self._info is not None and self._info.start is not None
        return is_told and not self._listen.start_holds and LATE_S < self.begun_s < CALENDAR_S

    @property
    def counts(self) -> Counts:
        """Counts of what came so far."""
        return self._intake.counts

    @property
    def skipped(self) -> int:
        """The number of pictures left out because the filter could not keep up."""
        return self._backlog.skipped

    @property
    def ended(self) -> str:
        """Why listening ended by itself; "" while it goes on, and when it was stopped."""
        return self._listening.ended

    def moments(self) -> Iterator[Moment]:
        """Yield updates as they come, once; motions and events of those left out go to the next one."""
        step, earlier = 0, None
        for aligned in self._backlog:
            if earlier is not None:
                aligned.follow(earlier, MOST)
            picture = aligned.picture
            try:
                image = picture.read()
            except PictureError as problem:
                self._notes.problem(SourceError(self.source.name, f"{picture.name}: {problem}"))
                earlier = aligned
                continue
            step, earlier = step + 1, None
            time_s = picture.t_s - (self._begin_s or 0.0)
            motions, readings = as_rows(aligned.motions), aligned.readings
            frame = Frame(step, time_s, motions, image, picture.name, readings, aligned.scan)
            name = SCANS if aligned.scan is not None and picture.name == PLACEHOLDER else "pictures"
            yield Moment(frame, aligned.truth_at(), with_skipped(aligned.events, aligned.skipped, name))
        if self._error is not None:
            raise self._error

    def listen(self, seen: Callable[[Counts], None] = lambda counts: None) -> None:
        """Only listen and record, until the source ends or patience does."""
        while self._thread.is_alive():
            self._thread.join(LOOK_S)
            seen(self.counts)
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        """Listen, in a separate thread; errors are raised where moments are taken."""
        try:
            self._take_in()
        except Exception as problem:  # of a thread: raised again by the one that reads
            self._error = problem
        finally:
            self._end_recording()
            self._greeted.set()
            self._backlog.close()

    def _end_recording(self) -> None:
        """Close the recording, which has a header also where no record came."""
        if self._recorder is None:
            return
        try:
            self._begin_recording()
        except InputError as problem:
            self._error = self._error or problem
        self._recorder.close()

    def _take_in(self) -> None:
        leftover: Aligned | None = None  # the last picture that makes no update, with all before it
        for aligned in self._observations(Aligner(most=MOST, prompt=True)(self._records()), MOST):
            if leftover is not None:
                aligned.follow(leftover, MOST)
            leftover = aligned
            if self._makes_an_update(aligned):
                left_out = self._backlog.put(aligned, self._stop)
                self._listening.heard()  # the source was not silent while we waited for room
                if left_out is not None and self._recorder is not None:
                    event = skipped_at(left_out.picture.t_s)
                    self._recorder.add(ascii_line({"t": self._recorded_s, "event": event}))
                leftover = None

    def _makes_an_update(self, aligned: Aligned) -> bool:
        if self._listen.only_record:
            return False
        movement = reduce(compose_motions, aligned.motions, np.zeros(3))
        gate = self._listen.gate or (Gate() if self._observations.pictures else SCAN_GATE)
        if not (self._first or gate.open_after(movement)):
            return False
        self._first = False
        return True

    def _records(self) -> Iterator[Record | None]:
        """Yield what belongs to the drive; None while nothing comes, so that truth is no longer awaited."""
        choice: CameraChoice | None = None
        quiet = number = 0
        for received in self._intake:
            if self._info is None and self._intake.info is not None:
                self._greet(self._intake.info)
            quiet = quiet + 1 if received is None else 0
            if received is None:
                if quiet >= QUIET or self._intake.away:
                    yield None
                continue
            record = received.record
            self._begin_s = record.t_s if self._begin_s is None else self._begin_s
            if self._recorder is not None:
                self._begin_recording()
                self._recorder.add(received.line)
                self._recorded_s = record.t_s
            if not isinstance(record, Picture):
                yield record
            elif not record.covered:
                choice = choice or self._camera()
                if choice(record):
                    number += 1
                    yield replace(record, name=self._name(record, number))

    def _greet(self, info: SessionInfo) -> None:
        if self._listen.library is not None:
            info = replace(info, survey=self._listen.library.resolve())
        self._info = info
        self._observations.pictures = bool(info.cameras)  # else scans make the moments until a picture comes
        self._greeted.set()

    def _begin_recording(self) -> None:
        """Write the header, once it is known whether the start pose in it holds."""
        if self._recorder is None or self._info is None or self._recorder.is_begun:
            return
        info = replace(self._info, captured=True)
        if self.joined_late:
            note = f"captured from {self.begun_s:.0f} s into the drive on: where it began is not told"
            info = replace(info, start=None, notes=(*info.notes, note))
        self._recorder.begin(info)

    def _name(self, picture: Picture, number: int) -> str:
        """Name a picture as who reads the recording does."""
        if self._recorder is not None:
            return picture_name(self._recorder.path, number)
        return picture.path or f"line {picture.line} of {self.source.name}"

    def _camera(self) -> CameraChoice:
        known = [camera.name for camera in self.info.cameras]
        name = self._listen.camera
        if name is not None and known and name not in known:
            fault = f"found cameras {', '.join(known)}, expected {name!r} among them"
            raise SourceError(self.source.name, fault)
        return CameraChoice(name or (known[0] if known else None), self._notes)
