"""From a survey log to a library: every picture measured by every channel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from maurice_mcl.arena import Arena, open_arena
from maurice_mcl.channels import CHANNELS, OUR_NAMES, Channel, describe
from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.typing import F32, F64, U8

from .errors import LogError
from .extent import check_span
from .library_survey import Survey
from .session_log import SessionLog, SurveyPicture

Progress = Callable[[int, int], None]  # pictures done, pictures in all
Warn = Callable[[str], None]


def build_library(
    survey: Path,
    channels: Sequence[str] | None = None,
    *,
    keep_going: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
    log: Survey | None = None,
    yaw_rad: float = 0.0,
) -> Library:
    """Measure the pictures of a survey log, or of the survey given as `log`; its poses become the library's.

    `yaw_rad` is how far, counter-clockwise, the robot's camera looks off where the survey's looked at the
    same heading.

    The noise floor is the mean of the covered-lens pictures (zeros, with a warning, when there are none),
    the relevance the maximum of each bin over the library (thesis 3.3). Without a map in the survey all is
    free. Pictures are held one at a time. LogError for a broken survey, one without any picture, or
    poses too far apart (see `check_span`). A third-party channel that fails is left out, with a warning.
    """
    log = log or SessionLog(survey, keep_going=keep_going)
    rows = _Rows(chosen_channels(channels), yaw_rad)
    total = log.count_pictures() if progress else 0
    for done, picture in enumerate(log.survey_pictures(), start=1):
        rows.add(picture)
        if progress:
            progress(done, total)
    if not rows.poses:
        raise LogError(survey, "found no picture with a pose, expected at least one; is this the survey?")
    check_span(survey, np.array(rows.poses), log.info.arena)
    arena = log.info.arena or open_arena(np.array(rows.poses))
    library = rows.library(log.info.name, arena, log.info.display_units)
    for text in [*rows.broken, *_warnings(log, library, rows.has_covered)]:
        (warn or silent)(text)
    return library


class _Rows:
    """What has been measured so far, picture by picture."""

    def __init__(self, channels: Mapping[str, Channel], yaw_rad: float) -> None:
        self.poses: list[F64] = []
        self.broken: list[str] = []  # channels of somebody else's that failed, and why
        self._pictures: list[Path | None] = []
        self._channels = dict(channels)  # those that have not failed
        self._references: dict[str, list[F32]] = {name: [] for name in channels}
        self._covered: dict[str, list[F32]] = {name: [] for name in channels}
        self._sizes: dict[str, int] = {}
        self._yaw_rad = yaw_rad

    @property
    def has_covered(self) -> bool:
        """Whether there was a picture with the lens covered."""
        return any(self._covered.values())

    def add(self, picture: SurveyPicture) -> None:
        """Measure a picture by every channel."""
        rows = self._covered if picture.pose is None else self._references
        for name, channel in list(self._channels.items()):
            row = self._measured(name, channel, picture.image)
            if row is None:
                del self._channels[name]
            else:
                rows[name].append(row)
                self._sizes[name] = len(row)
        if picture.pose is not None:
            self.poses.append(picture.pose - [0.0, 0.0, self._yaw_rad])
            self._pictures.append(None if picture.path is None else picture.path.resolve())

    def library(self, name: str, arena: Arena, display_units: str) -> Library:
        """Make a library of it."""
        index = {one: _index(self._references[one], self._covered[one]) for one in self._channels}
        return Library(name, np.array(self.poses), tuple(self._pictures), index, arena, display_units)

    def _measured(self, name: str, channel: Channel, image: U8) -> F32 | None:
        if name in OUR_NAMES:
            return channel.describe(image)
        try:
            return describe(channel, image, self._sizes.get(name))
        except ValueError as problem:
            self.broken.append(f"{' '.join(str(problem).split())}; the library is built without it")
            return None


def chosen_channels(names: Sequence[str] | None) -> dict[str, Channel]:
    """Give the named channels, or all; ValueError for a name that is none."""
    unknown = [name for name in names or () if name not in CHANNELS]
    if unknown:
        raise ValueError(f"found channel {unknown[0]!r}, expected one of {', '.join(CHANNELS)}")
    return {name: CHANNELS[name] for name in (CHANNELS if names is None else names)}


def _index(references: list[F32], covered: list[F32]) -> ChannelIndex:
    rows = np.array(references, np.float32)
    floor = np.mean(covered, axis=0, dtype=np.float64) if covered else np.zeros(rows.shape[1])
    return ChannelIndex(rows, np.asarray(floor, np.float32), rows.max(axis=0))


def _warnings(log: Survey, library: Library, covered: bool) -> list[str]:
    texts = list(log.warnings)
    if log.problem_count:
        texts.append(f"{log.path}: {log.problem_count} broken records skipped, the first: {log.problems[0]}")
    if not covered:
        texts.append(f"{log.path}: found no picture with the lens covered, so the noise floor is zero")
    x_min, y_min, x_max, y_max = library.arena.bounds
    x, y = library.poses[:, 0], library.poses[:, 1]
    outside = int(((x < x_min) | (x > x_max) | (y < y_min) | (y > y_max)).sum())
    if outside:
        texts.append(f"{log.path}: {outside} of {library.size} surveyed poses lie outside the map")
    return texts


def silent(text: str) -> None:
    """Drop a warning that nobody asked for."""
