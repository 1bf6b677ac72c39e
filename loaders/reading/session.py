"""A recording of any format as a session: pictures or scans, aligned in time with odometry and truth."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.library.drive_score import DrivePicture
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import compose, inverse, motion_between
from maurice_mcl.values.session import NO_PICTURE, Camera, Frame, Moment, SessionInfo, is_kidnapping

from ..errors import HasReadingNotes, InputError, PictureError, ReadingNotes
from .observations import SCANS, SKIPPED_AT, Gate, Observations, Observed, gate_of, observed_in, with_skipped
from .options import Reading
from .recording import (
    PLACEHOLDER,
    Motion,
    Note,
    OdometryPose,
    Picture,
    Record,
    Recording,
    Scan,
    TruthPose,
    checked,
)
from .time_alignment import Aligned, Aligner, Steps, TimeSpan, apart, as_rows
from .transforms import Placeholders

if TYPE_CHECKING:
    from maurice_mcl.fitting.odometry import MotionSegment

MOST_KEPT = 5000  # moments without pictures: some kilobytes each
WIDEST_RAD = float(np.radians(170))
NAME_ODOMETRY = "name a bag's topic with --reading odometry_topic=..."
GIVE_ODOMETRY = (
    f"{NAME_ODOMETRY}, or beside a folder or video a table of the wheels' or another program's path "
    "(odometry_x, odometry_y, odometry_heading_rad) with --reading table=..."
)


@dataclass(slots=True, eq=False)
class _Update:
    aligned: Aligned
    time_s: float
    motions: list[F64]
    truth: F64 | None
    odometry: F64 | None


class RecordedSession(HasReadingNotes):
    """A recording as a `maurice_mcl.values.session.Session`; nothing is read before it is asked for.

    A moment is a picture, or a scan of the laser where there is no picture (`observed`). Odometry poses
    become one motion a moment; motions measured as such stay apart. What has no odometry within `max_dt_s` is
    left out. Raises InputError for what is broken, unless `keep_going`.
    """

    def __init__(self, recording: Recording, options: Reading | None = None) -> None:
        self.recording = recording
        self.options = options or Reading()
        self._notes = ReadingNotes(self.options.keep_going)
        self._kept: tuple[ReadingNotes, list[Moment]] | None = None

    @property
    def path(self) -> Path:
        """The file or folder."""
        return self.recording.path

    @property
    def info(self) -> SessionInfo:
        """What is known before the first picture, with the field of view that the options state."""
        return with_stated_view(self.path, self.recording.info, self.options)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What there is to say about reading it: the notes that its file does not hold."""
        stated = getattr(self.recording, "stated", ())
        return tuple(text for text in self.info.notes if text not in stated)

    @property
    def opening_remarks(self) -> tuple[str, ...]:
        """What to say when it is opened: the remarks, and what is not read."""
        not_read = str(getattr(self.recording, "not_read", ""))
        return (*self.remarks, *([not_read] if not_read else []))

    def moments(self) -> Iterator[Moment]:
        """Read the drive from its beginning, a used picture or scan at a time."""
        if self._kept is not None:
            self._notes, moments = self._kept
            yield from moments
            return
        notes = self._notes = ReadingNotes(self.options.keep_going)
        updates = _Updates(self, notes)
        step = 0
        for update in updates:
            picture = update.aligned.picture
            try:
                image = picture.read()
            except PictureError as problem:
                notes.problem(InputError(self.path, f"{picture.name}: {problem}", picture.line))
                continue
            updates.used(update)
            step += 1
            yield updates.moment(update, step, image)

    def overview(self, watch: Callable[[Record], None] | None = None) -> tuple[int, bool]:
        """Count the moments, and tell whether any truth is there; decodes no picture.

        `watch` is given every record that passes. A short drive without pictures is kept, so that it is
        read once.
        """
        notes, moments, count = ReadingNotes(self.options.keep_going), list[Moment](), 0
        most, updates = 0 if self.observed.pictures else MOST_KEPT, _Updates(self, notes, watch)
        for count, update in enumerate(updates, start=1):
            updates.used(update)
            if count <= most:
                moments.append(updates.moment(update, count, NO_PICTURE))
        self._kept = (notes, moments) if count <= most else None
        return count, updates.truths > 0

    def glances(self, notes: ReadingNotes, watch: Callable[[Record], None] | None = None) -> Iterator[Moment]:
        """Yield every moment without its picture; decodes none. `watch` is given every record."""
        updates = _Updates(self, notes, watch)
        for step, update in enumerate(updates, start=1):
            updates.used(update)
            yield updates.moment(update, step, NO_PICTURE)

    def known_pictures(self, most: int) -> list[DrivePicture]:
        """Return those of the first `most` updates whose true pose is known; decodes none, raises nothing."""
        if not self.observed.pictures:
            return []
        updates, pictures = _Updates(self, ReadingNotes(keep_going=True)), list[DrivePicture]()
        motions = list[F64]()
        for step, update in enumerate(islice(updates, most), start=1):
            updates.used(update)
            motions.append(updates.moment(update, step, NO_PICTURE).frame.motions)
            if update.truth is not None:
                since = np.concatenate(motions)
                pictures.append(DrivePicture(_reader(update.aligned.picture), update.truth, since))
                motions = []
        return pictures

    def count_pictures(self) -> int:
        """Count all pictures, used or not, without decoding any."""
        records = checked(self.recording, ReadingNotes(self.options.keep_going))
        return sum(isinstance(record, Picture) for record in records)

    @cached_property
    def observed(self) -> Observed:
        """What makes the moments: pictures, or scans where there are none; stops as soon as that is clear."""
        return observed_in(self.recording)

    @cached_property
    def skipped(self) -> tuple[float, ...]:
        """The times of what a live run left out, in order, as its capture tells."""
        if not self.info.captured:
            return ()
        records = checked(self.recording, ReadingNotes(keep_going=True))
        matches = (SKIPPED_AT.fullmatch(record.text) for record in records if isinstance(record, Note))
        return tuple(float(match[1]) for match in matches if match)

    @property
    def gate(self) -> Gate:
        """How far the robot goes before a picture or scan is used."""
        if self.odometry is None:  # nothing would be far enough
            return Gate()
        return gate_of(self.options, scans=self.observed.name == SCANS)

    @cached_property
    def odometry(self) -> type[OdometryPose] | type[Motion] | None:
        """Return how odometry comes, if at all; stops at its first record."""
        for record in checked(self.recording, ReadingNotes(keep_going=True)):
            if isinstance(record, OdometryPose | Motion):
                return type(record)
        return None


