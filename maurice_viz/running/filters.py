"""A filter as it is asked for, as a value: by preset, feature, settings, files and the user's own parts."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.amcl import AmclParameters, read_amcl
from maurice_loaders.bags.containers import looks_like_bag
from maurice_loaders.config_files import configuration_of, motion_file
from maurice_loaders.errors import InputError
from maurice_loaders.files.ros_maps import ENDINGS
from maurice_loaders.reading.observations import SCAN_GATE, Gate
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.config.parameters import PRESETS, RULES, Configuration
from maurice_mcl.sensor.descriptors.network import file_of, is_network
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES, weights_of
from maurice_mcl.values import F64, Session, expected_one_of

from ..errors import Listener, OptionError, once

MOST_SEED = 2**32 - 1
COMMAND_LINE = "command line"  # the origin of settings in error messages


AnySource = str | Path | RecordedSession | Session


@dataclass(frozen=True, slots=True)
class Filter:
    """One filter as it is asked for; what is None is as the configuration or the session has it.

    Wherever a filter is asked for, the name of a preset or feature stands for one. Later choices win over
    earlier ones: preset, `config`, environment, `settings`, then all others. OptionError for unknown names.

        >>> import maurice_viz as mv
        >>> robust = mv.Filter("robust", particles=500)
        >>> robust.set(sharpness=2)
        Filter('robust', particles=500, settings={'sensor.sharpness': 2})
        >>> mv.replay("session.log", filter=robust).runs[0].label
        'robust'
    """

    preset: str | None = None  # a key of PRESETS; the name of a feature is taken as `feature`
    feature: str | None = None  # a key of FEATURES, one channel, or a network, onnx:FILE.onnx
    particles: int | None = None  # 2000, unless the configuration says otherwise
    seed: int = 0  # of all randomness: the same seed gives the same run
    start: Any = None  # "tracking", "truth", "global", "X,Y,HEADING", or a pose (3,) in meters and radians
    config: str | Path | None = None  # a configuration file, or AMCL's parameters as YAML
    settings: Mapping[str, Any] = field(default_factory=dict)  # by key of docs/configuration.md
    sensors: Sequence[Any] = ()  # pose sensors beside the library's: objects, or names, "module:Class"
    channels: Sequence[Any] = ()  # picture channels of your own: objects with `name` and `describe(image)`
    resampler: Any = None  # a name, or a function (weights (N,), n, rng) -> parents (n,)
    recovery: Any = None  # a name, or a function (evidence in nats, RecoveryState) -> Recovery
    motion: Any = None  # a table or file of motion parameters, or an object with `move(poses, motion, noise)`
    name: str = ""  # of the run; empty: after preset and feature, or its configuration file
    robot: tuple[str, ...] = field(default=(), repr=False)  # topics and frames, which choose among AMCLs

    def __post_init__(self) -> None:
        features = (*FEATURES, *CHANNELS)
        is_feature = (self.preset in features and self.preset not in PRESETS) or is_network(self.preset)
        if is_feature and self.feature is None:
            self._become(preset=None, feature=self.preset)
        check_name(self.preset, PRESETS, "preset")
        if not is_network(self.feature):
            check_name(self.feature, features, "feature")
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or not 0 <= self.seed <= MOST_SEED:
            raise OptionError(f"seed: found {self.seed!r}, expected a whole number from 0 to {MOST_SEED}")
        file = None if self.config is None else Path(self.config)
        self._become(
            config=file,
            start=_comparable(self.start),
            sensors=tuple(self.sensors),
            channels=tuple(self.channels),
        )

    def _become(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Return what was asked for."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.repr}
        settings = {name: value for name, value in values.items() if value not in (None, (), {}, "", 0)}
        words = [repr(settings.pop("preset"))] if self.preset else []
        parts = {
            "sensors": self.sensors,
            "channels": self.channels,
            "resampler": self.resampler,
            "recovery": self.recovery,
        }
        parts |= {"motion": None if isinstance(self.motion, Mapping) else self.motion}
        texts = {name: word_of(value) if parts.get(name) else repr(value) for name, value in settings.items()}
        return f"Filter({', '.join([*words, *(f'{name}={value}' for name, value in texts.items())])})"

    def set(self, **changes: Any) -> Filter:
        """Return the filter with some of it changed: fields, or settings by the last word of their key.

        A setting whose last word several have is given by `settings`. OptionError for an unknown word.
        """
        own = {f.name for f in fields(self)}
        settings = dict(changes.pop("settings", self.settings))
        settings |= {key_of(word): value for word, value in changes.items() if word not in own}
        arguments = {word: value for word, value in changes.items() if word in own}
        return replace(self, settings=settings, **arguments)

    @property
    def label(self) -> str:
        """The run's name, after what distinguishes it."""
        parts = [word_of(part) for part in (self.preset, self.feature) if part]
        parts = parts or ([] if self.config else list(map(word_of, self.channels)))
        return self.name or "-".join(parts) or (Path(self.config).stem if self.config else "blended")

    @property
    def amcl(self) -> AmclParameters | None:
        """What AMCL's parameters say beyond the configuration; None without such a file. InputError."""
        if self.config is None or Path(self.config).suffix.lower() not in ENDINGS:
            return None
        return read_amcl(Path(self.config), self.robot)

    @property
    def changes(self) -> dict[str, Any]:
        """All settings by key that are chosen here, over preset and file. OptionError for one given twice."""
        weights = None if self.feature is None else weights_of(self.feature)
        chosen = {"sensor.weights": weights, "particles": self.particles} | self.parts
        chosen = {key: value for key, value in chosen.items() if value is not None}
        for key in self.settings:
            for twin in chosen:
                if key == twin or key.startswith(f"{twin}."):
                    ways = f"by {FIELDS_BY_KEY[twin]} and by --set"
                    raise OptionError(f"{key} is given twice, {ways}; give it once")
        return chosen | dict(self.settings)

    @property
    def parts(self) -> dict[str, Any]:
        """The settings by key that name parts of the filter."""
        network = (self.feature,) if is_network(self.feature) else ()
        values = {
            "sensor.outside": self.sensors or None,
            "sensor.channels": (*network, *self.channels) or None,
            "resampling.scheme": self.resampler,
            "recovery.strategy": self.recovery,
            "motion": self.motion,
        }
        return {key: value for key, value in values.items() if value is not None}

    def configuration(self) -> Configuration:
        """Return the effective values: default, preset, file, environment, then what is given here.

        InputError for a bad file or environment, OptionError for a setting that is not known or out of range.
        """
        file = None if self.config is None else Path(self.config)
        try:
            return configuration_of(self.preset, file, os.environ, self.changes, self.robot)
        except InputError as problem:
            if str(problem.file) == COMMAND_LINE:
                raise OptionError(problem.message) from None
            raise


