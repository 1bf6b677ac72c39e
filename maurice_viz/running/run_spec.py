"""A run as it is asked for: by preset, feature, settings and files; its configuration and its name."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.amcl import AmclParameters, read_amcl
from maurice_loaders.bags.containers import looks_like_bag
from maurice_loaders.config_files import configuration_of, motion_file
from maurice_loaders.errors import InputError
from maurice_loaders.files.ros_maps import ENDINGS
from maurice_loaders.reading.observations import SCAN_GATE, Gate
from maurice_loaders.reading.options import ReadingOptions
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.config.parameters import PRESETS, Configuration
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES, weights_of
from maurice_mcl.values import F64, expected_one_of

from ..errors import Listener, OptionError, once

COMMAND_LINE = "command line"  # the origin of settings in error messages


AnySource = str | Path | RecordedSession
Start = str | tuple[float, ...] | None  # words, or a pose in meters and radians


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run as it is asked for; what is None is as the configuration or the session has it."""

    preset: str | None = None
    feature: str | None = None
    particles: int | None = None
    seed: int = 0
    start: Start = None  # see `start_pose`
    config: Path | None = None  # a configuration file, over the preset
    settings: Mapping[str, Any] = field(default_factory=dict)  # by key of the configuration, over all others
    robot: tuple[str, ...] = ()  # the recording's topics and frames, which choose among AMCLs' parameters
    name: str = ""  # of the run; empty: after preset and feature, or its configuration file

    @classmethod
    def of(
        cls,
        preset: str | None,
        feature: str | None,
        particles: int | None,
        seed: int,
        start: str | F64 | None,
        config: str | Path | None,
        settings: Mapping[str, Any] | None,
        sensors: Sequence[str],
    ) -> RunSpec:
        """Return a run from arguments as the public functions have them."""
        file = None if config is None else Path(config)
        place = start_of(start)
        return cls(preset, feature, particles, seed, place, file, settings_with(settings, sensors))

    @property
    def label(self) -> str:
        """The run's name, after what distinguishes it."""
        parts = [part for part in (self.preset, self.feature) if part]
        return self.name or "-".join(parts) or (self.config.stem if self.config else "blended")

    @property
    def amcl(self) -> AmclParameters | None:
        """What AMCL's parameters say beyond the configuration; None without such a file. InputError."""
        is_amcl = self.config is not None and self.config.suffix.lower() in ENDINGS
        return read_amcl(self.config, self.robot) if is_amcl and self.config is not None else None

    def configuration(self) -> Configuration:
        """Return the effective values: default, preset, file, environment, then what is given here.

        InputError for a bad file or environment, OptionError for a setting that is not known or out of range.
        """
        check_name(self.preset, PRESETS, "preset")
        check_name(self.feature, [*FEATURES, *CHANNELS], "feature")
        given = combined(self.settings, self.feature, self.particles)
        try:
            return configuration_of(self.preset, self.config, os.environ, given, self.robot)
        except InputError as problem:
            if str(problem.file) == COMMAND_LINE:
                raise OptionError(problem.message) from None
            raise


def start_of(start: str | F64 | None) -> Start:
    """Return a start that can be compared: a pose as three numbers."""
    return start if start is None or isinstance(start, str) else tuple(np.asarray(start, float).tolist())


def settings_with(settings: Mapping[str, Any] | None, sensors: Sequence[str]) -> dict[str, Any]:
    """Return the settings of a run, with the sensors of other packages that it uses."""
    return dict(settings or {}) | ({"sensor.outside": ",".join(sensors)} if sensors else {})


OPTIONS_BY_KEY = {"sensor.weights": "--feature", "particles": "--particles"}  # by key of --set


def combined(
    settings: Mapping[str, Any], feature: str | None = None, particles: int | None = None
) -> dict[str, Any]:
    """Return settings by their keys, with those that have options of their own.

    The names are checked already. OptionError for what both give.
    """
    weights = None if feature is None else weights_of(feature)
    by_key = dict(zip(OPTIONS_BY_KEY, (weights, particles), strict=True))
    given = {key: value for key, value in by_key.items() if value is not None}
    for key in settings:
        for twin in given:
            if key == twin or key.startswith(f"{twin}."):
                raise OptionError(
                    f"{key} is given twice, by {OPTIONS_BY_KEY[twin]} and by --set; give it once"
                )
    return given | dict(settings)


def words_of(specs: Sequence[RunSpec]) -> list[str]:
    """Return what distinguishes runs, to name a recording after; the default run has no words."""
    if len(specs) > 1:
        return [spec.label for spec in specs]
    (spec,) = specs
    numbers = {"particles": spec.particles, "seed": spec.seed or None}
    start = "start" if isinstance(spec.start, tuple) else spec.start
    files = [None if file is None else file.stem for file in (spec.config, motion_file(spec.settings))]
    words = [spec.name or None, spec.preset, spec.feature, *files, start]
    words += [f"{name} {value}" for name, value in numbers.items() if value is not None]
    words += [f"{key} {value}" for key, value in spec.settings.items() if key != "motion"]
    return [word for word in words if word]


def check_name(name: str | None, known: Iterable[str], what: str) -> None:
    """Refuse a name that is not among the known ones. OptionError."""
    names = list(dict.fromkeys(known))
    if name is not None and name not in names:
        raise OptionError(f"no {what} called {name!r}; {expected_one_of(name, names)}")


def read_as_amcl(
    source: AnySource, reading: ReadingOptions, specs: Sequence[RunSpec], listener: Listener
) -> tuple[ReadingOptions, list[RunSpec]]:
    """Use scans after the way and turn that AMCL's parameters name, unless the reading options do.

    All runs of one session share its moments: the first file of AMCL's decides. Remarks what means nothing
    here, and which runs use other scans than they would alone. Of a file for several robots those of the
    recording's robot count. InputError.
    """
    remark = once(listener.remark)
    if any(spec.amcl is not None for spec in specs):
        names = _names_read(source, reading)
        specs = [replace(spec, robot=names) for spec in specs]
    files = [spec.amcl for spec in specs]
    for spec, amcl in zip(specs, files, strict=True):
        for text in () if amcl is None else amcl.remarks:
            remark(f"{spec.config}: {text}")
    first = next(filter(None, files), None)
    if first is None or (reading.min_distance_m, reading.min_angle_rad) != (None, None):
        return reading, list(specs)
    gates = [SCAN_GATE if amcl is None else Gate(amcl.min_distance_m, amcl.min_angle_rad) for amcl in files]
    way_m, turn_rad = first.min_distance_m, first.min_angle_rad
    others = [spec.label for spec, gate in zip(specs, gates, strict=True) if gate != Gate(way_m, turn_rad)]
    if others:
        shared = (
            f"all runs use a scan after {way_m:g} m or {turn_rad:g} rad, as the first file of AMCL's says"
        )
        remark(f"{shared}; alone {' and '.join(others)} would use other scans")
    return replace(reading, min_distance_m=way_m, min_angle_rad=turn_rad), list(specs)


def _names_read(source: AnySource, reading: ReadingOptions) -> tuple[str, ...]:
    """Return topics and frames of a bag that is read, or those that are asked for of what is no bag."""
    path = source.path if isinstance(source, RecordedSession) else Path(source)
    if looks_like_bag(path):
        from maurice_loaders.bags.recording import names_read

        return names_read(path, reading)
    return tuple(filter(None, (reading.scan_topic, reading.image_topic, reading.odometry_topic)))
