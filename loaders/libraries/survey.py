"""Surveys of two kinds: pictures taken on purpose, and pictures of a drive whose poses are known."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.values import F64, U8, Bool, Progress, SessionInfo, angle_between, fitted_m

from ..errors import InputError, ReadingNotes
from ..files.pictures import encode_jpeg
from ..files.text import METERS
from ..formats.picture_folder import TABLES, TableRecording, looks_like_table
from ..formats.registry import open_session
from ..reading.observations import SCANS
from ..reading.options import Reading
from ..reading.recording import Picture, RecordingWrapper
from ..reading.session import RecordedSession
from ..session_log.header import session_in
from ..session_log.reader import SurveyLog, SurveyPicture, is_survey
from .files import MANIFEST

FEWEST_JUDGED = 12  # pictures; fewer do not tell what is usual
NOISE_PX = 1.0  # sd of the smoothing that takes noise away
BLUR_PX = 9  # width of the blurring
BLURRED_SDS = 3.5  # robust standard deviations below the median, of the logarithm ...
LESS_SHARP_SDS = 2.0  # ... or so few, where the picture is ...
ONE_WAY_SDS = 3.0  # ... sharper across than along, or along than across, than is usual by so many
LEAST_SD = 0.06  # of the logarithm, where nearly all pictures are equally sharp


@dataclass(frozen=True, slots=True)
class Spacing:
    """How far apart entries are at least: nearer ones look in other directions."""

    distance_m: float
    angle_rad: float


def read_every(text: str) -> Spacing:
    """Read `0.4m,45deg`; ValueError for other words."""
    length, _, angle = text.partition(",")
    distance = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(in|ft|cm|m)\s*", length)
    turned = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*deg\s*", angle)
    if not distance or not turned:
        raise ValueError(f"--every is a length and an angle like 0.4m,45deg or 18in,45deg, found {text!r}")
    every = Spacing(float(distance[1]) * METERS[distance[2]], float(np.radians(float(turned[1]))))
    if not 0.01 <= every.distance_m <= 1000 or not 0.01 <= every.angle_rad <= np.pi:
        raise ValueError(f"--every goes from 1 cm to 1 km and from 0.6 to 180 deg, found {text!r}")
    return every


def sharpness(image: U8) -> F64:
    """Return the logarithm (2,) of the detail (H, W, 3) that blurring takes away, down and across.

    After Crete et al. (2007): what is blurred already loses little. Noise is smoothed away first.
    """
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(gray, (0, 0), NOISE_PX)
    return np.log(np.array([_lost(smooth, axis) for axis in (0, 1)]) + 1e-6)


def _lost(gray: NDArray[Any], axis: int) -> float:
    size = (BLUR_PX, 1) if axis else (1, BLUR_PX)
    before, after = (np.abs(np.diff(picture, axis=axis)) for picture in (gray, cv2.blur(gray, size)))
    return float(np.maximum(before - after, 0).sum() / max(float(before.sum()), 1e-6))


def blurred(sharpnesses: F64) -> Bool:
    """Mark the pictures that are far less sharp (n, 2) than usual, or less sharp, in one direction."""
    if len(sharpnesses) < FEWEST_JUDGED:
        return np.zeros(len(sharpnesses), bool)
    below = -_deviations(sharpnesses.min(axis=1))
    one_way = np.abs(_deviations(sharpnesses[:, 0] - sharpnesses[:, 1])) > ONE_WAY_SDS
    return np.asarray((below > BLURRED_SDS) | ((below > LESS_SHARP_SDS) & one_way))


def _deviations(values: F64) -> F64:
    above = values - np.median(values)
    return np.asarray(above / max(1.4826 * float(np.median(np.abs(above))), LEAST_SD))


def choose(poses: F64, sharpnesses: F64, every: Spacing) -> NDArray[np.intp]:
    """Choose among poses (n, 3), the sharpest first, none near a chosen one; return numbers (k,), rising."""
    cells: dict[tuple[int, int], list[int]] = {}
    chosen: list[int] = []
    for number in np.argsort(-sharpnesses, kind="stable"):
        pose = poses[number]
        x, y = np.floor(pose[:2] / every.distance_m).astype(int).tolist()
        cells_near = product((x - 1, x, x + 1), (y - 1, y, y + 1))
        near = (other for cell in cells_near for other in cells.get(cell, ()))
        if not any(_same(pose, poses[other], every) for other in near):
            cells.setdefault((x, y), []).append(int(number))
            chosen.append(int(number))
    return np.sort(np.array(chosen, np.intp))


def _same(a: F64, b: F64, every: Spacing) -> bool:
    turned = angle_between(float(a[2]), float(b[2]))
    distance_m = float(np.hypot(a[0] - b[0], a[1] - b[1]))
    return distance_m < every.distance_m * (1 - 1e-9) and turned < every.angle_rad * (1 - 1e-9)


EVERY = Spacing(0.4, float(np.radians(45)))  # what a drive through rooms is thinned to


@dataclass(frozen=True, slots=True)
class SurveySelection:
    """What was taken of a drive's pictures."""

    pictures: int
    without_pose: int
    blurred: int
    taken: int
    every: Spacing | None  # by which they were chosen; None: all are taken

    def __str__(self) -> str:
        near = self.pictures - self.without_pose - self.blurred - self.taken
        every = self.every or EVERY
        spacing = f"{every.distance_m:.3g} m, {np.degrees(every.angle_rad):.0f} deg"
        left = f"{near} near another ({spacing}), {self.blurred} blurred, {self.without_pose} without a pose"
        return f"{self.taken} of {self.pictures} pictures taken; left out: {left}"


