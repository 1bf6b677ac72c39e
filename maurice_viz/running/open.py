"""Opening what a replay needs: the session, its library, and a filter for each run asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Protocol
from unicodedata import normalize

import numpy as np

from maurice_loaders.config_files import motion_file, to_toml
from maurice_loaders.doctor.gathering import Gathering
from maurice_loaders.doctor.plausibility import implausible
from maurice_loaders.errors import InputError
from maurice_loaders.files.paths import look_again
from maurice_loaders.formats.registry import chosen
from maurice_loaders.formats.registry import open_session as open_any
from maurice_loaders.libraries.completed import completed
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession, first_truth
from maurice_mcl.config.build import adapted, available, build_localizer
from maurice_mcl.config.parameters import Configuration
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library.drive_score import DrivePicture
from maurice_mcl.sensor.map_places import reference_of
from maurice_mcl.sensor.outside import load_sensor
from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values import F64, Library, Radii, Session, SessionInfo

from ..entities import RESERVED
from ..errors import SILENT, Listener, OptionError, once, progress_of
from ..playback import FilterRun
from ..style import Units, scale_for, units_named
from ..text.findings import brief
from ..text.library import say_drive, say_places
from .drive_check import MOST_UPDATES, suited
from .filters import Filter

GLOBAL = "global"  # the start with particles anywhere
FARTHEST_M = 1e9  # no map reaches further
START_WORDS = "a start is tracking, truth, global or X,Y,HEADING"


def typed_pose(text: str, units: Units, wanted: str) -> F64:
    """Read "X,Y,HEADING", in display units and degrees, as a pose (3,) in meters and radians. OptionError."""
    try:
        x, y, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        x = y = heading_deg = np.nan
    pose = np.array([x / units.per_m, y / units.per_m, np.deg2rad(heading_deg)])
    if not (np.abs(pose) <= FARTHEST_M).all():
        raise OptionError(f"{wanted} ({units.name} and degrees), found {text!r}")
    return pose


def start_pose(
    start: str | tuple[float, ...] | None, info: SessionInfo, log: Path, first_truth: Callable[[], F64 | None]
) -> F64 | None:
    """Return the pose (3,) in the map's frame at which the particles begin, or None for anywhere.

    `start` is a pose in meters and radians, or a word as `--start` takes it; None is tracking where the
    header has a start pose, else global. InputError when tracking or the truth is asked for and there is no
    such pose; OptionError for other words.
    """
    if start is None:
        return info.start
    if not isinstance(start, str):
        return np.asarray(start, np.float64)
    if start == GLOBAL:
        return None
    if start == "tracking":
        if info.start is None:
            missing = 'found no "start" pose in a header'
            raise InputError(log, f"{missing}; give --start truth, X,Y,HEADING or global")
        return info.start
    if start == "truth":
        pose = first_truth()
        if pose is None:
            raise InputError(log, "found no truth to start from; give --start X,Y,HEADING or global")
        return pose
    return typed_pose(start, units_named(info.display_units), START_WORDS)


MAP_PICTURES = (".pgm", ".png")
NO_MAP = (
    "found no map that goes with its scans; name one with --map map.yaml. "
    "If you have none, make one from a drive with true poses: maurice-replay map build DRIVE -o MAP"
)
NONE_YET = (
    "If you have none, make one from a drive with true poses: "
    "maurice-replay library build DRIVE -o LIBRARY --every 0.4m,45deg"
)


class SourcedSession(Session, Protocol):
    """A session, recorded or live, that knows where it comes from."""

    @property
    def path(self) -> Path:
        """The file or folder, or the name used for it in messages."""
        ...


def open_session(
    source: str | Path | RecordedSession, reading: Reading, listener: Listener
) -> RecordedSession:
    """Open a session of any format, unless it is open. InputError for what is no session."""
    if not isinstance(source, (str, Path)):
        return source
    session = open_any(source, reading)
    for text in chosen(session.path, session.options).remarks:
        listener.remark(f"{session.path}: {text}")
    for text in session.opening_remarks:
        listener.remark(text)
    return session


def overview_of(session: RecordedSession, listener: Listener) -> tuple[int, bool]:
    """Return the overview of a session, and warn of numbers that cannot be. InputError as reading."""
    gathering = Gathering()
    overview = session.overview(gathering.add)
    warn_implausible(session.path, gathering, listener)
    return overview


def warn_implausible(path: Path, gathering: Gathering, listener: Listener) -> None:
    """Warn of numbers that cannot be, in a line each."""
    for finding in implausible(gathering.drive(), gathering.scans):
        listener.warning(f"{path}: {brief(finding)}")


def library_of(session: RecordedSession, asked: Path | Library | None) -> Path | Library | None:
    """Return the library that was asked for, or the header names, or the bag itself where it holds a map."""
    if asked is not None or session.info.survey is not None or not session.observed.scans:
        return asked or session.info.survey
    from maurice_loaders.bags.maps import map_in

    return None if map_in(session.path, session.options) is None else session.path


def open_library_for(
    session: RecordedSession, library: Path | Library | None, *, keep_going: bool, listener: Listener = SILENT
) -> Library:
    """Return the library that was asked for, or the one that the session's header names. InputError."""
    path = library_of(session, library)
    if isinstance(path, Library):
        return path
    if path is None:
        is_laser = bool(session.observed.scans)
        missing = (
            NO_MAP if is_laser else f"found no library that goes with it; name one with --library. {NONE_YET}"
        )
        raise InputError(session.path, missing)
    if not path.exists():
        advice = look_again(path, "name one with --library or --map")
        raise InputError(path, f"found no such library, survey or map; {advice}")
    if path.suffix.lower() in MAP_PICTURES:
        raise InputError(path, "found a picture, expected the map.yaml that goes with it")
    return library_at(path, listener, keep_going=keep_going)


