"""Poses in text files, and folders whose files are merged by time."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np

from maurice_mcl.values import F64, U8, SessionInfo

from ..errors import InputError, ReadingNotes
from ..files.pictures import decode_picture, picture_in
from ..files.text import MOST_T_S, show, time_falls, up_to
from ..reading.options import Reading
from ..reading.plane import OutOfPlane, Plane, Pose, forward_axis, planar, plane_of, rotation
from ..reading.recording import Note, OdometryPose, Picture, Record, TruthPose
from ..reading.time_alignment import PER_SECOND, TimeSpan, apart, detect_unit, offset_between, seconds
from ._tables import Row, is_number, names_columns, number_of, rows, words_of
from .cmucam import BEGIN, decode_frame

# Text files of stamped poses in space: position and quaternion, in any order of columns.

COMMENTS = ("#", "%")
MOST = 50_000  # poses that are held to compare two clocks
LOOKED_AT = 200  # rows from which unit and forward axis are detected


@dataclass(frozen=True, slots=True)
class Layout:
    """Where what stands in a row; the time comes first."""

    position: tuple[int, int, int] = (1, 2, 3)
    quaternion: tuple[int, int, int, int] = (7, 4, 5, 6)  # of w, x, y, z


@dataclass(frozen=True, eq=False)
class _TimedFile:
    """A text file with a time in every row; nothing is read before it is asked for."""

    file: Path
    comments: ClassVar[tuple[str, ...]] = ("#",)

    def _records(self, notes: ReadingNotes) -> Iterator[OdometryPose | TruthPose | Picture | Note]:
        raise NotImplementedError

    def _words(self, row: Row) -> list[str]:
        raise NotImplementedError

    @cached_property
    def span(self) -> TimeSpan:
        """First and last time of the rows that can be read; reads the file once to its end."""
        span = TimeSpan()
        for record in self._records(ReadingNotes(keep_going=True)):
            span.add(record.t_s)
        return span

    def _detected(self) -> str:
        words = [word for row in islice(self._rows(), LOOKED_AT) for word in self._words(row)[:1]]
        return detect_unit([word for word in words if is_number(word)] or ["0"])

    def _rows(self) -> Iterator[Row]:
        for number, row in enumerate(rows(self.file)):
            if not row.text.startswith(self.comments) and (number or not names_columns(row.text)):
                yield row

    def _expect_rising(self, t_s: float, last_t_s: float, row: Row) -> None:
        if t_s < last_t_s:
            raise InputError(self.file, time_falls(t_s, last_t_s), row.number)


@dataclass(frozen=True, eq=False)
class PoseFile(_TimedFile):
    """A file of poses."""

    kind: type[OdometryPose] | type[TruthPose]
    layout: Layout = Layout()
    unit: str | None = None  # of the times; None: detected
    offset_s: float = 0.0  # added to the times
    wanted: str | None = None  # the plane; None: detected
    comments: ClassVar[tuple[str, ...]] = COMMENTS

    def poses(self, notes: ReadingNotes) -> Iterator[OdometryPose | TruthPose | Note]:
        """Yield the poses in the plane, in the file's order; broken rows and times that fall are problems.

        Notes say where a true pose begins to tilt out of the plane.
        """
        last_t_s, left = -np.inf, OutOfPlane(self._plane)
        if self._plane.remark:
            notes.warning(f"{self.file}: {self._plane.remark}")
        for row in self._rows():
            try:
                t_s = self._time(row)
                position, turned = self._pose(row)
                self._expect_rising(t_s, last_t_s, row)
            except InputError as problem:
                notes.problem(problem)
                continue
            last_t_s, note = t_s, left.add(position, turned)
            yield self.kind(t_s, planar(position, turned, self._axis))
            if note and self.kind is TruthPose:
                yield Note(t_s, note)
        if text := str(left):
            notes.left_plane(str(self.file), left.tilt_rad, left.height_m, text)

    _records = poses

    def track(self) -> tuple[F64, F64]:
        """Return the times (n,) and poses (n, 3) of the first 50,000 rows that can be read."""
        poses = self.poses(ReadingNotes(keep_going=True))
        track = list(islice((pose for pose in poses if not isinstance(pose, Note)), MOST))
        return np.array([pose.t_s for pose in track]), np.array([pose.pose for pose in track]).reshape(-1, 3)

    def check(self) -> None:
        """Read until a row holds a pose. Raises InputError, of the first row, if there is none."""
        first: InputError | None = None
        for row in islice(self._rows(), LOOKED_AT):
            try:
                self._in_space(row)
            except InputError as problem:
                first = first or problem
            else:
                return
        raise first or InputError(self.file, "found no poses, expected one a line")

    @cached_property
    def _unit(self) -> str:
        return self.unit or self._detected()

    @property
    def body(self) -> tuple[F64, F64]:
        """Which axes of the body (3,) look forward, as headings are measured, and up, of length 1."""
        forward = np.array([1.0, 0, 0] if self._axis == "x" else [0, 0, 1.0])
        up = np.mean([turned[2] for turned in self._turned] or [[0, 0, 1.0]], axis=0)
        return forward, up / max(float(np.linalg.norm(up)), 1e-9)

    @cached_property
    def _axis(self) -> str:
        return forward_axis(self._turned) if self._turned else "x"

    @cached_property
    def _turned(self) -> list[F64]:
        return [self._plane.place(*pose)[1] for pose in self._all(islice(self._rows(), LOOKED_AT))]

    @cached_property
    def _plane(self) -> Plane:
        return plane_of(self._all(self._rows()), self.wanted)

    def _all(self, rows: Iterable[Row]) -> Iterator[Pose]:
        for row in rows:
            with suppress(InputError):
                yield self._in_space(row)

    def _words(self, row: Row) -> list[str]:
        return words_of(row.text)

    def _time(self, row: Row) -> float:
        word, per_s = self._words(row)[0], PER_SECOND[self._unit]
        number_of(self.file, row, word, "time", MOST_T_S * per_s)
        t_s = seconds(word, self._unit) + self.offset_s
        if abs(t_s) > MOST_T_S:
            raise InputError(self.file, f"found time {show(word)}, expected {up_to(MOST_T_S)}", row.number)
        return t_s

    def _pose(self, row: Row) -> Pose:
        return self._plane.place(*self._in_space(row))

    def _in_space(self, row: Row) -> Pose:
        words = self._words(row)
        columns = (*self.layout.position, *self.layout.quaternion)
        if len(words) <= max(columns):
            fault = f"found {len(words)} values ({show(row.text)}), expected {max(columns) + 1} or more"
            fault += ": t x y z qx qy qz qw" if self.layout == Layout() else ""
            raise InputError(self.file, fault, row.number)
        values = np.array([number_of(self.file, row, words[at], "value") for at in columns])
        try:
            return values[:3], rotation(values[3:])
        except ValueError as problem:
            raise InputError(self.file, str(problem), row.number) from None


def pose_file(
    file: Path | None,
    kind: type[OdometryPose] | type[TruthPose],
    options: Reading,
    layout: Layout | None = None,
    unit: str | None = None,
) -> PoseFile | None:
    """Return a file of poses, or None. `unit` is that of the times, as the file's head has it."""
    if file is None or not file.is_file():
        return None
    offset_s = options.odometry_offset_s if kind is OdometryPose else options.truth_offset_s
    return PoseFile(file, kind, layout or Layout(), options.time_unit or unit, offset_s, options.plane)