# the options, by the key of --set that says the same
FIELDS_BY_KEY = {
    "sensor.weights": "--feature",
    "particles": "--particles",
    "sensor.outside": "--sensor",
    "sensor.channels": "channels=",
    "resampling.scheme": "resampler=",
    "recovery.strategy": "recovery=",
    "motion": "motion=",
}
AnyFilter = Filter | str | None


def filter_of(given: AnyFilter) -> Filter:
    """Return a filter, or that of the name of a preset or feature; None: the default one. OptionError."""
    if isinstance(given, Filter):
        return given
    if given is None:
        return Filter()
    if not isinstance(given, str):
        raise OptionError(
            f"found the filter {given!r:.60}, expected a Filter, or the name of a preset or feature"
        )
    if not is_network(given):
        check_name(given, [*PRESETS, *FEATURES, *CHANNELS], "preset or feature")
    return Filter(given)


def key_of(word: str) -> str:
    """Return the key of the configuration whose last word this is. OptionError for none, and for several."""
    keys = [key for key in RULES if word in (key, key.rpartition(".")[2])]
    if len(keys) > 1:
        raise OptionError(f"{word} may be {' or '.join(keys)}; give it by its key in `settings`")
    if not keys:
        words = dict.fromkeys([f.name for f in fields(Filter)] + [key.rpartition(".")[2] for key in RULES])
        raise OptionError(f"a filter has no {word!r}; {expected_one_of(word, words)}")
    return keys[0]


def _comparable(start: str | Sequence[float] | F64 | None) -> str | tuple[float, ...] | None:
    """Return a start that can be compared: a pose as three numbers. OptionError for another shape."""
    if start is None or isinstance(start, str):
        return start
    try:
        pose = np.asarray(start, float)
    except (TypeError, ValueError):
        pose = np.empty(0)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        expected = "expected tracking, truth, global, X,Y,HEADING, or a pose of three numbers"
        raise OptionError(f"start: found {start!r:.60}, {expected}")
    return tuple(pose.tolist())


def words_of(specs: Sequence[Filter]) -> list[str]:
    """Return what distinguishes runs, to name a recording after; the default run has no words."""
    if len(specs) > 1:
        return [spec.label for spec in specs]
    (spec,) = specs
    numbers = {"particles": spec.particles, "seed": spec.seed or None}
    start = "start" if isinstance(spec.start, tuple) else spec.start
    files = [None if file is None else Path(file).stem for file in (spec.config, motion_file(spec.changes))]
    feature = spec.feature and word_of(spec.feature)
    words = [spec.name or None, spec.preset, feature, *files, start]
    words += [f"{name} {value}" for name, value in numbers.items() if value is not None]
    words += [f"{key} {word_of(value)}" for key, value in spec.settings.items() if key != "motion"]
    words += [
        word_of(part)
        for part in (*spec.sensors, *spec.channels, spec.resampler, spec.recovery)
        if part is not None
    ]
    return [word for word in words if word]