def open_survey(
    path: Path,
    options: Reading,
    every: Spacing | None = None,
    keep: Path | None = None,
    progress: Progress | None = None,
) -> Survey:
    """Open a survey log, or choose the entries of a drive. Raises InputError if no picture has a pose.

    A survey log, a folder that holds one, and a table of pictures with poses that has neither times nor
    odometry are taken completely unless `every` is given. Pictures that are no files are written to the
    folder `keep`, where there is one.
    """
    path = session_in(survey_in(path))
    if options.format is None and is_survey(path):
        survey = SurveyLog(path, options)
        if every is None:
            return survey
        return SelectedSurvey(survey, survey.survey_pictures, every, None, progress)
    drive = open_session(path, options)
    return _selected(drive, every or (None if _is_surveyed(drive) else EVERY), keep, progress)


def open_table(path: Path) -> SelectedSurvey:
    """Open all pictures of a table that has poses, and neither times nor odometry. InputError for a drive."""
    drive = open_session(path, Reading())
    if not _is_surveyed(drive):
        fault = "found a drive, expected a library or a survey; make a library of it first"
        raise InputError(path, f"{fault}: maurice-replay library build {path} -o LIBRARY")
    return _selected(drive, None)


def _selected(
    drive: RecordedSession,
    every: Spacing | None,
    keep: Path | None = None,
    progress: Progress | None = None,
) -> SelectedSurvey:
    if drive.observed.name == SCANS:
        text = "found scans of a laser and no picture, and a library is made of pictures"
        raise InputError(drive.path, f"{text}; maurice-replay map build makes a map of scans")

    def pictures() -> Iterator[SurveyPicture]:
        for moment in drive.moments():
            file = _file_named(drive, moment.frame.picture)
            yield SurveyPicture(file, moment.frame.image, moment.truth, covered=False)

    return SelectedSurvey(drive, pictures, every, keep, progress)


def is_table(path: Path) -> bool:
    """Return whether a path is a table (CSV), or a folder with one that is no library."""
    if not path.is_dir():
        return path.suffix.lower() in TABLES
    return not (path / MANIFEST).exists() and looks_like_table(path)


def files_of_table(path: Path) -> list[Path]:
    """Return the table and the files of its pictures, without decoding any. InputError as `open_table`."""
    drive = open_session(path, Reading())
    table = _table_of(drive)
    if table is None:
        return [path]
    records = table.records(ReadingNotes(keep_going=True))
    named = [_file_named(drive, record.name) for record in records if isinstance(record, Picture)]
    return [table.table, *(file for file in named if file is not None)]


def survey_in(path: Path) -> Path:
    """Return the survey log in a folder that is no library; else the path itself."""
    log = path / "survey.log"
    return log if log.is_file() and not (path / MANIFEST).exists() else path


def _table_of(drive: RecordedSession) -> TableRecording | None:
    recording = drive.recording
    while isinstance(recording, RecordingWrapper):
        recording = recording.measured
    return recording if isinstance(recording, TableRecording) else None


def _is_surveyed(drive: RecordedSession) -> bool:
    table = _table_of(drive)
    return table is not None and table.surveyed


def _file_named(drive: RecordedSession, name: str | None) -> Path | None:
    for folder in (drive.path.parent, drive.path, Path()):
        if name and len(name) < 1000 and (folder / name).is_file():
            return folder / name
    return None


