"""Pose sensors of other people: objects, or loaded by the name of an entry point, or by `module:Class`.

A package provides one by an entry point in the group "maurice_replay.sensors" (docs/sensors.md).
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points, packages_distributions, version
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..values.arrays import F32, F64
from ..values.library import Library
from ..values.own_parts import called, made, name_of, own_part
from ..values.pose_sensor import EXACT, POSE_SENSORS, PoseProposal, PoseSensor, PoseSpread, Shown
from ..values.session import Frame
from ..values.setting_rules import texts
from .descriptors.registry import CHANNELS, NAME

GROUP = "maurice_replay.sensors"
NOT_THERE = "not there"  # as a version
METHODS = ("read", "log_likelihood", "propose", "shown")  # of `PoseSensor`


class OutsideSensor:
    """A sensor of another package: what it raises or gives wrongly is an InputError of one line."""

    def __init__(self, spelled: str, sensor: PoseSensor) -> None:
        """Take the sensor, and how it was asked for: the name of an entry point, or `module:Class`."""
        self.spelled = spelled
        self.name = sensor.name
        self._sensor = sensor
        self.file = _file_of(type(sensor))  # that is run, "" where it is not known

    def __getattr__(self, name: str) -> Any:
        """Return what a sensor may leave out: `pictures`, `in_space`, `proposes`, `summary`, `shown_with`."""
        if name.startswith("_"):  # asked for while it is copied or unpickled
            raise AttributeError(name)
        value = getattr(self._sensor, name)
        return (lambda *given: self._call(name, *given)) if callable(value) else value

    def read(self, frame: Frame) -> Any | None:
        """Return what a frame holds for the sensor."""
        return self._call("read", frame)

    def log_likelihood(self, reading: Any, poses: F32, origin: F64, spread: PoseSpread = EXACT) -> F32:
        """Return nats (N,) for poses (N, 3). InputError for another shape, or numbers that are not finite."""
        nats = np.asarray(self._call("log_likelihood", reading, poses, origin, spread))
        if nats.shape != (len(poses),) or nats.dtype.kind != "f" or not np.isfinite(nats).all():
            what = f"{nats.dtype} {nats.shape}" if nats.shape != (len(poses),) else "no finite numbers"
            expected = f"finite numbers ({len(poses)},), one per pose"
            raise InputError(None, f"sensor {self.spelled}: log_likelihood gave {what}, expected {expected}")
        return nats.astype(np.float32, copy=False)

    def propose(self, reading: Any) -> PoseProposal | None:
        """Return where this reading alone would put the robot."""
        proposal: PoseProposal | None = self._call("propose", reading)
        return proposal

    def shown(self, reading: Any, poses: Mapping[str, F64]) -> Shown:
        """Return what to show of a reading. InputError for anything but a `Shown`."""
        shown = self._call("shown", reading, poses)
        if not isinstance(shown, Shown):
            gave = f"shown gave {type(shown).__name__}, expected a maurice_mcl.Shown"
            raise InputError(None, f"sensor {self.spelled}: {gave}")
        return shown

    def _call(self, method: str, *given: Any) -> Any:
        return called(f"sensor {self.spelled}: {method}", getattr(self._sensor, method), *given)


def sensor_names(key: str, value: Any) -> tuple[str, ...]:
    """Take a list of sensors: names, or objects, which get one; as text: "beacon,my_module:Sonar"."""
    parts = value if isinstance(value, (list, tuple)) else texts(key, value)
    return texts(key, [part if isinstance(part, str) else name_of(part) for part in parts])


def load_sensor(spelled: str) -> OutsideSensor:
    """Return the sensor of an entry point's name, of `module:Class`, or an object that a setting was given.

    A class is made without arguments; all runs of a process share it. InputError where nothing of that name
    is at hand, and for what is no `PoseSensor`.
    """
    return _loaded(spelled, spelled) if "@" in spelled else _installed(spelled)


@lru_cache
def _installed(spelled: str) -> OutsideSensor:
    point = _point(spelled)
    if point is None:
        names = ", ".join(sorted({point.name for point in entry_points(group=GROUP)})) or "none"
        advice = f"install its package (sensors installed: {names}), or name a class as module:Class"
        raise InputError(None, f"sensor {spelled!r}: no installed package has it; {advice}")
    return _loaded(spelled, f"{point.module}:{point.attr}")


def _loaded(spelled: str, path: str) -> OutsideSensor:
    """Return the sensor of a path `module:Class`, with or without a hash. InputError if it is no sensor."""
    try:
        sensor = made("sensor", own_part("sensor", path))
    except ValueError as problem:
        raise InputError(None, str(problem)) from None
    missing = [name for name in METHODS if not callable(getattr(sensor, name, None))]
    if missing:
        what = f"the class {type(sensor).__name__} has no {missing[0]}"
        raise InputError(None, f"sensor {spelled}: {what}; a sensor has {', '.join(('name', *METHODS))}")
    name = getattr(sensor, "name", None)
    if not isinstance(name, str) or not NAME.fullmatch(name) or name in (*CHANNELS, *POSE_SENSORS):
        expected = "expected a lower-case word like beacon that names no channel and no sensor of ours"
        raise InputError(None, f"sensor {spelled}: its name is {name!r}, {expected}")
    return OutsideSensor(spelled, sensor)


def with_sensors(library: Library, spelled: Sequence[str]) -> Library:
    """Return a library whose sensors include those of other packages. InputError as of `load_sensor`."""
    if not spelled:
        return library
    sensors = {sensor.name: sensor for sensor in map(load_sensor, spelled)}
    return replace(library, sensors={**library.sensors, **sensors})


def package_of(spelled: str) -> tuple[str, str]:
    """Return the name and the version of a sensor's package.

    For a module of no package these are `spelled` and the start of the hash of its file; the version of what
    is gone is NOT_THERE.
    """
    written, _, digest = spelled.partition("@")
    if digest:
        return written, f"source {digest}"
    point = _point(spelled)
    if point is None:
        return spelled, NOT_THERE
    if point.dist is not None:
        return point.dist.name, point.dist.version
    for package in packages_distributions().get(point.module.split(".")[0], ()):
        return package, version(package)
    try:
        file = inspect.getsourcefile(import_module(point.module))
        return spelled, "file " + sha256(Path(file or "").read_bytes()).hexdigest()[:12]
    except Exception:  # of a module that is gone or broken, or one that was typed
        return spelled, NOT_THERE


def _point(spelled: str) -> EntryPoint | None:
    module, colon, name = spelled.partition(":")
    if colon:
        valid = all(part.isidentifier() for part in (*module.split("."), name))
        return EntryPoint(spelled, spelled, GROUP) if valid else None
    return next(iter(entry_points(group=GROUP, name=spelled)), None)


def _file_of(kind: type) -> str:
    try:
        return inspect.getsourcefile(kind) or ""
    except (OSError, TypeError):  # typed into an interpreter, or compiled
        return ""
