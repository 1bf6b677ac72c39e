"""Libraries: opened from a folder, or built once from a survey and kept in the cache."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_mcl.sensor.ahead import on_all_cores
from maurice_mcl.sensor.descriptors.registry import CHANNELS, OUR_NAMES, Channel, describe, reduced
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values import (
    F32,
    F64,
    U8,
    Arena,
    Camera,
    ChannelIndex,
    Library,
    Progress,
    expected_one_of,
    open_arena,
)

from ..bags.containers import looks_like_bag
from ..errors import FieldError, InputError, ReadingNotes
from ..files.maps import check_span, read_map, read_occupancy
from ..files.paths import A_LIBRARY, first_bytes
from ..files.ros_maps import ENDINGS
from ..files.writing import cache_root, discard
from ..formats.registry import unlike
from ..reading.options import Reading
from ..session_log.header import arena_to_json
from ..session_log.reader import SurveyLog, SurveyPicture
from .files import VERSION, hashes_of, load_library, manifest_warnings, save_library
from .remembered import kept_tables, remembered
from .survey import Survey, files_of_table, is_table, open_table, survey_in

BEFORE_LOG = b"\xef\xbb\xbf \t\r\n"
Warn = Callable[[str], None]


def build_library(
    survey: str | Path,
    channels: Sequence[str] | None = None,
    *,
    keep_going: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
    log: Survey | None = None,
    yaw_rad: float = 0.0,
    map_file: Path | None = None,
    map_unit: str = "mm",
) -> Library:
    """Measure the pictures of a survey log, or of the survey given as `log`, by every channel.

    The library has the survey's L poses (L, 3) and one descriptor (L, D) a channel; all channels unless some
    are named. `yaw_rad` is the counter-clockwise angle from the survey camera's direction to the robot
    camera's at the same heading. `map_file`, a ROS `map.yaml` or wall segments in
    `map_unit` ("mm", "m"), replaces the header's. `progress` gets pictures done and in all, `warn` warnings.

    The noise floor is the mean of the pictures with the lens covered (zeros, with a warning, without any),
    the relevance the maximum of each bin over the library (thesis 3.3). Without a map everything near the
    references is free space. Few pictures are held at a time. A third-party channel that fails is left out,
    with a warning.

    Raises InputError for a broken survey, one without any picture, or poses too far apart.

        >>> from maurice_loaders import build_library
        >>> library = build_library("survey.log", channels=["color"])
        >>> library.size, list(library.index)
        (2, ['color'])
    """
    survey = Path(survey)
    log = log or SurveyLog(survey, Reading(keep_going=keep_going))
    rows = _Rows(chosen_channels(channels), yaw_rad)
    total = log.count_pictures() if progress else 0
    for count, measured in enumerate(on_all_cores(rows.measured, log.survey_pictures()), start=1):
        rows.add(*measured)
        if progress:
            progress(count, total)
    if not rows.poses:
        raise InputError(survey, "found no picture with a pose, expected at least one; is this the survey?")
    poses = np.array(rows.poses)
    map_ = log.info.arena if map_file is None else read_map(map_file, map_unit, poses)
    check_span(survey, poses, map_)
    arena = map_ or open_arena(poses)
    camera = log.info.cameras[0] if log.info.cameras else None
    library = rows.library(log.info.name, arena, log.info.display_units, camera)
    for text in [*rows.broken, *_warnings(log, library, rows.has_covered)]:
        (warn or silent)(text)
    return library


class _Rows:
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
        return any(self._covered.values())

    def measured(self, picture: SurveyPicture) -> tuple[SurveyPicture, dict[str, F32]]:
        """Reduce a picture and measure it by our channels, on any thread."""
        ours, small = OUR_NAMES.intersection(self._channels), reduced(picture.image)
        return replace(picture, image=small), {name: CHANNELS[name].describe(small) for name in ours}

    def add(self, picture: SurveyPicture, ours: Mapping[str, F32]) -> None:
        rows = self._covered if picture.pose is None else self._references
        for name, channel in list(self._channels.items()):
            row = ours[name] if name in ours else self._by_others(name, channel, picture.image)
            if row is None:
                del self._channels[name]
            else:
                rows[name].append(row)
                self._sizes[name] = len(row)
        if picture.pose is not None:
            self.poses.append(picture.pose - [0.0, 0.0, self._yaw_rad])
            self._pictures.append(None if picture.path is None else picture.path.resolve())

    def library(self, name: str, arena: Arena, display_units: str, camera: Camera | None) -> Library:
        index = {
            channel: _index(self._references[channel], self._covered[channel]) for channel in self._channels
        }
        pictures = tuple(self._pictures)
        return Library(name, np.array(self.poses), pictures, index, arena, display_units, camera=camera)

    def _by_others(self, name: str, channel: Channel, image: U8) -> F32 | None:
        try:
            return describe(channel, image, self._sizes.get(name))
        except ValueError as problem:
            self.broken.append(f"{' '.join(str(problem).split())}; the library is built without it")
            return None


def chosen_channels(names: Sequence[str] | None) -> dict[str, Channel]:
    """Return the named channels, or all; FieldError for an unknown name."""
    unknown = [name for name in names or () if name not in CHANNELS]
    if unknown:
        raise FieldError(f"found channel {unknown[0]!r}, {expected_one_of(unknown[0], CHANNELS)}")
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
    """Ignore a warning."""


__all__ = ["build_library", "library_key", "load_library", "open_library", "save_library"]


def open_library(
    path: str | Path,
    channels: Sequence[str] | None = None,
    *,
    keep_going: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Library:
    """Read a library folder, or build a survey's library unless the cache has it.

    A ROS `map.yaml` is one, too, and a bag with a map in it: a library of places without pictures.
    A survey is a log, a folder with a `survey.log`, or a table (CSV) of pictures with poses, without times.
    The cache knows a library by the content of log and pictures and by the channels' parameters; what is
    damaged there is built again. Its folder: MAURICE_CACHE, or the user's cache. Arguments as for
    `build_library`. Raises InputError for anything that is neither library nor survey.

        >>> from maurice_loaders import open_library
        >>> library = open_library("survey.log", channels=["color"])
        >>> library.poses.shape
        (2, 3)
    """
    library = _opened(Path(path), channels, keep_going=keep_going, progress=progress, warn=warn)
    return replace(library, keep=kept_tables)


def _opened(
    path: Path,
    channels: Sequence[str] | None,
    *,
    keep_going: bool,
    progress: Progress | None,
    warn: Warn | None,
) -> Library:
    if path.suffix.lower() in ENDINGS:
        return map_library(read_occupancy(path), path.stem)
    if looks_like_bag(path):
        from ..bags.maps import expected_map

        return map_library(expected_map(path), path.stem)
    path = survey_in(path)
    log = open_table(path) if is_table(path) else None
    if path.is_dir() and log is None:
        return load_library(path)
    if log is None and not (path.is_file() and first_bytes(path).lstrip(BEFORE_LOG).startswith(b"{")):
        raise unlike(path, A_LIBRARY)
    cache = cache_root() / "libraries" / library_key(path, channels, keep_going=keep_going)
    cached = _from_cache(cache, warn)
    if cached is not None and set(chosen_channels(channels)) <= set(cached.index):
        return cached  # else a channel failed when it was built, and may have been fixed since
    warnings: list[str] = []
    built = build_library(
        path, channels, keep_going=keep_going, progress=progress, warn=warnings.append, log=log
    )
    kept_now = _into_cache(built, cache, warnings)
    for text in warnings:
        (warn or silent)(text)
    return kept_now


def library_key(survey: Path, channels: Sequence[str] | None = None, *, keep_going: bool = False) -> str:
    """Name a survey's library by content: log, pictures, channel parameters, and what decodes pictures."""
    parameters = {name: channel.parameters() for name, channel in chosen_channels(channels).items()}
    walls, files = (
        (None, [*map(str, files_of_table(survey))]) if is_table(survey) else _walls_and_files(survey)
    )
    made_by = [VERSION, "with camera", keep_going, parameters, cv2.__version__, walls]
    digest = hashlib.sha256(json.dumps(made_by, sort_keys=True).encode())
    content = remembered("content", files, lambda: hashlib.sha256(hashes_of(files).encode()).hexdigest())
    digest.update(content.encode())
    return digest.hexdigest()[:32]


