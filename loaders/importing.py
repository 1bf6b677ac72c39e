"""A folder of pictures and a table of poses, divided honestly into a survey log and a session log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maurice_mcl.values import F64, SessionInfo, fitted_m, open_arena

from .errors import InputError, ReadingNotes
from .export.session import convert_to_log
from .files.maps import check_span, read_map
from .files.text import show
from .files.writing import FolderKind, new_folder
from .formats.picture_folder import open_table
from .formats.video import ENDINGS as VIDEOS
from .reading.options import Reading
from .reading.recording import Picture, Record, Recording, RecordingWrapper, TruthPose, checked
from .reading.session import RecordedSession, with_stated_view
from .reading.transforms import MadeOdometry, corrected
from .session_log.header import FORMAT, SESSION_LOG
from .session_log.writer import SessionWriter

SURVEY_LOG = "survey.log"
IMPORTED = FolderKind(
    "imported pictures", SESSION_LOG, FORMAT, r"(?:session|survey)\.log|(?:session-)?pictures/[\w-]+\.png"
)
GUARD_M = 0.5  # in rooms: neighbors look alike
SESSION_PICTURES = 5  # at most so many of a run, evenly spread: standing still tells little
LIBRARY_PICTURES = 1  # of a run, the middle one: others are near copies
LEAST_STEPS, LEAST_REFERENCES = 20, 20  # with fewer a filter is not judged, and places are not told apart


class PoseRow(NamedTuple):
    """A picture, not opened, with its pose (3,)."""

    picture: Picture
    pose: F64


def read_rows(recording: Recording) -> list[PoseRow]:
    """Return the pictures that have poses, in order. InputError for a bad row."""
    rows, truth = list[PoseRow](), None
    for record in checked(recording, ReadingNotes(keep_going=False)):
        if isinstance(record, TruthPose):
            truth = record
        elif isinstance(record, Picture) and truth is not None and truth.t_s == record.t_s:
            rows.append(PoseRow(record, truth.pose))
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """Which rows, by their numbers, go where."""

    session: list[int]
    library: list[int]
    runs: int  # of equal poses
    session_runs: int
    guarded_runs: int  # left out of the library because of the guard


def split_rows(poses: F64, every: int, guard_m: float) -> Split:
    """Divide poses (n, 3): every `every`-th run of equal ones to the session, the rest to the library.

    A library run within `guard_m` of a session pose is dropped: neighboring frames are nearly one picture.
    """
    edges = np.flatnonzero((poses[1:] != poses[:-1]).any(axis=1)) + 1
    runs = [run.tolist() for run in np.split(np.arange(len(poses)), edges)]
    session = runs[::every]
    others = [run for number, run in enumerate(runs) if number % every]
    distances_m = nearest_m(poses[[run[0] for run in others], :2], poses[[run[0] for run in session], :2])
    library = [run for run, distance_m in zip(others, distances_m, strict=True) if distance_m >= guard_m]
    return Split(
        [row for run in session for row in spread(run, SESSION_PICTURES)],
        [row for run in library for row in spread(run, LIBRARY_PICTURES)],
        len(runs),
        len(session),
        len(others) - len(library),
    )


def spread(run: Sequence[int], most: int) -> list[int]:
    """Choose at most `most` rows of a run, evenly spread; a single one is the middle one."""
    count = min(most, len(run))
    return [run[(2 * k + 1) * len(run) // (2 * count)] for k in range(count)]


def nearest_m(from_xy: F64, to_xy: F64) -> F64:
    """Return the distance (A,) of each point (A, 2) to the nearest of (B, 2); infinite when there is none."""
    return np.array([np.hypot(*(to_xy - point).T).min(initial=np.inf) for point in from_xy], np.float64)


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
    warnings: tuple[
        str, ...
    ] = ()  # where the drive or the library is too small to say anything, and what to do


def import_pictures(
    pictures: Path | str,
    poses_csv: Path,
    out: Path,
    reading: Reading | None = None,
    *,
    map_lines: Path | None = None,
    map_unit: str = "mm",
    every: int = 10,
    force: bool = False,
) -> ImportSummary:
    """Split pictures with poses into a library and a drive; `out` appears completely or not.

    `pictures` is the folder that their names start from, or a video: its frames by the table's rows, or by a
    column of their numbers. `map_lines` is a file of wall segments in `map_unit`, or a ROS map.yaml; every so
    many-th run of equal poses is the session's. Where the table has no odometry, it is made from the poses
    plus noise. InputError for bad files, poses too far apart, a split that leaves nothing, or an `out` that
    exists.
    """
    options = replace(reading or Reading(), table=poses_csv)
    table = open_table(_existing(pictures), options)
    recording = corrected(table, options)
    rows = read_rows(recording)
    if not rows:
        fault = f"found columns {show(', '.join(table.head.names))} and no picture with a pose"
        raise InputError(table.table, f"{fault}; say what they are, as in --reading columns=x=NAME")
    poses = np.array([row.pose for row in rows])
    check_span(poses_csv, poses[:, :2])
    guard_m = fitted_m(GUARD_M, poses[:, :2])
    split = _split(poses_csv, poses, every, guard_m)
    info = _info(poses, every, guard_m, named=table.table, timed=table.has_times)
    if map_lines:
        info = replace(info, arena=read_map(map_lines, map_unit, poses))
    info = with_stated_view(poses_csv, info, options)
    drive: Recording = _Chosen(recording, info, _keys(rows, split.session))
    if not table.has_odometry:
        drive = MadeOdometry(drive, options.odometry_seed)
    surveyed = replace(info, start=None, survey=None, notes=drive.info.notes)
    survey = _Chosen(recording, surveyed, _keys(rows, split.library))
    with new_folder(out, IMPORTED, force=force) as filling:
        _write_survey(filling / SURVEY_LOG, RecordedSession(survey))
        for _ in convert_to_log(RecordedSession(drive), filling / SESSION_LOG):
            pass
    distances_m = nearest_m(poses[split.session, :2], poses[split.library, :2])
    return ImportSummary(
        session=out / SESSION_LOG,
        survey=out / SURVEY_LOG,
        rows=len(rows),
        runs=split.runs,
        session_runs=split.session_runs,
        session_pictures=len(split.session),
        library_pictures=len(split.library),
        guarded_runs=split.guarded_runs,
        nearest_reference_median_m=float(np.median(distances_m)),
        nearest_reference_max_m=float(distances_m.max()),
        notes=drive.info.notes,
        warnings=tuple(_too_few(split, every, guard_m)),
    )


def _split(poses_csv: Path, poses: F64, every: int, guard_m: float) -> Split:
    """Divide rows into the session's and the library's; InputError where the library gets none."""
    split = split_rows(poses, every, guard_m)
    if not split.library:
        advice = "give fewer runs to the session (--every)"
        raise InputError(poses_csv, f"found no picture {guard_m:.3g} m off the session's; {advice}")
    return split


def _too_few(split: Split, every: int, guard_m: float) -> Iterator[str]:
    """Yield what is too small of a division to say anything, and what to do."""
    steps, references = len(split.session), len(split.library)
    if few_steps := steps < LEAST_STEPS:
        yield f"the drive has {steps} steps: fewer than {LEAST_STEPS} are too few to judge a filter by"
    if few_references := references < LEAST_REFERENCES:
        guarded = f"; {split.guarded_runs} places are within {guard_m:.3g} m of the drive" * bool(
            split.guarded_runs
        )
        least = f"fewer than {LEAST_REFERENCES} hardly tell places apart"
        yield f"the library has {references} references: {least}{guarded}"
    if few_steps and not few_references:
        yield f"a smaller --every than {every} gives the drive more"
    elif few_references and not few_steps:
        yield f"a larger --every than {every} gives the library more"
    elif few_steps:
        apart = "record the library and the drive apart, and use `maurice-replay library build` for the first"
        yield f"{split.runs} places are too few for both: {apart}"


def _info(poses: F64, every: int, guard_m: float, *, named: Path, timed: bool) -> SessionInfo:
    """Return the session's header, with how the rows were divided; the place is named after the folder."""
    note = (
        f"one run of equal poses in {every} is the session, at most {SESSION_PICTURES} pictures of each; "
        f"the library has {LIBRARY_PICTURES} of each other run that is at least {guard_m:.3g} m from every "
        "session pose"
    )
    notes = (note,) if timed else ("times are synthetic: one second a row of the table", note)
    name = named.resolve().parent.name or "pictures"
    return SessionInfo(name, start=poses[0], survey=Path(SURVEY_LOG), arena=open_arena(poses), notes=notes)


