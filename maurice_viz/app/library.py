"""Libraries of references: built from a survey or a drive, channels tuned to one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files import writing
from maurice_loaders.files.text import toml_value
from maurice_loaders.libraries import survey as surveys
from maurice_loaders.libraries.files import LIBRARY, hash_file
from maurice_loaders.libraries.measured import known_descriptors
from maurice_loaders.libraries.store import build_library as measure
from maurice_loaders.libraries.store import save_library
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.session_log.header import session_in
from maurice_mcl.fitting import sensor as fitting
from maurice_mcl.fitting.sensor import tune as fit_channels
from maurice_mcl.library.left_out import LeftOutTable
from maurice_mcl.library.quality import Coverage, coverage_of
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values import Library, expected_one_of

from ..errors import SILENT, Listener, OptionError, progress_of
from ..running.drive_check import score_feature
from ..running.open import (
    library_at,
    open_session,
    remark_open,
    remark_skipped,
)
from ..text.library import say_drive
from .library_check import say_default, say_scales


@dataclass(frozen=True, slots=True, eq=False)
class BuiltLibrary:
    """A library as it was built and saved."""

    library: Library
    folder: Path
    coverage: Coverage | None  # how much of the map it covers; None: not built from a drive


def build_library(
    survey: str | Path,
    to: str | Path,
    *,
    every: str | None = None,
    add: Sequence[str | Path] = (),
    yaw_rad: float = 0.0,
    map_file: str | Path | None = None,
    map_unit: str = "mm",
    landmarks: bool = False,
    reading: Reading | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> BuiltLibrary:
    """Build a library from a survey log, or from a drive with truth, and save it to the folder `to`.

    `every` is the distance and the angle between entries of a drive, as "0.4m,45deg" (the default of a drive;
    a survey log is taken whole). `add` are further surveys, whose references are added, such as those that
    `check_library` asked for. `yaw_rad` is the yaw of the robot's camera from the survey's camera, in
    radians, counter-clockwise. `map_file` replaces the survey's map: a ROS `map.yaml`, or wall segments
    in `map_unit` ("mm" or "m"). With `landmarks`, those of the pictures are found and stored with it, if
    there are any (docs/landmarks.md). `reading` says how a drive is read.

    Raises OptionError for a bad `every`, and InputError for a survey without poses or a folder that exists.

        >>> import maurice_viz as mv
        >>> built = mv.build_library("survey.log", "library")
        >>> built.library.size
        160
    """
    survey, options = Path(survey), reading or Reading()
    spacing = _spacing_of(every)
    writing.check_target(Path(to), LIBRARY, force=force)
    writing.expect_apart(Path(to), survey, *map(Path, add))
    with writing.temporary_folder("maurice-library") as folder:
        source = surveys.open_survey(
            survey, options, spacing, folder, progress_of(listener, "choose pictures")
        )
        chosen = source.chosen.every or surveys.EVERY if isinstance(source, surveys.SelectedSurvey) else None
        if add:
            source = surveys.JoinedSurvey(
                [source, *(surveys.open_survey(Path(path), options) for path in add)]
            )
        built = measure(
            survey,
            keep_going=options.keep_going,
            progress=progress_of(listener, "library"),
            warn=listener.warning,
            log=source,
            yaw_rad=yaw_rad,
            map_file=None if map_file is None else Path(map_file),
            map_unit=map_unit,
        )
        remark_open(built, listener)
        drive = open_session(survey, options, SILENT) if chosen is not None and not yaw_rad else None
        _warn_of_fit(built, drive, listener)
        built = _with_landmarks(built, listener) if landmarks else built
        save_library(built, Path(to), force=force)
        coverage = None if chosen is None else coverage_of(built, chosen.distance_m)
        return BuiltLibrary(built, Path(to), coverage)


def _spacing_of(every: str | None) -> surveys.Spacing | None:
    try:
        return None if every is None else surveys.read_every(every)
    except ValueError as problem:
        raise OptionError(str(problem)) from None


def _with_landmarks(library: Library, listener: Listener) -> Library:
    from maurice_loaders.libraries.landmarks import with_landmarks

    return with_landmarks(library, progress=listener.progress, warn=listener.warning)


def _warn_of_fit(library: Library, drive: RecordedSession | None, listener: Listener) -> None:
    """Warn of what the library's pictures show, and those of the drive that it was built from."""
    for text in say_scales(library):
        listener.warning(text)
    if drive is not None:
        weights = FEATURES["blended"]
        for text in say_drive(library.name, weights, score_feature(library, weights, drive)):
            listener.warning(text)


