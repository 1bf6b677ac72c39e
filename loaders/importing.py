"""A folder of pictures and a table of poses as a survey log and a session log."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.map import open_arena
from maurice_mcl.radii import fitted_m
from maurice_mcl.session import Camera, SessionInfo

from .errors import InputError, PictureError
from .files import number_in, read_csv, show
from .maps import check_span, read_map
from .pictures import decode_picture, picture_file
from .session_log.header import FORMAT
from .session_log.writer import SessionWriter
from .transforms import OdometryNoise, synthetic_motions
from .writing import FolderKind, new_folder

# A CSV table of pictures and their poses, read strictly: every complaint names the row and the column.

UNITS = ("deg", "rad")
OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs"}  # as some programs write what they call CSV


@dataclass(frozen=True, slots=True)
class Columns:
    """Which columns of the table hold what."""

    image: str = "image"  # a path, relative to the folder of pictures or to the table
    x: str = "x_m"  # meters
    y: str = "y_m"  # meters
    heading: str = "heading_deg"  # counter-clockwise from +x; its unit by the name's ending ...
    heading_unit: str | None = None  # ... unless given here: "deg" or "rad"


@dataclass(frozen=True, slots=True, eq=False)
class PoseRow:
    """One row of the table."""

    number: int  # of the row among the data rows, from 0; a picture taken at that second
    line: int  # in the file, for messages
    image: str
    pose: F64  # (3,) x_m, y_m, heading_rad


def read_pose_table(file: Path, columns: Columns) -> list[PoseRow]:
    """Read all rows. Raises InputError naming the columns that were found, or the row and column at fault."""
    return read_csv(file, "a table of poses", "picture", lambda table: _rows(file, table, columns))


def pose_runs(rows: list[PoseRow]) -> list[list[PoseRow]]:
    """Group consecutive rows of equal pose."""
    runs: list[list[PoseRow]] = []
    for row in rows:
        if runs and np.array_equal(runs[-1][0].pose, row.pose):
            runs[-1].append(row)
        else:
            runs.append([row])
    return runs


def heading_unit(file: Path, columns: Columns) -> str:
    """Return the heading's unit from the option or the column's name."""
    unit = columns.heading_unit or columns.heading.rsplit("_", 1)[-1]
    if unit not in UNITS:
        advice = "say whether it is in deg or rad"
        text = f"found heading column {columns.heading!r} without a unit in its name; {advice}"
        raise InputError(file, text)
    return unit


def _rows(file: Path, table: csv.DictReader[str], columns: Columns) -> Iterator[PoseRow]:
    found = table.fieldnames or []
    wanted = (columns.image, columns.x, columns.y, columns.heading)
    missing = [name for name in wanted if name not in found]
    if missing:
        _expect_commas(file, found)
        names = ", ".join(found) or "none"
        text = f"found columns {names}, expected also {', '.join(missing)}; choose the columns"
        raise InputError(file, text, 1)
    to_rad = math.pi / 180 if heading_unit(file, columns) == "deg" else 1.0
    for number, row in enumerate(table):
        line = table.line_num
        image = row[columns.image]
        if not image:
            text = f"found no file name in column {columns.image!r}, expected a picture"
            raise InputError(file, text, line)
        x, y, heading = (number_in(file, line, name, row[name]) for name in wanted[1:])
        yield PoseRow(number, line, image, np.array([x, y, heading * to_rad]))


def _expect_commas(file: Path, found: Sequence[str]) -> None:
    for separator, name in OTHER_SEPARATORS.items():
        if len(found) == 1 and separator in found[0]:
            advice = "save the table with commas between columns"
            raise InputError(file, f"found columns separated by {name}, expected commas; {advice}", 1)


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
    apart = [float(np.hypot(*(to_xy - point).T).min(initial=np.inf)) for point in from_xy]
    return np.array(apart)


def xy_of(rows: Sequence[PoseRow]) -> F64:
    """Return the positions (K, 2) of rows."""
    return np.array([row.pose[:2] for row in rows], np.float64).reshape(-1, 2)


IMPORTED = FolderKind(
    "imported pictures", "session.log", FORMAT, r"(?:session|survey)\.log|pictures/\d{5,}\.\w+"
)
GUARD_M = 0.5  # in rooms: neighbors look alike


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What is read, and how it is split into library and session."""

    columns: Columns = field(default_factory=Columns)  # names and units of the table's columns
    name: str | None = None  # of the place; None: the name of the table's folder
    map_lines: Path | None = None  # wall segments x1 y1 x2 y2, or a ROS map.yaml; None: no map, all is free
    map_unit: str = "mm"  # of segments: "m" or "mm"
    session_every: int = 10  # each so many-th run of equal poses is the session's, from the first one
    session_pictures: int = 5  # at most so many of a run, evenly spread: standing still tells little
    library_pictures: int = 1  # at most so many of a run; 1 takes the middle one, others are near copies
    camera_fov_rad: float | None = None  # the camera's horizontal field of view; landmarks want it
    guard_m: float | None = None  # no library picture this near to any session pose; None: by the place
    noise: OdometryNoise = field(default_factory=OdometryNoise)  # of the synthetic odometry
    seed: int = 0  # of that noise


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

    Rows are one pass in order, a second apart; the odometry is made from the poses plus noise. InputError for
    bad files, poses too far apart, a split that leaves nothing, or an `out` that exists; ValueError for
    senseless options.
    """
    options = options or ImportOptions()
    _check(options)
    source = _existing(folder)
    rows = read_pose_table(poses_csv, options.columns)
    check_span(poses_csv, xy_of(rows))
    runs = pose_runs(rows)
    guard_m = fitted_m(GUARD_M, xy_of(rows)) if options.guard_m is None else options.guard_m
    options = replace(options, guard_m=guard_m)
    split = split_runs(
        runs, options.session_every, guard_m, options.session_pictures, options.library_pictures
    )
    if not split.library:
        advice = "lower the guard, or give fewer runs to the session"
        raise InputError(poses_csv, f"found no picture {guard_m:.3g} m off the session's; {advice}")
    info = _info(rows, options, poses_csv)
    with new_folder(out, IMPORTED, force=force) as filling:
        copy = _Copier(source, poses_csv, filling)
        with SessionWriter(filling / "survey.log", info, "survey") as writer:
            for row in split.library:
                writer.image_path(float(row.number), copy(row), pose=row.pose)
        _write_session(filling / "session.log", info, rows, split, options, copy)
    nearest = split.nearest_reference_m()
    return ImportSummary(
        session=out / "session.log",
        survey=out / "survey.log",
        rows=len(rows),
        runs=len(runs),
        session_runs=split.session_runs,
        session_pictures=len(split.session),
        library_pictures=len(split.library),
        guarded_runs=split.guarded_runs,
        nearest_reference_median_m=float(np.median(nearest)),
        nearest_reference_max_m=float(nearest.max()),
        notes=info.notes,
    )


def _check(options: ImportOptions) -> None:
    counts = (options.session_pictures, options.library_pictures, options.session_every - 1)
    if min(counts) < 1 or (options.guard_m is not None and not options.guard_m >= 0):
        raise ValueError("expected session_every from 2, at least one picture of a run, and a guard from 0 m")
    if options.camera_fov_rad is not None and not 0 < options.camera_fov_rad < math.pi:
        raise ValueError("expected a horizontal field of view between 0 and 180 degrees")


def _existing(folder: Path | str) -> Path:
    """Refuse what is no folder, "" too: as a Path it would be the working directory."""
    if not str(folder) or not Path(folder).exists():
        found = f"found no such folder {show(str(folder))}"
        raise InputError(Path(folder), f"{found}, expected the one that picture names start from")
    if not Path(folder).is_dir():
        raise InputError(Path(folder), "found a file, expected the folder that picture names start from")
    return Path(folder)


def _info(rows: Sequence[PoseRow], options: ImportOptions, poses_csv: Path) -> SessionInfo:
    positions, lines = xy_of(rows), options.map_lines
    arena = read_map(lines, options.map_unit, positions) if lines else open_arena(positions)
    split_note = (
        f"one run of equal poses in {options.session_every} is the session, at most "
        f"{options.session_pictures} pictures of each; the library has {options.library_pictures} of each "
        f"other run that is at least {options.guard_m:.3g} m from every session pose"
    )
    view_rad = options.camera_fov_rad
    return SessionInfo(
        name=options.name or poses_csv.resolve().parent.name or "pictures",
        cameras=() if view_rad is None else (Camera("camera", horizontal_fov_rad=view_rad),),
        arena=arena,
        notes=(
            options.noise.describe(options.seed),
            "times are synthetic: one second a row of the table",
            split_note,
        ),
    )


def _write_session(
    path: Path,
    info: SessionInfo,
    rows: Sequence[PoseRow],
    split: Split,
    options: ImportOptions,
    copy: _Copier,
) -> None:
    """Write the drive from its first picture to its last; rows of the library still move the robot."""
    pictures = {row.number for row in split.session}
    first, last = split.session[0], split.session[-1]
    info = replace(info, survey=Path("survey.log"), start=first.pose)
    with SessionWriter(path, info) as writer:
        before = first
        for row in rows[first.number : last.number + 1]:
            t_s = float(row.number)
            for motion in synthetic_motions(before.pose, row.pose, options.noise, options.seed, row.number):
                writer.odometry(t_s, motion)
            if row.number in pictures:
                writer.truth(t_s, row.pose)
                writer.image_path(t_s, copy(row))
            before = row


class _Copier:
    def __init__(self, folder: Path, poses_csv: Path, out: Path) -> None:
        self._places = (folder, poses_csv.parent)
        self._table = poses_csv
        self._out = out

    def __call__(self, row: PoseRow) -> str:
        source = next((p / row.image for p in self._places if (p / row.image).is_file()), None)
        if source is None:
            tried = self._places[0] / row.image
            raise InputError(self._table, f"found no picture {tried}, expected a file", row.line)
        try:
            data = picture_file(source)
            decode_picture(data)
        except PictureError as problem:
            raise InputError(self._table, f"{source}: {problem}", row.line) from None
        relative = f"pictures/{row.number:05d}{source.suffix.lower()}"
        copied = self._out / relative
        copied.parent.mkdir(exist_ok=True)
        copied.write_bytes(data)
        return relative
