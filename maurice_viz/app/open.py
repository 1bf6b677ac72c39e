"""From what was asked for to a session, a library and runs."""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from maurice_loaders.config_files import configuration_of, read_motion, to_toml
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import NATIVE, chosen, open_recording
from maurice_loaders.formats.registry import open_session as open_any
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recorded_session import RecordedSession, first_truth
from maurice_loaders.session_log.reader import SessionLog
from maurice_loaders.transforms.made_odometry import MadeOdometry
from maurice_mcl.arrays import F64
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.schema import Configuration
from maurice_mcl.library import Library
from maurice_mcl.sensor.features import FEATURES
from maurice_mcl.sensor.references import NearestReference, nearest_reference
from maurice_mcl.session import Session, SessionInfo

from ..cli.console import TO_CONSOLE, note
from ..cli.options import RunOptions
from ..entities import RESERVED
from ..errors import OptionError
from ..playback import FilterRun
from ..style import Units, units_named
from .listener import Listener, progress_of

# A pose as it is typed: X,Y,HEADING in the session's display units and degrees.

FARTHEST_M = 1e9  # no map reaches further


def typed_pose(text: str, units: Units, wanted: str) -> F64:
    """Read a pose (3,) in meters and radians. Raises OptionError for anything else."""
    try:
        x, y, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        x = y = heading_deg = np.nan
    pose = np.array([x / units.per_m, y / units.per_m, np.deg2rad(heading_deg)])
    if not (np.abs(pose) <= FARTHEST_M).all():
        raise OptionError(f"{wanted} in {units.name} and degrees, found {text!r}")
    return pose


# `--start`: where the particles begin.


def start_pose(
    text: str | None, info: SessionInfo, log: Path, first_truth: Callable[[], F64 | None]
) -> F64 | None:
    """Read `--start`: a pose (3,) in the map's frame, or None for anywhere.

    InputError when tracking or the truth is asked for and there is no such pose; usage error for other words.
    """
    if text is None:
        return info.start
    if text == "global":
        return None
    if text == "tracking":
        if info.start is None:
            found = 'found no "start" pose in a header'
            raise InputError(log, f"{found}; give --start truth, X,Y,HEADING or global")
        return info.start
    if text == "truth":
        pose = first_truth()
        if pose is None:
            raise InputError(log, "found no truth to start from; give --start X,Y,HEADING or global")
        return pose
    return typed_pose(
        text, units_named(info.display_units), "--start is tracking, truth, global or X,Y,HEADING"
    )


# From what was typed to a session, a library and runs.

COMMANDS = (
    "calibrate",
    "compare",
    "config",
    "convert",
    "demo",
    "events",
    "explain",
    "export",
    "formats",
    "import",
    "inspect",
    "jump",
    "library",
    "doctor",
    "record",
    "replay",
    "report",
    "simulate",
    "snapshot",
    "survey",
    "verify",
)


NONE_YET = (
    "If you have none, make one from a drive with true poses: "
    "maurice-replay library build DRIVE -o LIBRARY --every 0.4m,45deg"
)
AnySession = SessionLog | RecordedSession


class Drive(Session, Protocol):
    """A session, recorded or live, that knows where it comes from."""

    @property
    def path(self) -> Path:
        """The file or folder, or what stands for it in messages."""
        ...


def open_session(
    path: Path,
    *,
    keep_going: bool,
    opening: ReadingOptions | None = None,
    listener: Listener = TO_CONSOLE,
) -> AnySession:
    """Open a session of any format; a word that is no file gets the nearest command's name."""
    if not path.exists():
        near = difflib.get_close_matches(str(path), COMMANDS, n=1)
        advice = f"did you mean the command {near[0]}?" if near else "maurice-replay --help lists commands"
        raise InputError(path, f"there is no session or command of that name; {advice}")
    options = replace(opening or ReadingOptions(), keep_going=keep_going)
    one = chosen(path, options)
    session = open_any(path, replace(options, format=one.name))
    if one.name != NATIVE:
        listener.remark(f"{path}: read as {one.name}, {one.what}")
    if isinstance(session, RecordedSession) and isinstance(session.recording, MadeOdometry):
        listener.remark(session.recording.said)
    if session.kind != "session":
        advice = "build a library from it, or replay the session that belongs to it"
        raise InputError(path, f"found a {session.kind} log, expected a session log; {advice}", 1)
    return session


def as_recorded_session(session: AnySession, opening: ReadingOptions) -> RecordedSession:
    """Give the same session as one whose records can be had as well."""
    if isinstance(session, RecordedSession):
        return session
    return RecordedSession(open_recording(session.path, opening), opening)