def word_of(value: Any) -> str:
    """Return a value as a run's name may hold it: of a file its stem, of the user's part its name."""
    if isinstance(value, (list, tuple)):
        return " ".join(map(word_of, value))
    if is_network(value):
        return file_of(value).stem
    if isinstance(value, (str, Path)):
        return Path(value).stem if Path(value).suffix == ".toml" else str(value)
    own = value if inspect.isroutine(value) or isinstance(value, type) else type(value)
    return own.__name__ if own.__module__ != "builtins" else str(value)


KINDS = (
    "preset",
    "feature",
    "config",
    "particles",
    "seed",
    "start",
)  # in what filters differ, beside settings


def told_apart(filters: Sequence[Filter]) -> list[Filter]:
    """Return filters named by what tells them apart: by as few kinds of choices as are needed for that."""
    values = {kind: [getattr(chosen, kind) for chosen in filters] for kind in KINDS}
    changes = [chosen.changes for chosen in filters]
    keys = dict.fromkeys(key for own in changes for key in own if key not in ("sensor.weights", "particles"))
    values |= {key: [own.get(key) for own in changes] for key in keys}
    words: list[list[str]] = [[] for _ in filters]
    for kind, different in values.items():
        if any(value != different[0] for value in different):
            for name, word in zip(words, _words_of(kind, different, filters), strict=True):
                name.append("" if word in name else word)
        if len(set(map(tuple, words))) == len(filters):
            break
    names = [" ".join(filter(None, name)) for name in words]
    return [
        chosen if chosen.name or not name else replace(chosen, name=name)
        for chosen, name in zip(filters, names, strict=True)
    ]


def _words_of(kind: str, values: Sequence[Any], filters: Sequence[Filter]) -> list[str]:
    """Return a word for each value of one kind of choice."""
    if kind in ("preset", "feature"):
        return [word_of(value or chosen.label) for value, chosen in zip(values, filters, strict=True)]
    if kind == "config" and all(values):
        return names_of([Path(value).with_suffix("") for value in values])
    if kind in ("config", "particles", "seed"):
        words = [f"{kind} {word_of(value)}" for value in values]
    elif kind == "start":
        words = [value if isinstance(value, str) else f"start {n}" for n, value in enumerate(values, 1)]
    else:
        name = kind.rpartition(".")[2]
        words = [f"{name} {value}" if isinstance(value, (int, float)) else word_of(value) for value in values]
    return ["" if value is None else word for value, word in zip(values, words, strict=True)]


def names_of(paths: Sequence[Path]) -> list[str]:
    """Name paths by the last part in which they differ, and as many before it as distinguish them.

    `a/session` and `b/session` are "a" and "b". What cannot be distinguished (the same path twice) keeps one
    name; `unique_labels` numbers those.
    """
    whole = [path.absolute().parts[1:] for path in paths]
    different = len(set(whole))
    typed = [tuple(part for part in path.parts if part not in (path.anchor, "..")) for path in paths]
    parts = typed if all(typed) and len(set(typed)) == different else whole
    while different > 1 and min(map(len, parts)) > 1 and len({path[-1] for path in parts}) == 1:
        parts = [path[:-1] for path in parts]
    depths = range(1, max(map(len, parts)) + 1)
    named = ([" ".join(path[-depth:]) for path in parts] for depth in depths)
    return next(names for names in named if len(set(names)) == different)


def check_name(name: str | None, known: Iterable[str], what: str) -> None:
    """Refuse a name that is not among the known ones. OptionError."""
    names = list(dict.fromkeys(known))
    if name is not None and name not in names:
        raise OptionError(f"no {what} called {name!r}; {expected_one_of(name, names)}")


def read_as_amcl(
    source: str | Path | RecordedSession, reading: Reading, specs: Sequence[Filter], listener: Listener
) -> tuple[Reading, list[Filter]]:
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


def _names_read(source: str | Path | RecordedSession, reading: Reading) -> tuple[str, ...]:
    """Return topics and frames of a bag that is read, or those that are asked for of what is no bag."""
    path = source.path if isinstance(source, RecordedSession) else Path(source)
    if looks_like_bag(path):
        from maurice_loaders.bags.recording import names_read

        return names_read(path, reading)
    return tuple(filter(None, (reading.scan_topic, reading.image_topic, reading.odometry_topic)))
