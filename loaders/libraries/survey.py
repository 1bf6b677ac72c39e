"""Surveys of two kinds: pictures taken on purpose, and pictures of a drive whose poses are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from maurice_mcl.arrays import F64, Bool
from maurice_mcl.session import Moment, SessionInfo

from ..errors import InputError
from ..formats.registry import NATIVE, chosen, open_session
from ..io.pictures import encode_jpeg
from ..reading import ReadingOptions
from ..recorded_session import RecordedSession
from ..session_log.reader import SessionLog, SurveyPicture
from ..session_log.records import read_header
from .choose import Spacing, blurred, choose, sharpness

EVERY = Spacing(0.4, float(np.radians(45)))  # what a drive is thinned to unless asked otherwise

Progress = Callable[[int, int], None]


class Survey(Protocol):
    """Where a library's pictures come from."""

    @property
    def path(self) -> Path:
        """The log, file or folder."""
        ...

    @property
    def info(self) -> SessionInfo:
        """What the header says."""
        ...

    @property
    def problem_count(self) -> int:
        """How much was skipped."""
        ...

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The first of it."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is worth saying."""
        ...

    def count_pictures(self) -> int:
        """Return how many pictures there are to measure."""
        ...

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Yield them, one at a time."""
        ...


@dataclass(frozen=True, slots=True)
class SurveySelection:
    """What was taken of a drive's pictures."""

    pictures: int
    without_pose: int
    blurred: int
    taken: int

    def __str__(self) -> str:
        near = self.pictures - self.without_pose - self.blurred - self.taken
        left = f"{near} near another, {self.blurred} blurred, {self.without_pose} without a pose"
        return f"{self.taken} of {self.pictures} pictures taken; left out: {left}"


def open_survey(
    path: Path,
    options: ReadingOptions,
    every: Spacing | None = None,
    keep: Path | None = None,
    progress: Progress | None = None,
) -> Survey:
    """Open a survey log, or choose the entries of a drive. InputError where no picture has a pose.

    A survey log is taken whole unless `every` is given. Pictures that are no files are written to the
    folder `keep`, where there is one.
    """
    native = chosen(path, options).name == NATIVE
    if native and read_header(path)[1] == "survey":
        survey = SessionLog(path, keep_going=options.keep_going, camera=options.camera)
        return (
            survey if every is None else SelectedSurvey(survey, survey.survey_pictures, every, None, progress)
        )
    drive = open_session(path, options)
    return SelectedSurvey(drive, lambda: _with_poses(drive), every or EVERY, keep, progress)


def _with_poses(drive: SessionLog | RecordedSession) -> Iterator[SurveyPicture]:
    for moment in drive.moments():
        yield SurveyPicture(_file_of(drive, moment), moment.frame.image, moment.truth, covered=False)


def _file_of(drive: SessionLog | RecordedSession, moment: Moment) -> Path | None:
    """Return the file that a picture was read from; None where it is inside something else."""
    name = moment.frame.picture
    for folder in (drive.path.parent, drive.path, Path()):
        if name and len(name) < 1000 and (folder / name).is_file():
            return folder / name
    return None


class SelectedSurvey:
    """The chosen pictures of a drive or survey. All are looked at once, when this is made."""

    def __init__(
        self,
        source: SessionLog | RecordedSession,
        pictures: Callable[[], Iterator[SurveyPicture]],
        every: Spacing,
        keep: Path | None,
        progress: Progress | None,
    ) -> None:
        self._source, self._pictures, self._keep = source, pictures, keep
        self._taken, self.chosen = self._choose(every, progress)

    @property
    def path(self) -> Path:
        """The log, file or folder."""
        return self._source.path

    @property
    def info(self) -> SessionInfo:
        """What the header says."""
        return self._source.info

    @property
    def problem_count(self) -> int:
        """How much was skipped."""
        return self._source.problem_count

    @property
    def problems(self) -> tuple[InputError, ...]:
        """The first of it."""
        return self._source.problems

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is worth saying, first of all what was chosen."""
        return (f"{self.path}: {self.chosen}", *self._source.warnings)

    def count_pictures(self) -> int:
        """Return how many pictures were chosen, covered ones counted."""
        return int(self._taken.sum())

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Yield the chosen pictures, and those with the lens covered, in order."""
        for number, (picture, taken) in enumerate(zip(self._pictures(), self._taken, strict=False)):
            if taken:
                yield self._kept(picture, number)

    def _choose(self, every: Spacing, progress: Progress | None) -> tuple[Bool, SurveySelection]:
        poses: list[F64] = []
        sharp: list[F64] = []
        covered: list[bool] = []
        total = self._source.count_pictures() if progress else 0
        for done, picture in enumerate(self._pictures(), 1):
            poses.append(np.full(3, np.nan) if picture.pose is None else picture.pose)
            sharp.append(sharpness(picture.image))
            covered.append(picture.covered)
            if progress:
                progress(done, total)
        rows, values = np.array(poses).reshape(-1, 3), np.array(sharp).reshape(-1, 2)
        taken = np.array(covered, bool)
        known = np.flatnonzero(np.isfinite(rows).all(axis=1))
        if not len(known):
            if taken.all():
                raise InputError(self.path, "found no picture to take, expected pictures with poses")
            found = f"found {int((~taken).sum())} pictures and no pose of any, expected truth beside them"
            raise InputError(self.path, f"{found}; see --truth-topic, --table and --truth-offset")
        unsharp = blurred(values[known])
        left = known[~unsharp]
        entries = left[choose(rows[left], values[left].min(axis=1), every)]
        taken[entries] = True
        pictures = int((~np.array(covered, bool)).sum())
        return taken, SurveySelection(pictures, pictures - len(known), int(unsharp.sum()), len(entries))

    def _kept(self, picture: SurveyPicture, number: int) -> SurveyPicture:
        """Write a picture that is no file of its own, so that the library can keep it."""
        if picture.path is not None or self._keep is None or picture.covered:
            return picture
        file = self._keep / f"{number:06d}.jpg"
        file.write_bytes(encode_jpeg(picture.image))
        return SurveyPicture(file, picture.image, picture.pose, picture.covered)