def _write_survey(file: Path, pictures: RecordedSession) -> None:
    with SessionWriter(file, pictures.info, "survey", pictures="png") as log:
        for moment in pictures.moments():
            assert moment.truth is not None  # of the picture's own row
            log.image(moment.frame.time_s, moment.frame.image, pose=moment.truth)


def _existing(folder: Path | str) -> Path:
    """Refuse what is neither folder nor video, "" too: as a Path it would be the working directory."""
    path = Path(folder)
    is_video = path.suffix.lower() in VIDEOS and path.is_file()
    if not str(folder) or not (is_video or path.is_dir()):
        fault = f"found no such folder {show(str(folder))}"
        raise InputError(path, f"{fault}, expected the one that picture names start from, or a video")
    return path


def _keys(rows: Sequence[PoseRow], numbers: Sequence[int]) -> frozenset[tuple[float, str]]:
    return frozenset((rows[number].picture.t_s, rows[number].picture.name) for number in numbers)


@dataclass(frozen=True, slots=True, eq=False)
class _Chosen(RecordingWrapper):
    """A recording with some of its pictures, under a header of its own."""

    header: SessionInfo
    pictures: frozenset[tuple[float, str]]  # by time and name

    @property
    def info(self) -> SessionInfo:
        """The header."""
        return self.header

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records but the other pictures."""
        for record in self.measured.records(notes):
            if not isinstance(record, Picture) or (record.t_s, record.name) in self.pictures:
                yield record