def _walls_and_files(survey: Path) -> tuple[Any, list[str]]:
    """Return the map of a survey log, which may be a file of its own, and the log with its pictures."""
    log = SurveyLog(survey)

    def names() -> str:
        pictures = log.pictures(ReadingNotes(keep_going=True))
        return json.dumps([picture.path for picture in pictures if picture.path])

    walls = None if log.info.arena is None else arena_to_json(log.info.arena)
    named = json.loads(remembered("pictures", [str(survey)], names))
    return walls, [str(survey), *(str(survey.parent / name) for name in named)]


def _from_cache(kept: Path, warn: Warn | None) -> Library | None:
    try:
        library = load_library(kept)
        for text in manifest_warnings(kept):
            (warn or silent)(text)
    except (InputError, ValueError):  # not there, or damaged: it is only a cache
        return None
    return library


def _into_cache(built: Library, kept: Path, warnings: list[str]) -> Library:
    """Keep a library; where that fails the built one serves as well, with its pictures at the survey."""
    existed = kept.exists()  # asked before it is read: what comes into place afterwards is never thrown away
    quicker = _from_cache(kept, None)
    if quicker is not None and set(built.index) <= set(quicker.index):
        return quicker
    try:
        if existed:
            discard(kept)  # it is damaged, or lacks a channel
        save_library(built, kept, warnings=warnings)
        not_kept = "it was removed meanwhile"
    except (InputError, OSError) as problem:
        not_kept = str(problem)
    library = _from_cache(kept, None)  # ours, or that of another process that was quicker still
    if library is None:
        warnings.append(f"the library was not kept for next time: {not_kept}")
    return library or built
