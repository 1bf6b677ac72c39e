"""A folder of pictures and a table of poses as a survey log and a session log.

The table is read as the format `table` is, and its poses become odometry as by `odometry_from_truth`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.map import open_arena
from maurice_mcl.values.radii import fitted_m
from maurice_mcl.values.session import Camera, SessionInfo

from .errors import InputError, PictureError, ReadingNotes
from .export.session import Converted, write_record
from .files.maps import check_span, read_map
from .files.pictures import encode_picture, picture_in
from .files.text import PICTURES, show
from .files.writing import FolderKind, new_folder
from .formats.picture_folder import TableRecording, open_table
from .reading.options import ReadingOptions
from .reading.recording import Picture, Record, Recording, TruthPose, checked
from .reading.transforms import MadeOdometry
from .session_log.header import FORMAT, SESSION_LOG
from .session_log.writer import SessionWriter

SURVEY_LOG = "survey.log"


@dataclass(frozen=True, slots=True, eq=False)
class PoseRow:
    """A picture of the table, with its pose."""

    number: int  # among the pictures, from 0
    picture: Picture  # not opened
    pose: F64  # (3,) x_m, y_m, heading_rad

    @property
    def key(self) -> tuple[float, str]:
        """Time and name of the picture."""
        return self.picture.t_s, self.picture.name


def read_rows(table: TableRecording) -> list[PoseRow]:
    """Return the pictures that have poses, in order. InputError where none has, and for a bad row."""
    rows, pose = list[PoseRow](), None
    for record in checked(table, ReadingNotes(keep_going=False)):
        if isinstance(record, TruthPose):
            pose = record
        elif isinstance(record, Picture) and pose is not None and pose.t_s == record.t_s:
            rows.append(PoseRow(len(rows), record, pose.pose))
    if not rows:
        names = ", ".join(table.head.names)
        fault = f"found columns {show(names)} and no picture with a pose"
        raise InputError(table.table, f"{fault}; say what they are, as in --reading columns=x=NAME")
    return rows


def pose_runs(rows: list[PoseRow]) -> list[list[PoseRow]]:
    """Group consecutive rows of equal pose."""
    runs: list[list[PoseRow]] = []
    for row in rows:
        if runs and np.array_equal(runs[-1][0].pose, row.pose):
            runs[-1].append(row)
        else:
            runs.append([row])
    return runs


# Dividing one pass of labelled pictures honestly into a library and a drive.

Run = Sequence[PoseRow]  # consecutive rows of equal pose


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """Which rows go where; rows keep the table's order."""

    session: tuple[PoseRow, ...]
    library: tuple[PoseRow, ...]
    session_runs: int
    guarded_runs: int  # left out of the library because of the guard

    def nearest_reference_m(self) -> F64:
        """Return the distance (S,) of every session picture to the nearest library pose."""
        return nearest_m(xy_of(self.session), xy_of(self.library))


def split_runs(
    runs: Sequence[Run], every: int, guard_m: float, session_pictures: int, library_pictures: int
) -> Split:
    """Return every so many-th run to the session, from the first, and the rest to the library.

    A library run within `guard_m` of a session pose is dropped: neighboring frames are nearly one picture.
    """
    session = [run for number, run in enumerate(runs) if number % every == 0]
    others = [run for number, run in enumerate(runs) if number % every != 0]
    driven = xy_of([run[0] for run in session])
    library = [run for run in others if nearest_m(xy_of(run[:1]), driven)[0] >= guard_m]
    return Split(
        session=tuple(row for run in session for row in spread(run, session_pictures)),
        library=tuple(row for run in library for row in spread(run, library_pictures)),
        session_runs=len(session),
        guarded_runs=len(others) - len(library),
    )