DEFAULT_SENSOR = SensorParameters(FEATURES["blended"])  # the default, which the result is compared with


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Scales and weights of channels, the drives that they were fitted and scored on, and the scores."""

    tuned: fitting.Tuned
    distances: Mapping[str, str]
    library: str
    fitted_on: tuple[str, ...]  # sessions; none: the library, one reference left out at a time
    fitted: fitting.Scores
    scored_on: tuple[str, ...]
    scored: fitting.Scores | None

    @property
    def scales(self) -> dict[str, float]:
        """The distance of one nat, for every channel that was tuned."""
        return {name: _rounded(v) for name, v in zip(self.tuned.channels, self.tuned.scales, strict=True)}

    @property
    def weights(self) -> dict[str, float]:
        """Weights of the channels that add something."""
        pairs = zip(self.tuned.channels, self.tuned.weights, strict=True)
        return {name: _rounded(weight) for name, weight in pairs if weight > 0}

    @property
    def gain(self) -> str:
        """The gain over the default in a sentence, in nats per picture."""
        scores = self.scored or self.fitted
        held_out = "that were not fitted on" if self.scored else "fitted on"
        times = f"{math.exp(scores.gained):.2g} times as likely"
        gained = f"gained over the default {scores.gained:+.3f} nats a picture ({times})"
        return f"{gained}, on {scores.pictures} pictures {held_out}"

    def to_toml(self) -> str:
        """Return what was fitted as a configuration file."""
        source = ", ".join(self.fitted_on) or "its own references, each left out in turn"
        comment = f"library {self.library}, fitted on {source}: {self.gain}"
        used = self.weights
        values: dict[str, Any] = {
            "weights": used,
            "distances": {name: self.distances[name] for name in used},
            "scales": {name: self.scales[name] for name in used},
            "blend": "calibrated",
            "likelihood": "exponential",
            "sharpness": 1.0,
        }
        lines = [f"{key} = {toml_value(value)}" for key, value in values.items()]
        return "\n".join([f"# {' '.join(comment.split())}", "[sensor]", *lines]) + "\n"

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON; log scores in nats per picture."""
        return {
            "library": self.library,
            "fitted_on": list(self.fitted_on),
            "scored_on": list(self.scored_on),
            "distances": {name: self.distances[name] for name in self.tuned.channels},
            "scales": self.scales,
            "weights": self.weights,
            "fitted": self._scores_json(self.fitted),
            "scored": None if self.scored is None else self._scores_json(self.scored),
        }

    def _scores_json(self, scores: fitting.Scores) -> dict[str, Any]:
        return {
            "pictures": scores.pictures,
            "alone": dict(zip(self.tuned.channels, scores.alone, strict=True)),
            "tuned": scores.together,
            "default": scores.before,
            "blind": scores.blind,
            "gained": scores.gained,
        }