def _reader(picture: Picture) -> Callable[[], U8 | None]:
    """Return what decodes a picture, or returns None for one that cannot be read."""

    def read() -> U8 | None:
        try:
            return picture.read()
        except PictureError:
            return None

    return read


def with_stated_view(path: Path, info: SessionInfo, options: Reading) -> SessionInfo:
    """Return a header whose camera, the one that is read, has the field of view of the options, if any."""
    view_rad = options.camera_fov_rad
    if not view_rad:
        return info
    if not 0 < view_rad <= WIDEST_RAD:
        fault = f"found a camera's field of view of {np.degrees(view_rad):g} degrees"
        raise InputError(path, f"{fault}, expected 1 to 170; see --reading camera_fov_deg=60")
    cameras = list(info.cameras or (Camera(options.camera or "camera"),))
    names = [camera.name for camera in cameras]
    at = names.index(options.camera) if options.camera in names else 0
    cameras[at] = replace(cameras[at], horizontal_fov_rad=view_rad)
    return replace(info, cameras=tuple(cameras))


class _Updates:
    def __init__(
        self, session: RecordedSession, notes: ReadingNotes, watch: Callable[[Record], None] | None = None
    ) -> None:
        self.truths = 0  # seen so far
        self._watch = watch
        self._session = session
        self._notes = notes
        self._gate = session.gate
        self._steps = Steps()
        self._events: list[str] = []
        self._readings: dict[str, float] = {}
        self._begin_s: float | None = None
        self._observed, self._odometry = TimeSpan(), TimeSpan()
        self._used = False
        self._live = session.info.captured  # cut into moments as they came
        self._to_skip, self._skipped, self._skipped_motions = deque(session.skipped), 0, list[F64]()
        self._unpaired = 0
        self._what = session.observed.name  # or moments of a recording without any

    def __iter__(self) -> Iterator[_Update]:
        in_poses = self._session.odometry is OdometryPose
        aligner = Aligner(self._session.options.max_dt_s if in_poses else None)
        seen = self._session.observed
        pictures = bool(self._session.info.cameras) if self._live else seen.pictures
        wait = seen.scans and not self._live
        observations = Observations(
            self._session.options.max_dt_s, pictures=pictures, wait=wait, poses=in_poses
        )
        for aligned in observations(aligner(self._seen())):
            self._events += aligned.events
            self._readings |= aligned.readings
            pose = aligned.odometry_at(self._session.options.max_dt_s)
            motions = self._steps.add(aligned.motions, pose, aligner.first_odometry)
            if pose is None and in_poses:
                self._unpaired += 1
                continue
            gate = gate_of(self._session.options, scans=not observations.pictures)
            gate = gate if self._live else self._gate
            if not self._used or gate.open_after(self._steps.way):
                motions = [*self._skipped_motions, *motions]
                if self._to_skip and aligned.picture.t_s == self._to_skip[0]:
                    self._skip(motions, pose)
                    continue
                begin_s = aligned.picture.t_s if self._begin_s is None else self._begin_s
                time_s = aligned.picture.t_s - begin_s
                yield _Update(aligned, time_s, motions, aligned.truth_at(), pose)
        self._tell()

    def _skip(self, motions: list[F64], pose: F64 | None) -> None:
        """Leave out what the live run left out; its motions go to the next."""
        self._to_skip.popleft()
        self._steps.used(pose)
        self._used, self._skipped, self._skipped_motions = True, self._skipped + 1, motions

    def used(self, update: _Update) -> None:
        self._steps.used(update.odometry)
        self._used, self._skipped_motions = True, []

    def moment(self, update: _Update, step: int, image: U8) -> Moment:
        events = with_skipped(self._events, self._skipped, self._what)
        readings, aligned = self._readings, update.aligned
        self._events, self._readings, self._skipped = [], {}, 0
        motions, name = as_rows(update.motions), aligned.picture.name
        frame = Frame(step, update.time_s, motions, image, name, readings, aligned.scan)
        return Moment(frame, update.truth, events)

    def _seen(self) -> Iterator[Record]:
        for record in checked(self._session.recording, self._notes):
            self._begin_s = record.t_s if self._begin_s is None else self._begin_s
            if self._watch is not None:
                self._watch(record)
            if self._live and isinstance(record, Note) and SKIPPED_AT.fullmatch(record.text):
                continue
            self.truths += isinstance(record, TruthPose)
            if isinstance(record, Picture):
                self._what = "moments" if record.name == PLACEHOLDER else "pictures"
                self._observed.add(record.t_s)
            elif isinstance(record, Scan) and self._what == SCANS:
                self._observed.add(record.t_s)
            elif isinstance(record, OdometryPose):
                self._odometry.add(record.t_s)
            yield record

    def _tell(self) -> None:
        observed, odometry = self._observed, self._odometry
        if observed.count and self._session.odometry is None:
            advice = GIVE_ODOMETRY if self._what == "pictures" else NAME_ODOMETRY
            if self.truths:
                advice = "--reading odometry_from_truth=true makes some from the truth, for trying things out"
            only = f"the filter only has the {self._what} to go by"
            if self._what == "moments":
                only = "only the true poses are there"
            self._notes.warning(f"found no odometry: {only}; {advice}")
        if not self._unpaired:
            return
        within = f"within {self._session.options.max_dt_s:g} s"
        if self._unpaired == observed.count:
            where = apart(self._what, observed, "odometry", odometry)
            fault = f"found no {self._what.removesuffix('s')} with odometry {within}: {where}"
            text = f"{fault}; see --reading odometry_offset_s=... and max_dt_s=..."
            raise InputError(self._session.path, text)
        share = f"{self._unpaired} of {observed.count} {self._what}"
        self._notes.warning(
            f"{share} have no odometry {within} and were left out; see --reading max_dt_s=..."
        )