def library_at(path: Path, listener: Listener, *, keep_going: bool = False) -> Library:
    """Open a library's folder or a survey log, with progress. InputError."""
    advance = progress_of(listener, "library")
    library = open_library(path, keep_going=keep_going, progress=advance, warn=listener.warning)
    remark_open(library, listener)
    return library


def remark_open(library: Library, listener: Listener) -> None:
    """Remark that no wall is known, so that only the bounds confine the particles."""
    arena = library.arena
    if len(arena.walls) or arena.obstacles or library.is_map:
        return
    width, depth = map(scale_for(library.display_units, arena).say, arena.size_m)
    listener.remark(
        f"library {library.name}: found no walls, so all of {width} x {depth} around its references is free "
        "space; `library build --map map.yaml` adds a map"
    )


def make_runs(
    session: SourcedSession, library: Library, specs: Sequence[Filter], listener: Listener = SILENT
) -> list[FilterRun]:
    """Build a filter for each spec, all for the same session and library; remark what presets use.

    Each is what it would be alone: it gets no sensor that another one asked for. InputError, OptionError.
    """
    specs = preset_for(library, specs)
    configurations = [spec.configuration() for spec in specs]
    libraries = completed(configurations, library, session.info, listener.progress, listener.warning)
    reference = reference_of(library)
    if not reference.grid.free.any():
        full = f"the library {library.name!r} has no free space: obstacles and walls cover its whole map"
        raise InputError(session.path, f"{full}; fix the map in the survey's header")
    warn, pictures = once(listener.warning), cache(partial(_pictures_of, session))
    filters = []
    for spec, configuration, own in zip(specs, configurations, libraries, strict=True):
        start = _start(spec, session, library, reference, warn)
        try:
            pair = fitted(configuration, own, session, reference, start, pictures, warn, seed=spec.seed)
        except InputError as problem:
            raise InputError(session.path, problem.message) from None
        except ValueError as problem:  # bad motion parameters, in the configuration or in the header
            file = motion_file(spec.changes)
            raise InputError(file or session.path, str(problem), None if file else 1) from None
        filters.append((*pair, start))
    labels = unique_labels([_label(*pair, library) for pair in zip(specs, configurations, strict=True)])
    runs = [
        FilterRun(label, localizer, start, to_toml(configuration))
        for label, (configuration, localizer, start) in zip(labels, filters, strict=True)
    ]
    for spelled in dict.fromkeys(chain(*(run.localizer.sensor.parameters.outside for run in runs))):
        listener.remark(f"sensor {spelled} is run from {load_sensor(spelled).file or 'no file'}")
    uses = [
        f"{run.label} uses {', '.join(run.localizer.sensor.names)}"
        for run, spec in zip(runs, specs, strict=True)
        if (spec.preset or spec.config) and not spec.feature  # which says it by its name
    ]
    if uses:
        listener.remark("; ".join(uses))
    return runs


def preset_for(library: Library, specs: Sequence[Filter]) -> list[Filter]:
    """Return the filters for a library: on a map of scans a laser's, where nothing else is asked for."""
    usual = "laser" if library.is_map else None
    return [spec if spec.preset or spec.config else replace(spec, preset=usual) for spec in specs]