def open_library_for(
    session: AnySession, library: Path | None, *, keep_going: bool, listener: Listener = TO_CONSOLE
) -> Library:
    """Open the library that was asked for, or the one that the session's header names."""
    path = library or session.info.survey
    if path is None:
        where = "" if isinstance(session, RecordedSession) else ' (no "survey" in the header)'
        raise InputError(
            session.path, f"found no library that goes with it{where}; say which with --library. {NONE_YET}"
        )
    if not path.exists():
        raise InputError(path, "found no such library or survey; say which with --library")
    return open_library(
        path, keep_going=keep_going, progress=progress_of(listener, "library"), warn=listener.warning
    )


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run as it was asked for; what is given here goes over what was asked of every run."""

    preset: str | None = None
    feature: str | None = None
    resampler: str | None = None
    seed: int | None = None
    config: Path | None = None
    name: str = ""  # what the run is called; empty: after preset and feature, or its configuration file

    def label(self, config: Path | None) -> str:
        """Name the run after what sets it apart."""
        named = [part for part in (self.preset, self.feature) if part]
        return self.name or "-".join(named) or (config.stem if config else "blended")


def configured(wanted: RunSpec, options: RunOptions) -> Configuration:
    """Put the configuration of one run together: default, preset, file, environment, command line."""
    typed = dict(options.typed)
    if wanted.feature is not None:
        typed["sensor.weights"] = dict(FEATURES.get(wanted.feature, {wanted.feature: 1.0}))
    if wanted.resampler is not None:
        typed["resampling.scheme"] = wanted.resampler
    if options.motion is not None:
        typed["motion"] = read_motion(options.motion)
    return configuration_of(wanted.preset, wanted.config or options.config, os.environ, typed)


def make_runs(
    session: Drive, library: Library, wanted: Sequence[RunSpec], options: RunOptions
) -> list[FilterRun]:
    """Put the runs together, on the same drive and, unless asked otherwise, with the same seed."""
    configurations = [configured(one, options) for one in wanted]
    for one in configurations:
        _check_channels(session, library, one)
    reference = nearest_reference(library.poses, library.arena)
    if not reference.grid.free.any():
        found = f"the library {library.name!r} has no free space: obstacles and walls cover its whole map"
        raise InputError(session.path, f"{found}; mend the map in the survey's header")
    start = start_pose(options.start, session.info, session.path, lambda: _first_truth(session))
    if start is not None:
        _check_start(session, library, reference, start)
    seeds = [options.seed if one.seed is None else one.seed for one in wanted]
    try:
        localizers = [
            build_localizer(library, session, one.parameters, reference=reference, seed=seed)
            for one, seed in zip(configurations, seeds, strict=True)
        ]
    except ValueError as problem:  # bad motion parameters, in the file given or in the header
        if options.motion is not None:
            raise InputError(options.motion, str(problem)) from None
        raise InputError(session.path, str(problem), 1) from None
    labels = unique_labels([one.label(options.config) for one in wanted])
    parts = zip(labels, localizers, configurations, strict=True)
    return [FilterRun(label, made, start, to_toml(one)) for label, made, one in parts]


def _first_truth(session: Drive) -> F64 | None:
    """Give the pose (3,) at which a recorded drive really began; a live one has yet to tell."""
    if isinstance(session, RecordedSession):
        return first_truth(session.recording)
    return first_truth(open_recording(session.path)) if isinstance(session, SessionLog) else None


def _check_start(session: Drive, library: Library, reference: NearestReference, start: F64) -> None:
    """Refuse a start outside the map; only say so where the map has something solid there."""
    at = f"the start pose ({start[0]:.2f}, {start[1]:.2f}) m"
    x_min, y_min, x_max, y_max = library.arena.bounds
    if not (x_min <= start[0] <= x_max and y_min <= start[1] <= y_max):
        bounds = f"x {x_min:.2f} to {x_max:.2f}, y {y_min:.2f} to {y_max:.2f} m"
        raise InputError(session.path, f"{at} is outside the map ({bounds}); give another with --start")
    local = np.array([[*(start[:2] - library.origin), start[2]]], np.float32)
    if reference.entries(local, library.origin)[0] < 0:
        note(f"{at} is not in the map's free space: until particles reach it, all their weights are zero")


def _check_channels(session: Drive, library: Library, configuration: Configuration) -> None:
    for channel in configuration.parameters.sensor.weights:
        if channel not in library.index:
            found = f"the library {library.name!r} holds {', '.join(library.index) or 'no channel'}"
            raise InputError(session.path, f"{found}, and {channel} is wanted; build the library again")


def unique_labels(names: Sequence[str]) -> list[str]:
    """Name runs after their features; a second one of the same name becomes `color-2`."""
    labels: list[str] = []
    for name in names:
        label, number = name, 1
        while label in labels or label in RESERVED:
            number += 1
            label = f"{name}-{number}"
        labels.append(label)
    return labels