def begin_of(session: RecordedSession) -> float:
    """Return the time in seconds of the first record; 0 where there is none. InputError as reading."""
    record = next(checked(session.recording, ReadingNotes(keep_going=True)), None)
    return 0.0 if record is None else record.t_s


def first_truth(recording: Recording) -> F64 | None:
    """Return the first true pose (3,), less what odometry saw before it; None without truth."""
    moved, first = np.zeros(3), None
    for record in checked(recording, ReadingNotes(keep_going=True)):
        if isinstance(record, TruthPose):
            return compose(record.pose, inverse(moved))
        if isinstance(record, Motion):
            moved = compose(moved, record.motion)
        elif isinstance(record, OdometryPose):
            first = record.pose if first is None else first
            moved = motion_between(first, record.pose)
    return None


def drive_segments(session: RecordedSession) -> Iterator[MotionSegment]:
    """Yield the movements between true poses of a recording of any format; none across a kidnapping.

    Odometry poses become a movement a moment, as the filter gets them, or one for every 0.25 m or 15 degrees
    where there are neither pictures nor scans; measured motions need none.
    """
    from maurice_mcl.fitting.odometry import MotionSegment  # loads scipy, which reading does without

    before: F64 | None = None
    motions: list[F64] = []
    for moved, truth, events in _between_truths(session):
        motions.extend(moved)
        if any(map(is_kidnapping, events)):
            before, motions = None, []
        if truth is None:
            continue
        if before is not None and motions:
            yield MotionSegment(before, tuple(motions), truth)
        if before is None or motions:
            before, motions = truth, []


def _between_truths(session: RecordedSession) -> Iterator[tuple[Iterable[F64], F64 | None, tuple[str, ...]]]:
    notes = ReadingNotes(session.options.keep_going)
    if session.odometry is not Motion:
        if not (session.observed.pictures or session.observed.scans):
            session = RecordedSession(Placeholders(session.recording), session.options)
        yield from ((each.frame.motions, each.truth, each.events) for each in session.glances(notes))
        return
    for record in checked(session.recording, notes):
        if isinstance(record, Motion):
            yield (record.motion,), None, ()
        elif isinstance(record, TruthPose):
            yield (), record.pose, ()
        elif isinstance(record, Note):
            yield (), None, (record.text,)