def first_file(folder: Path, names: Sequence[str]) -> Path | None:
    """Return the first of some files that a folder has."""
    return next((folder / name for name in names if (folder / name).is_file()), None)


def layout_of(names: Sequence[str]) -> Layout | None:
    """Return the columns of position and quaternion by their names; None without them."""
    lower = [name.partition("[")[0].strip().lower() for name in names]
    position = [_ending(lower, axis) for axis in "xyz"]
    after = (position[2] or 0) + 1
    quaternion = [_ending(lower[after:], axis) for axis in "wxyz"]
    if None in position or None in quaternion:
        return None
    x, y, z = (at for at in position if at is not None)
    w, qx, qy, qz = (after + at for at in quaternion if at is not None)
    return Layout((x, y, z), (w, qx, qy, qz))


def _ending(columns: Sequence[str], axis: str) -> int | None:
    """Find the first column of an axis: `x`, `tx`, `p_RS_R_x`, `q_x`."""
    for at, name in enumerate(columns):
        if name == axis or name.endswith((f"_{axis}", f".{axis}", f"q{axis}", f"p{axis}", f"t{axis}")):
            return at
    return None


SLACK_S = 1.0  # spans that miss each other by less are of one clock


@dataclass(frozen=True, eq=False)
class TimedFolder:
    """Pictures, odometry and truth, each a file of its own with times; any of them may be missing."""

    path: Path
    info: SessionInfo
    pictures: PictureList | None
    odometry: PoseFile | None
    truth: PoseFile | None
    remarks: tuple[str, ...] = ()  # warnings of every reading

    def check(self) -> TimedFolder:
        """Read the first row of every file. Raises InputError if one is broken or all are missing."""
        if self.pictures is None and self.odometry is None and self.truth is None:
            raise InputError(self.path, "found neither pictures nor poses in it")
        for file in (self.odometry, self.truth):
            if file is not None:
                file.check()
        return self

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Merge all by time: poses before the pictures of the same time."""
        for text in self.remarks:
            notes.warning(text)
        streams: list[Iterator[Record]] = []
        if self.odometry is not None:
            streams.append(self.odometry.poses(notes))
        if self.truth is not None and self._one_clock(self.truth, notes):
            streams.append(self.truth.poses(notes))
        if self.pictures is not None:
            streams.append(self.pictures.pictures(notes))
        return heapq.merge(*streams, key=lambda record: record.t_s)

    def _one_clock(self, truth: PoseFile, notes: ReadingNotes) -> bool:
        main = self.pictures or self.odometry
        if main is None or not main.span.count or main.span.overlaps(truth.span, SLACK_S):
            return True
        name = "pictures" if self.pictures is not None else "odometry"
        where = apart(name, main.span, "truth", truth.span)
        advice = f"the clocks disagree, so truth is left out; {self._offset(truth, main.span)}"
        notes.warning(f"{truth.file}: {where}; {advice}")
        return False

    def _offset(self, truth: PoseFile, main: TimeSpan) -> str:
        odometry = self.odometry
        if odometry is not None and (odometry.span.overlaps(main, SLACK_S)):
            offset = offset_between(*odometry.track(), *truth.track())
            if offset is not None:
                alike = f"its movement is most like the odometry's (correlation {offset.correlation:.2f})"
                return f"{alike} with --reading truth_offset_s={offset.offset_s + truth.offset_s:.6f}"
        together = f"--reading truth_offset_s={main.first_s - truth.span.first_s + truth.offset_s:.6f}"
        no_help = "" if odometry is None else "movement does not tell how far; "
        return f"{no_help}if both begin together, use {together}"


@dataclass(frozen=True, eq=False)
class PictureList(_TimedFile):
    """A table of times and file names."""

    root: Path  # the folder that names start from
    column: int | None = None  # of the file names; None: all that follows the first column
    unit: str | None = None  # of the times, which stand in the column before; None: detected
    outside: bool = False  # whether names may lead out of that folder

    def pictures(self, notes: ReadingNotes) -> Iterator[Picture]:
        """Yield the pictures in file order, not opened; broken rows and falling times are problems."""
        last_t_s = -float("inf")
        for row in self._rows():
            try:
                picture = self._picture(row)
                self._expect_rising(picture.t_s, last_t_s, row)
            except InputError as problem:
                notes.problem(problem)
                continue
            last_t_s = picture.t_s
            yield picture

    _records = pictures

    @cached_property
    def _unit(self) -> str:
        return self.unit or self._detected()

    def _words(self, row: Row) -> list[str]:
        if self.column is None:
            return words_of(row.text, 1)
        return words_of(row.text)[self.column - 1 : self.column + 1]

    def _picture(self, row: Row) -> Picture:
        words = self._words(row)
        if len(words) < 2 or not words[1]:
            text = f"found {show(row.text)}, expected a time and a file name"
            raise InputError(self.file, text, row.number)
        number_of(self.file, row, words[0], "time", MOST_T_S * PER_SECOND[self._unit])
        name = words[1]
        read = partial(read_picture, self.root, name, self.outside)
        return Picture(seconds(words[0], self._unit), read, name)


def read_picture(folder: Path, name: str, outside: bool = False) -> U8:
    """Read a picture's file, or a CMUcam's frame. Raises PictureError if it is missing or damaged."""
    data = picture_in(folder, name, outside=outside)
    return decode_frame(data) if data.startswith(BEGIN) else decode_picture(data, deep=True)