def tune(
    library: str | Path,
    *,
    sessions: Sequence[str | Path] = (),
    score: Sequence[str | Path] = (),
    channels: Sequence[str] | None = None,
    to: str | Path | None = None,
    reading: Reading | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> TuningResult:
    """Fit the scale and weight of each channel to a library and its robot, by log score.

    Fitted on `sessions`, drives with truth, or without any on the library itself, one reference left out at a
    time; scored on the drives `score`, none of which may be fitted on. `channels` are by default all that the
    library has. `to` writes a configuration file (.toml). `reading` says how the drives are read.

    Raises OptionError for an unknown channel, and InputError for drives without truth, drives that are both
    fitted and scored on, and a file that exists (unless `force`).

        >>> import maurice_viz as mv
        >>> result = mv.tune("survey.log", sessions=["session.log"], channels=["color", "tiny"])
        >>> result.fitted.pictures
        14
    """
    fit, test = ([session_in(Path(path)) for path in paths] for paths in (sessions, score))
    if to is not None:
        writing.expect_absent(Path(to), force=force)
    fitted = {hash_file(path): path for path in fit}
    for path in test:
        same = fitted.get(hash_file(path))
        if same is not None:
            which = "is fitted on" if path == same else f"is the same drive as {same}, which is fitted on"
            raise InputError(path, f"{which}, and would flatter the result; score another drive")
    path = Path(library)
    opened = library_at(path, listener)
    for text in say_default(opened, fitted=False):
        listener.warning(text)
    tuning = _Tuning(path, opened, _wanted(path, opened, channels), reading or Reading(), listener)
    result = _tuned(tuning, fit, test)
    if not test:
        where = "the drives fitted on" if fit else "the library itself"
        listener.warning(f"scored on {where}, which flatters; --drive names one that was not fitted on")
    if to is not None:
        writing.write_whole(Path(to), result.to_toml().encode(), force=force)
    return result


@dataclass(frozen=True, eq=False)
class _Tuning:
    """A library with the channels to tune."""

    path: Path
    library: Library
    channels: tuple[str, ...]
    reading: Reading
    listener: Listener

    @property
    def rows(self) -> tuple[str, ...]:
        """The channels that are measured: those to be tuned first, then what else the default needs."""
        return tuple(dict.fromkeys([*self.channels, *self.before]))

    @property
    def before(self) -> dict[str, float]:
        """What a unit of distance costs in the default blend, as far as the library has its channels."""
        channels = [name for name in DEFAULT_SENSOR.weights if name in self.library.index]
        return {name: DEFAULT_SENSOR.weights[name] / DEFAULT_SENSOR.scale_of(name) for name in channels}

    @cached_property
    def sensor(self) -> SensorModel:
        """How pictures are compared."""
        nearest = nearest_reference(self.library.poses, self.library.arena)
        return SensorModel(self.library, nearest, SensorParameters(dict.fromkeys(self.rows, 1.0)))


def _wanted(path: Path, library: Library, channels: Sequence[str] | None) -> tuple[str, ...]:
    known = [name for name in library.index if name in CHANNELS]
    if channels is None:
        return tuple(known)
    names = tuple(dict.fromkeys(name.strip() for name in channels if name.strip()))
    for name in names:
        if name not in CHANNELS:
            raise OptionError(f"no channel called {name!r}; {expected_one_of(name, CHANNELS)}")
        if name not in known:
            raise InputError(path, f"holds {', '.join(known)}, and {name} is wanted; build the library again")
    if not names:
        raise OptionError("--channels names no channel")
    return names


def _tuned(tuning: _Tuning, fit: Sequence[Path], test: Sequence[Path]) -> TuningResult:
    samples = _fitting(tuning, fit)
    rows = fitting.rows_of(samples, range(len(tuning.channels)))
    tuned = fit_channels(tuning.channels, rows, progress_of(tuning.listener, "fit"))
    before = np.array([tuning.before.get(name, 0.0) for name in tuning.rows])
    fitted = fitting.judge(tuned, samples, before)
    del samples  # the drives to score on are measured one at a time
    scored = [fitting.judge(tuned, _drive(tuning, path), before) for path in test]
    return TuningResult(
        tuned=tuned,
        distances=tuning.sensor.distances,
        library=tuning.library.name,
        fitted_on=tuple(path.name for path in fit),
        fitted=fitted,
        scored_on=tuple(path.name for path in test),
        scored=fitting.pooled(scored) if scored else None,
    )


def _fitting(tuning: _Tuning, fit: Sequence[Path]) -> list[fitting.Sample]:
    if fit:
        return [sample for path in fit for sample in _drive(tuning, path, len(fit))]
    advance = progress_of(tuning.listener, "compare references")
    samples = fitting.library_samples(LeftOutTable.of(tuning.sensor), advance)
    if not samples:
        none = "found no two references near each other that look one way; fit on a drive"
        raise InputError(tuning.path, none)
    return samples


def _drive(tuning: _Tuning, path: Path, among: int = 1) -> list[fitting.Sample]:
    """Measure a drive; of a long one, or where it is one among many, evenly chosen pictures."""
    listener, sensor = tuning.listener, tuning.sensor
    log = open_session(path, tuning.reading, listener)
    numbers = fitting.spread_out(log.overview()[0], max(1, fitting.most_pictures(sensor) // among))
    advance, known = progress_of(listener, path.name), known_descriptors()
    samples = fitting.drive_samples(sensor, log.moments(), numbers, advance, known)
    remark_skipped(log, listener)
    if not samples:
        raise InputError(path, "found no picture with a true pose in the library's free space to tune with")
    return samples


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")  # more digits would be noise
