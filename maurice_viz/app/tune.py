"""Tuning channels to a library and its robot: the scale and weight of each, fitted by log score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_loaders.io.toml import toml_value
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.libraries.store import open_library
from maurice_mcl.calibration.tuning import (
    Measuring,
    Sample,
    Scores,
    Tuned,
    drive_samples,
    judge,
    library_samples,
    pooled,
    rows_of,
    spread_out,
)
from maurice_mcl.calibration.tuning import tune as fit_channels
from maurice_mcl.library import Library
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.sensor.references import nearest_reference

from ..errors import OptionError
from .listener import SILENT, Listener, progress_of
from .open import open_session

BEFORE = SensorParameters(FEATURES["blended"])  # the default, which the result is compared with
DIGITS = 4  # of scales and weights; more would be noise


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Scales and weights of channels, the drives that they were fitted and scored on, and the scores."""

    tuned: Tuned
    distances: Mapping[str, str]
    library: str
    fitted_on: tuple[str, ...]  # sessions; none: the library, one reference left out at a time
    fitted: Scores
    scored_on: tuple[str, ...]
    scored: Scores | None

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
        gained = f"gained over the default {scores.gained:+.3f} nats a picture"
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

    def _scores_json(self, scores: Scores) -> dict[str, Any]:
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
    keep_going: bool = False,
    force: bool = False,
    listener: Listener = SILENT,
) -> TuningResult:
    """Fit the scale and weight of each channel to a library and its robot, by log score.

    Fitted on `sessions`, drives with truth, or without any on the library itself, one reference left out at a
    time; scored on the drives `score`, none of which may be fitted on. `channels` are by default all that the
    library has. `to` writes a configuration file (.toml). `keep_going` skips broken records of the drives.

    Raises OptionError for an unknown channel, and InputError for drives without truth, drives that are both
    fitted and scored on, and a file that exists (unless `force`).

        >>> result = mv.tune("survey.log", sessions=["session.log"], channels=["color", "tiny"])
        >>> result.fitted.pictures
        14
    """
    fit, test = [Path(path) for path in sessions], [Path(path) for path in score]
    if to is not None:
        expect_absent(Path(to), force=force)
    _refuse_fitted(fit, test)
    path = Path(library)
    opened = open_library(path, progress=progress_of(listener, "library"), warn=listener.warning)
    tuning = _Tuning(path, opened, _wanted(path, opened, channels), keep_going, listener)
    result = _tuned(tuning, fit, test)
    if not test:
        where = "the drives fitted on" if fit else "the library itself"
        listener.warning(f"scored on {where}, which flatters; --score a drive that was not fitted on")
    if to is not None:
        write_whole(Path(to), result.to_toml().encode(), force=force)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _Tuning:
    """A library with the channels to tune."""

    path: Path
    library: Library
    channels: tuple[str, ...]
    keep_going: bool
    listener: Listener

    @property
    def rows(self) -> tuple[str, ...]:
        """The channels that are measured: those to be tuned first, then what else the default needs."""
        return tuple(dict.fromkeys([*self.channels, *self.before]))

    @property
    def before(self) -> dict[str, float]:
        """What a unit of distance costs in the default blend, as far as the library has its channels."""
        there = [name for name in BEFORE.weights if name in self.library.index]
        return {name: BEFORE.weights[name] / BEFORE.scale_of(name) for name in there}

    @property
    def measuring(self) -> Measuring:
        """How pictures are compared."""
        return Measuring(self.library, {name: BEFORE.distance_of(name) for name in self.rows})


def _refuse_fitted(fit: Sequence[Path], test: Sequence[Path]) -> None:
    fitted = {hash_file(path): path for path in fit}
    for path in test:
        same = fitted.get(hash_file(path))
        if same is not None:
            which = "is fitted on" if path == same else f"is the same drive as {same}, which is fitted on"
            raise InputError(path, f"{which}, and would flatter the result; score another drive")


def _wanted(path: Path, library: Library, channels: Sequence[str] | None) -> tuple[str, ...]:
    there = [name for name in library.index if name in CHANNELS]
    if channels is None:
        return tuple(there)
    wanted = tuple(dict.fromkeys(name.strip() for name in channels if name.strip()))
    for name in wanted:
        if name not in CHANNELS:
            raise OptionError(f"no channel called {name!r}; there are {', '.join(CHANNELS)}")
        if name not in there:
            raise InputError(path, f"holds {', '.join(there)}, and {name} is wanted; build the library again")
    if not wanted:
        raise OptionError("--channels names no channel")
    return wanted


def _tuned(tuning: _Tuning, fit: Sequence[Path], test: Sequence[Path]) -> TuningResult:
    samples = _fitting(tuning, fit)
    rows = rows_of(samples, range(len(tuning.channels)))
    tuned = fit_channels(tuning.channels, rows, progress_of(tuning.listener, "fit"))
    before = np.array([tuning.before.get(name, 0.0) for name in tuning.rows])
    fitted = judge(tuned, samples, before)
    del samples  # the drives to score on are measured one at a time
    scored = [judge(tuned, _drive(tuning, path), before) for path in test]
    return TuningResult(
        tuned=tuned,
        distances=tuning.measuring.distances,
        library=tuning.library.name,
        fitted_on=tuple(path.name for path in fit),
        fitted=fitted,
        scored_on=tuple(path.name for path in test),
        scored=pooled(scored) if scored else None,
    )


def _fitting(tuning: _Tuning, fit: Sequence[Path]) -> list[Sample]:
    if fit:
        return [sample for path in fit for sample in _drive(tuning, path, len(fit))]
    advance = progress_of(tuning.listener, "compare references")
    found = library_samples(tuning.measuring, tuning.measuring.most_pictures(), advance)
    if not found:
        raise InputError(
            tuning.path, "found no two references near each other that look one way; fit on a --session"
        )
    return found


def _drive(tuning: _Tuning, path: Path, among: int = 1) -> list[Sample]:
    """Measure a drive; of a long one, or where it is one among many, evenly chosen pictures."""
    listener, measuring = tuning.listener, tuning.measuring
    log = open_session(path, keep_going=tuning.keep_going, listener=listener)
    pictures, _ = log.overview()
    taken = spread_out(pictures, max(1, measuring.most_pictures() // among))
    nearest = nearest_reference(tuning.library.poses, tuning.library.arena)
    found = drive_samples(measuring, nearest, log.moments(), taken, progress_of(listener, path.name))
    for warning in log.warnings:
        listener.warning(warning)
    if log.problem_count:
        listener.warning(f"{path}: skipped {log.problem_count} broken records, the first: {log.problems[0]}")
    if not found:
        raise InputError(path, "found no picture with a true pose in the library's free space to tune with")
    return found


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