def fitted(
    configuration: Configuration,
    library: Library,
    session: SourcedSession,
    reference: NearestReference,
    start: F64 | None,
    pictures: Callable[[], Sequence[DrivePicture]],
    warn: Callable[[str], None],
    *,
    seed: int,
    radii: Radii | None = None,
) -> tuple[Configuration, Localizer]:
    """Return a filter, and its configuration fitted to a library and to pictures of a drive.

    It has the pose sensors that the library holds, and scales after the library's places and the drive's
    `pictures` whose true poses are known. InputError, without a path, for a library that lacks what is asked
    for; ValueError for bad motion parameters.
    """
    usable, missing = available(configuration, library)
    for name in missing:
        warn(f"the library {library.name!r} holds no {name}: the other channels are used alone")
    scaled, places = adapted(usable, library, reference)
    localizer = build_localizer(
        library, session, scaled.parameters, reference=reference, seed=seed, radii=radii
    )
    drive = pictures() if localizer.sensor.weights else []
    widening = 1.0 if places is None else places.widening
    suiting, localizer, score = suited(scaled, localizer, widening, start, drive)
    decides = suiting is not scaled
    if places is not None and decides:  # the drive speaks for how wide the scales are
        places = replace(places, score=places.blind, widening=1.0)
    channels = usable.parameters.sensor.weights
    for text in say_places(library.name, channels, places):
        warn(text)
    for text in say_drive(library.name, localizer.sensor.weights, score, widening if decides else None):
        warn(text)
    return suiting, localizer


def _pictures_of(session: SourcedSession) -> list[DrivePicture]:
    """Return pictures of a drive whose true poses are known; none of a live one."""
    return session.known_pictures(MOST_UPDATES) if isinstance(session, RecordedSession) else []


EDGE_M = 0.05


def _start(
    spec: Filter,
    session: SourcedSession,
    library: Library,
    reference: NearestReference,
    warn: Callable[[str], None],
) -> F64 | None:
    """Return where the particles of a run begin (3,); None: anywhere. InputError outside the map."""
    start = amcl.start if spec.start is None and (amcl := spec.amcl) is not None else None
    if start is None:
        start = start_pose(spec.start, session.info, session.path, lambda: _first_truth(session))
    if start is not None:
        start = _at_edge(start, library)
        _check_start(session, library, reference, start, warn)
    return start


def _at_edge(start: F64, library: Library) -> F64:
    """Return a pose (3,) that is just outside of the map at its edge: a map ends where its last cell does."""
    low, high = np.array(library.arena.bounds).reshape(2, 2)
    inside = np.clip(start[:2], low + 1e-6, high - 1e-6)
    return np.array([*inside, start[2]]) if np.abs(inside - start[:2]).max() <= EDGE_M else start


def _label(spec: Filter, configuration: Configuration, library: Library) -> str:
    """Return a run's name; without a camera the default run is named after its sensors."""
    is_chosen = spec.name or spec.preset or spec.config or spec.feature
    return spec.label if library.index or is_chosen else "-".join(configuration.parameters.sensor.weights)


def _first_truth(session: SourcedSession) -> F64 | None:
    """Return the pose (3,) at which a recorded drive really began; of a live one it is not known yet."""
    return first_truth(session.recording) if isinstance(session, RecordedSession) else None


def _check_start(
    session: SourcedSession,
    library: Library,
    reference: NearestReference,
    start: F64,
    warn: Callable[[str], None],
) -> None:
    """Refuse a start outside the map; warn where the map has something solid there."""
    units = units_named(session.info.display_units)
    x, y, *borders = (f"{v * units.per_m:.{units.digits}f}" for v in (*start[:2], *library.arena.bounds))
    at = f"the start pose ({x}, {y}) {units.name}"
    x_min, y_min, x_max, y_max = library.arena.bounds
    if not (x_min <= start[0] <= x_max and y_min <= start[1] <= y_max):
        bounds = f"x {borders[0]} to {borders[2]}, y {borders[1]} to {borders[3]} {units.name}"
        if library.is_map and _is_near(start, library):
            warn(f"{at} is outside the map ({bounds}): the scans alone tell how the robot moves there")
            return
        raise InputError(session.path, f"{at} is outside the map ({bounds}); give another with --start")
    local = np.array([[*(start[:2] - library.origin), start[2]]], np.float32)
    if reference.entries(local, library.origin)[0] < 0:
        warn(f"{at} is not in the map's free space: until particles reach it, all their weights are zero")


def _is_near(pose: F64, library: Library) -> bool:
    """Return whether a pose (3,) off the map is no farther from it than the map is long."""
    low, high = np.array(library.arena.bounds).reshape(2, 2)
    return bool(np.hypot(*(np.clip(pose[:2], low, high) - pose[:2])) < (high - low).max())


def unique_labels(names: Sequence[str]) -> list[str]:
    """Return labels that are unique and not reserved; a second run named `color` becomes `color-2`.

    Names that look the same are the same: to some file systems, accents are so however they are written.
    """
    labels: list[str] = []
    for name in (normalize("NFC", name) for name in names):
        label, number = name, 1
        while label in labels or label in RESERVED:
            number += 1
            label = f"{name}-{number}"
        labels.append(label)
    return labels


def remark_skipped(session: RecordedSession, listener: Listener) -> None:
    """Report what was skipped of a session, but for what was said when it was opened."""
    for warning in session.warnings:
        if warning not in session.opening_remarks:
            listener.warning(warning)
    if session.problem_count:
        skipped = f"skipped {session.problem_count} broken records"
        listener.warning(f"{session.path}: {skipped}, the first: {session.problems[0]}")