class _Surveys:
    """Surveys or drives before their pictures are read; name, map and units are those of the first."""

    def __init__(self, *sources: Survey | RecordedSession) -> None:
        self._sources = sources

    @property
    def path(self) -> Path:
        """The log, file or folder of the first."""
        return self._sources[0].path

    @property
    def info(self) -> SessionInfo:
        """What the header of the first says."""
        return self._sources[0].info

    @property
    def problem_count(self) -> int:
        """How much was skipped."""
        return sum(source.problem_count for source in self._sources)

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The first of it."""
        return tuple(problem for source in self._sources for problem in source.problems)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks for the user."""
        return tuple(text for source in self._sources for text in source.warnings)


class SelectedSurvey(_Surveys):
    """The chosen pictures of a drive or survey. All are looked at once, when this is made."""

    def __init__(
        self,
        source: SurveyLog | RecordedSession,
        pictures: Callable[[], Iterator[SurveyPicture]],
        every: Spacing | None,
        keep: Path | None,
        progress: Progress | None,
    ) -> None:
        """With `every` None all are taken; EVERY is fitted to the size of the place."""
        super().__init__(source)
        self._source, self._pictures, self._keep = source, pictures, keep
        self._taken, self.chosen = self._choose(every, progress)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks for the user; the first one says what was chosen."""
        table = isinstance(self._source, RecordedSession) and _is_surveyed(self._source)
        of_a_drive = () if table else super().warnings  # no odometry, no times
        return (f"{self.path}: {self.chosen}", *of_a_drive)

    def count_pictures(self) -> int:
        """Return the number of chosen pictures, including covered ones."""
        return int(self._taken.sum())

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Yield the chosen pictures, and those with the lens covered, in order."""
        for number, (picture, is_taken) in enumerate(zip(self._pictures(), self._taken, strict=False)):
            if is_taken:
                yield self._kept(picture, number)

    def _choose(self, every: Spacing | None, progress: Progress | None) -> tuple[Bool, SurveySelection]:
        poses: list[F64] = []
        sharp: list[F64] = []
        covered: list[bool] = []
        total = self._source.count_pictures() if progress else 0
        for count, picture in enumerate(self._pictures(), 1):
            poses.append(np.full(3, np.nan) if picture.pose is None else picture.pose)
            sharp.append(sharpness(picture.image))
            covered.append(picture.covered)
            if progress:
                progress(count, total)
        rows, values = np.array(poses).reshape(-1, 3), np.array(sharp).reshape(-1, 2)
        mask = np.array(covered, bool)
        known = np.flatnonzero(np.isfinite(rows).all(axis=1))
        if not len(known):
            if mask.all():
                raise InputError(self.path, "found no picture to take, expected pictures with poses")
            fault = f"found {int((~mask).sum())} pictures and no pose of any, expected truth beside them"
            text = f"{fault}; see --reading truth_topic=..., table=... and truth_offset_s=..."
            raise InputError(self.path, text)
        unsharp = np.zeros(len(known), bool) if every is None else blurred(values[known])
        left = known[~unsharp]
        if every is EVERY:
            every = replace(EVERY, distance_m=fitted_m(EVERY.distance_m, rows[known, :2]))
        entries = left if every is None else left[choose(rows[left], values[left].min(axis=1), every)]
        mask[entries] = True
        pictures = int((~np.array(covered, bool)).sum())
        return mask, SurveySelection(pictures, pictures - len(known), int(unsharp.sum()), len(entries), every)

    def _kept(self, picture: SurveyPicture, number: int) -> SurveyPicture:
        if picture.path is not None or self._keep is None or picture.covered:
            return picture
        file = self._keep / f"{number:06d}.jpg"
        file.write_bytes(encode_jpeg(picture.image))
        return SurveyPicture(file, picture.image, picture.pose, picture.covered)


class JoinedSurvey(_Surveys):
    """Several surveys of one place as one."""

    def __init__(self, surveys: Sequence[Survey]) -> None:
        super().__init__(*surveys)
        self._surveys = tuple(surveys)

    def count_pictures(self) -> int:
        """Return the number of pictures, including covered ones."""
        return sum(survey.count_pictures() for survey in self._surveys)

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Yield all pictures, survey by survey."""
        for survey in self._surveys:
            yield from survey.survey_pictures()


Survey = SurveyLog | SelectedSurvey | JoinedSurvey  # where a library's pictures come from