def spread(run: Run, most: int) -> list[PoseRow]:
    """Choose at most so many rows of a run, evenly spread: one is the middle one."""
    count = min(most, len(run))
    return [run[(2 * k + 1) * len(run) // (2 * count)] for k in range(count)]


def nearest_m(from_xy: F64, to_xy: F64) -> F64:
    """Return the distance (A,) of each point (A, 2) to the nearest of (B, 2); infinite when there is none."""
    distances = [float(np.hypot(*(to_xy - point).T).min(initial=np.inf)) for point in from_xy]
    return np.array(distances)


def xy_of(rows: Sequence[PoseRow]) -> F64:
    """Return the positions (K, 2) of rows."""
    return np.array([row.pose[:2] for row in rows], np.float64).reshape(-1, 2)


IMPORTED = FolderKind(
    "imported pictures", "session.log", FORMAT, r"(?:session|survey)\.log|pictures/\d{5,}\.\w+"
)
GUARD_M = 0.5  # in rooms: neighbors look alike
SESSION_PICTURES = 5  # at most so many of a run, evenly spread: standing still tells little
LIBRARY_PICTURES = 1  # of a run, the middle one: others are near copies


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What is read, and how it is split into library and session."""

    reading: ReadingOptions = field(default_factory=ReadingOptions)  # of the table
    name: str | None = None  # of the place; None: the name of the table's folder
    map_lines: Path | None = None  # wall segments x1 y1 x2 y2, or a ROS map.yaml; None: no map, all is free
    map_unit: str = "mm"  # of segments: "m" or "mm"
    session_every: int = 10  # each so many-th run of equal poses is the session's, from the first one
    camera_fov_rad: float | None = None  # the camera's horizontal field of view; landmarks want it
    guard_m: float | None = None  # no library picture this near to any session pose; None: by the place
    seed: int = 0  # of the noise of odometry made from the poses


@dataclass(frozen=True, slots=True)
class ImportSummary:
    """What came of an import."""

    session: Path  # the session log
    survey: Path  # the survey log
    rows: int  # of the table
    runs: int  # of equal poses
    session_runs: int  # of these, in the session
    session_pictures: int  # pictures in the session
    library_pictures: int  # pictures in the survey
    guarded_runs: int  # runs left out of the library because of the guard
    nearest_reference_median_m: float  # from a session picture to the nearest library pose
    nearest_reference_max_m: float  # the same, at worst
    notes: tuple[str, ...]  # as the session's header has them


def import_pictures(
    folder: Path | str,
    poses_csv: Path,
    out: Path,
    options: ImportOptions | None = None,
    *,
    force: bool = False,
) -> ImportSummary:
    """Split pictures with poses into a library and a drive; `out` appears completely or not.

    Rows are one pass in order, without a column of times a second apart. Where the table has no odometry, it
    is made from the poses plus noise. InputError for bad files, poses too far apart, a split that leaves
    nothing, or an `out` that exists; ValueError for senseless options.
    """
    options = options or ImportOptions()
    _check(options)
    table = open_table(_existing(folder), replace(options.reading, table=poses_csv))
    rows = read_rows(table)
    check_span(poses_csv, xy_of(rows))
    runs = pose_runs(rows)
    guard_m = fitted_m(GUARD_M, xy_of(rows)) if options.guard_m is None else options.guard_m
    options = replace(options, guard_m=guard_m)
    split = split_runs(runs, options.session_every, guard_m, SESSION_PICTURES, LIBRARY_PICTURES)
    if not split.library:
        advice = "lower the guard, or give fewer runs to the session"
        raise InputError(poses_csv, f"found no picture {guard_m:.3g} m off the session's; {advice}")
    info = _info(table, rows, options)
    drive: Recording = _Drive(table, info, split.session)
    if not table.has_odometry:
        drive = MadeOdometry(drive, options.seed)
    with new_folder(out, IMPORTED, force=force) as filling:
        (filling / "pictures").mkdir()
        with SessionWriter(filling / SURVEY_LOG, replace(info, notes=drive.info.notes), "survey") as log:
            for row in split.library:
                log.image_path(row.picture.t_s, _copied(table, row, filling), pose=row.pose)
        copies = {row.key: _copied(table, row, filling) for row in split.session}
        header = replace(drive.info, survey=Path(SURVEY_LOG), start=split.session[0].pose)
        _write_drive(filling / SESSION_LOG, header, drive, copies)
    nearest = split.nearest_reference_m()
    return ImportSummary(
        session=out / SESSION_LOG,
        survey=out / SURVEY_LOG,
        rows=len(rows),
        runs=len(runs),
        session_runs=split.session_runs,
        session_pictures=len(split.session),
        library_pictures=len(split.library),
        guarded_runs=split.guarded_runs,
        nearest_reference_median_m=float(np.median(nearest)),
        nearest_reference_max_m=float(nearest.max()),
        notes=drive.info.notes,
    )


def _check(options: ImportOptions) -> None:
    if options.session_every < 2 or (options.guard_m is not None and not options.guard_m >= 0):
        raise ValueError("expected session_every from 2, and a guard from 0 m")
    if options.camera_fov_rad is not None and not 0 < options.camera_fov_rad < math.pi:
        raise ValueError("expected a horizontal field of view between 0 and 180 degrees")


def _existing(folder: Path | str) -> Path:
    """Refuse what is no folder, "" too: as a Path it would be the working directory."""
    if not str(folder) or not Path(folder).exists():
        fault = f"found no such folder {show(str(folder))}"
        raise InputError(Path(folder), f"{fault}, expected the one that picture names start from")
    if not Path(folder).is_dir():
        raise InputError(Path(folder), "found a file, expected the folder that picture names start from")
    return Path(folder)


def _info(table: TableRecording, rows: Sequence[PoseRow], options: ImportOptions) -> SessionInfo:
    positions, lines = xy_of(rows), options.map_lines
    arena = read_map(lines, options.map_unit, positions) if lines else open_arena(positions)
    split_note = (
        f"one run of equal poses in {options.session_every} is the session, at most "
        f"{SESSION_PICTURES} pictures of each; the library has {LIBRARY_PICTURES} of each "
        f"other run that is at least {options.guard_m:.3g} m from every session pose"
    )
    untimed = () if table.has_times else ("times are synthetic: one second a row of the table",)
    view_rad = options.camera_fov_rad
    return SessionInfo(
        name=options.name or table.table.resolve().parent.name or "pictures",
        cameras=() if view_rad is None else (Camera("camera", horizontal_fov_rad=view_rad),),
        arena=arena,
        notes=(*untimed, split_note),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Drive:
    """A table from the session's first picture to its last, without the pictures of other runs."""

    table: TableRecording
    info: SessionInfo
    rows: Sequence[PoseRow]  # of the session

    @property
    def path(self) -> Path:
        """The folder of the pictures."""
        return self.table.path

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield poses and odometry of all rows, and the session's pictures."""
        pictures = {row.key for row in self.rows}
        first_s, last_s = self.rows[0].picture.t_s, self.rows[-1].picture.t_s
        for record in self.table.records(notes):
            its = not isinstance(record, Picture) or (record.t_s, record.name) in pictures
            if its and first_s <= record.t_s <= last_s:
                yield record


def _write_drive(log: Path, info: SessionInfo, drive: Recording, copies: Mapping[Any, str]) -> None:
    last, done = None, Converted()
    with SessionWriter(log, info) as writer:
        for record in checked(drive, ReadingNotes(keep_going=False)):
            if isinstance(record, Picture):
                writer.image_path(record.t_s, copies[record.t_s, record.name])
            else:
                last = write_record(writer, record, last, done)


def _copied(table: TableRecording, row: PoseRow, folder: Path) -> str:
    """Copy a picture into a folder, as PNG where it is no file; return its path there. InputError."""
    name, suffix = row.picture.name, Path(row.picture.name).suffix.lower()
    try:
        image = row.picture.read()
        if suffix in PICTURES:
            data = picture_in(table.root_of(name), name, outside=table.outside)
        else:
            data, suffix = encode_picture(image, "png"), ".png"
    except PictureError as problem:
        raise InputError(table.table, f"{name}: {problem}") from None
    relative = f"pictures/{row.number:05d}{suffix}"
    (folder / relative).write_bytes(data)
    return relative
