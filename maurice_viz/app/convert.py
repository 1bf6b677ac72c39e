"""Recordings as native logs, as MCAP or as a laser's map; saved runs as paths, tables or MCAP."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.export import tables
from maurice_loaders.export.mcap import McapScene, mcap_sink, scene_of
from maurice_loaders.export.session import (
    Converted,
    convert_to_log,
    convert_to_mcap,
    left_out,
    pictures_of,
    records_to_log,
)
from maurice_loaders.files.pictures import PictureKind
from maurice_loaders.files.ros_maps import write_ros_map
from maurice_loaders.files.writing import expect_absent, expect_apart, writing
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import PLACEHOLDER, Picture, Recording
from maurice_loaders.reading.session import RecordedSession, begin_of
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_loaders.session_log.header import SESSION_LOG
from maurice_mcl.library.occupancy_building import CELL_M, build_occupancy
from maurice_mcl.values import F64, LaserScan, OccupancyMap, Plain, Session

from ..errors import SILENT, Listener, OptionError
from ..running.open import open_session
from ..running.saved import frames_of, library_of, session_of
from ..running.saved_steps import Pictures

LOG, MCAP = ".log", ".mcap"
PICTURES = ("png", "jpeg")


@dataclass(frozen=True, slots=True)
class Conversion:
    """A recording written as a log or as MCAP."""

    file: Path
    counts: Converted  # how many records of each kind it holds

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        return {"file": str(self.file)} | self.counts.to_json()


def convert(
    source: str | Path,
    target: str | Path,
    *,
    pictures: PictureKind = "png",
    reading: Reading | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> Conversion:
    """Convert a recording; return the file written and how many records of each kind it holds.

    `target` is a file that ends in .log or .mcap, or a folder, which gets a `session.log`. The file holds
    what a replay of `source` sees, so that replaying either gives the same run to the last bit; a recording
    without pictures is written whole. What has no place in the file is counted in `left_out`. "png" pictures
    are lossless, "jpeg" ones are of quality 95.

    Raises InputError for a source that cannot be read or a target that exists (unless `force`), and
    OptionError for another ending or picture format.

        >>> import maurice_viz as mv
        >>> converted = mv.convert("session.log", "drive")
        >>> converted.file.name, converted.counts.pictures
        ('session.log', 14)
    """
    source, target, options = Path(source), Path(target), reading or Reading()
    if target.suffix not in (LOG, MCAP, ""):
        raise OptionError(f"OUT is a folder, or ends in {LOG} or {MCAP}; found {target.name!r}")
    if pictures not in PICTURES:
        raise OptionError(f"pictures are {' or '.join(PICTURES)}, found {pictures!r}")
    target = target if target.suffix else target / SESSION_LOG
    expect_apart(target, source)
    expect_apart(pictures_of(target), source)
    session = open_session(source, options, listener)
    notes = ReadingNotes(options.keep_going)
    read: ReadingNotes | RecordedSession = session
    if target.suffix == MCAP:
        steps = convert_to_mcap(session, target, camera=options.camera, kind=pictures, force=force)
    else:
        begin_s, has_pictures = _begin(session.recording)
        if has_pictures:
            steps = convert_to_log(session, target, kind=pictures, begin_s=begin_s, force=force)
        else:
            steps = records_to_log(session.recording, target, notes, force=force)
    converted = _count(steps, target, listener)
    converted.left_out |= left_out(session.recording, converted)
    if converted.left_out:
        counts = ", ".join(f"{count} {what}" for what, count in converted.left_out.items())
        listener.remark(f"{target}: left out: {counts}")
    if target.suffix == LOG:
        read = session if converted.pictures else notes
    for warning in read.warnings:
        if warning not in session.opening_remarks:
            listener.warning(warning)
    count = read.count if isinstance(read, ReadingNotes) else read.problem_count
    if count:
        listener.warning(f"{session.path}: skipped {count} broken records, the first: {read.problems[0]}")
    return Conversion(target, converted)


def _begin(recording: Recording) -> tuple[float, bool]:
    """Return the time of the first record, which a session counts from, and whether there is any picture."""
    first_s: float | None = None
    for record in recording.records(ReadingNotes(keep_going=True)):
        first_s = record.t_s if first_s is None else first_s
        if isinstance(record, Picture) and record.name != PLACEHOLDER:
            return first_s, True
    return first_s or 0.0, False


def _count(steps: Iterator[Converted], target: Path, listener: Listener) -> Converted:
    converted = Converted()
    try:
        for converted in steps:
            listener.progress(converted.pictures, 0, "convert")  # how many there will be is not known
    except ValueError as problem:  # a time that no log may hold, moved too far by the offset
        raise InputError(target, str(problem)) from None
    return converted


LEAST_CELL_M, MOST_CELL_M = 0.01, 1.0  # of a map that is built


@dataclass(frozen=True, slots=True, eq=False)
class BuiltMap:
    """A map as it was built and written."""

    file: Path  # the map.yaml; its picture is beside it
    occupancy: OccupancyMap
    scans: int  # from which it was built
    of_scans: int  # in the recording, used by its gate, with and without a true pose

    def to_json(self) -> dict[str, Any]:
        """Return everything but the cells as JSON."""
        grid = self.occupancy
        size_m = [side * grid.cell_m for side in reversed(grid.cells.shape)]
        free_m2 = float(grid.free.sum()) * grid.cell_m**2
        counts = {"scans": self.scans, "of_scans": self.of_scans}
        return {"file": str(self.file), **counts, "size_m": size_m, "cell_m": grid.cell_m, "free_m2": free_m2}


def build_map(
    recording: str | Path,
    to: str | Path,
    *,
    until: float = 1.0,
    cell_m: float = CELL_M,
    reading: Reading | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> BuiltMap:
    """Build a map from a recording's scans with true poses, and write it as `map.yaml` with its picture.

    `to` is a folder, or a name that ends in .yaml. Only the first share `until` of the scans is used, so that
    a filter can be tried on what the map was not made from. A side of `cell_m` other than 5 cm makes a large
    map of fewer cells, or a small one finer.

    Raises OptionError for a share or cell that is none, and InputError for a recording without scans or true
    poses, or a file that exists (unless `force`).

        >>> import numpy as np, maurice_loaders as ml, maurice_viz as mv
        >>> from maurice_mcl.values.laser import LaserScan
        >>> from maurice_mcl.values.session import SessionInfo
        >>> with ml.SessionWriter("laser.log", SessionInfo("laser")) as log:
        ...     log.truth(0.0, (0.0, 0.0, 0.0))
        ...     log.scan(0.0, LaserScan(np.full(360, 2.0, np.float32), 0.0, np.radians(1), 0.1, 8.0))
        >>> built = mv.build_map("laser.log", "round-room")
        >>> built.file.name, round(built.to_json()["free_m2"])
        ('map.yaml', 12)
    """
    path, file, options = Path(recording), Path(to), reading or Reading()
    _check_map_options(until, cell_m)
    file = file if file.suffix == ".yaml" else file / "map.yaml"
    for target in (file, file.with_suffix(".pgm")):
        expect_absent(target, force=force)
    session = open_session(path, options, listener)
    notes = ReadingNotes(options.keep_going)
    total = sum(each.frame.scan is not None for each in session.glances(ReadingNotes(options.keep_going)))
    scans = (each for each in session.glances(notes) if each.frame.scan is not None)
    known, most = 0, max(1, round(until * total))

    def posed() -> Iterator[tuple[LaserScan, F64]]:
        nonlocal known
        for number, moment in enumerate(islice(scans, most), start=1):
            listener.progress(number, most, "map")
            if moment.frame.scan is not None and moment.truth is not None:
                known += 1
                yield moment.frame.scan, moment.truth

    try:
        occupancy = build_occupancy(posed(), cell_m)
    except ValueError as problem:
        raise InputError(path, _map_fault(total, most, known) or str(problem)) from None
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
    write_ros_map(occupancy, file, force=force)
    for warning in notes.warnings:
        listener.warning(warning)
    return BuiltMap(file, occupancy, known, total)


def _check_map_options(until: float, cell_m: float) -> None:
    if not 0 < until <= 1:
        raise OptionError(f"--until is a share above 0, at most 1, found {until:g}")
    if not LEAST_CELL_M <= cell_m <= MOST_CELL_M:
        raise OptionError(f"--cell is a side of {LEAST_CELL_M:g} to {MOST_CELL_M:g} m, found {cell_m:g}")


def _map_fault(total: int, used: int, known: int) -> str:
    """Return what a recording lacks for a map: scans at all, or true poses of those that are used."""
    if not total:
        return "found no scan of a laser, expected some to build a map from"
    fault = f"found {used} scans, none with a true pose, expected some; see --reading truth_topic=..."
    return "" if known else fault


@dataclass(frozen=True, slots=True)
class Exported(Plain):
    """What was exported of one run."""

    label: str
    updates: int
    files: tuple[Path, ...]
    error_m: Mapping[str, float] | None  # statistics by evo's names; None without truth


Files = Mapping[str, Path]  # those asked for, by kind
KINDS = ("tum", "csv", "parquet", "mcap")  # what the files end in


def export(
    run: str | Path,
    to: str | Path | Sequence[str | Path],
    *,
    only: str | None = None,
    scored: bool = False,
    force: bool = False,
    listener: Listener = SILENT,
) -> Exported:
    """Export estimate, truth and odometry of a saved run; nothing is filtered again.

    `to` is a file or several, at most one of each kind, told by its ending: .tum (paths, for evo), .csv and
    .parquet (a row per step), .mcap (ROS 2 messages). TUM gets one file per path, or just the path `only`
    ("estimate", "truth" or "odometry"). `scored` leaves out the first three steps, as the table of scores
    does. Lengths are in meters, headings in radians; all files appear together at the end.

    Raises OptionError for arguments that contradict each other and InputError for a folder that holds no such
    run, no truth that `only` asks for, no step, or for files that exist (unless `force`).

        >>> import maurice_viz as mv
        >>> exported = mv.export("my-run", "my-run.tum", only="estimate")
        >>> [file.name for file in exported.files]
        ['my-run.tum']
    """
    files = _by_kind([to] if isinstance(to, (str, Path)) else to)
    if only is not None and only not in tables.PATHS:
        raise OptionError(f"--only is {', '.join(tables.PATHS)}, found {only!r}")
    saved = only_run(Path(run))
    if only == "truth" and not saved.manifest.has_truth:
        raise InputError(saved.folder, "has no truth, and --only truth asks for nothing else; leave it out")
    steps, events, errors_m = 0, 0, list[float]()
    paths = tables.PATHS if only is None else (only,)
    session, begin_s = _session(saved, "mcap" in files, listener)
    pictures = Pictures(session, listener.warning) if "mcap" in files else None
    with ExitStack() as stack:
        sinks = _open(stack, saved, files, paths, session, force)
        for number, step in enumerate(tables.export_steps(saved, begin_s=begin_s), start=1):
            image = None if pictures is None else pictures.of(step.rows)
            if pictures is not None and image is not None:
                step = replace(step, readings=pictures.readings, scan=pictures.scan)
            image = None if step.rows.step["picture"] == PLACEHOLDER else image
            if step.scored or not scored:
                for sink in sinks:
                    sink.add(step, image)
                if step.truth is not None:
                    errors_m.append(math.hypot(*(step.estimate - step.truth)[:2]))
                steps += 1
                events += len(step.rows.step["events"]) + len(step.rows.step["session_events"])
            listener.progress(number, saved.manifest.pictures, "export")
        if not steps:
            raise InputError(saved.folder, "holds no such step, so there is nothing to export; replay more")
    _report_left_out(saved, files, events, listener)
    written = tuple(file for file in _named(files, paths) if file.exists())  # there may be no truth to write
    statistics = tables.error_statistics(np.array(errors_m)) if errors_m else None
    return Exported(saved.manifest.label, steps, written, statistics)


def _by_kind(names: Sequence[str | Path]) -> dict[str, Path]:
    """Return the files to write by the endings of their names. OptionError for other endings."""
    files: dict[str, Path] = {}
    for file in map(Path, names):
        kind = file.suffix.removeprefix(".")
        if kind not in KINDS:
            endings = ", ".join(f".{kind}" for kind in KINDS)
            raise OptionError(f"{file}: the ending says what is exported; expected one of {endings}")
        if kind in files:
            raise OptionError(f"{files[kind]} and {file} are of one kind; give one")
        files[kind] = file
    if not files:
        raise OptionError("name a file to write")
    return files


def _named(files: Files, paths: Sequence[str]) -> Iterator[Path]:
    for name, file in files.items():
        yield from tables.path_files(file, paths).values() if name == "tum" else [file]


def only_run(folder: Path, label: str | None = None) -> SavedRun:
    """Open a saved run, of a comparison the one with this label, nothing that it was made from.

    InputError where none or several match.
    """
    runs = open_runs(folder)
    matching = [run for run in runs if label in (None, run.manifest.label)]
    if len(matching) == 1:
        return matching[0]
    if label is None:
        below = ", ".join(str(run.folder) for run in runs)
        raise InputError(folder, f"holds {len(runs)} runs; name one of them: {below}")
    labels = ", ".join(run.manifest.label for run in runs)
    raise InputError(folder, f"found no run {label!r}; it has {labels}")


def _open(
    stack: ExitStack,
    run: SavedRun,
    files: Files,
    paths: Sequence[str],
    session: Session | None,
    force: bool,
) -> list[tables.Sink]:
    channels, origin = run.manifest.channels, np.array(run.manifest.origin_m)
    opening: Mapping[str, Callable[[Path], Any]] = {
        "tum": lambda file: tables.path_sink(tables.path_files(file, paths), force=force),
        "csv": lambda file: tables.table_sink(file, channels, force=force),
        "parquet": lambda file: tables.table_sink(file, channels, force=force),
        "mcap": lambda file: mcap_sink(file, origin, _scene(run, session), force=force),
    }
    return [stack.enter_context(opening[name](file)) for name, file in files.items()]


def _session(run: SavedRun, pictured: bool, listener: Listener) -> tuple[Session | None, float]:
    """Return the session and the time on its own clock at which it began, if it is still there."""
    try:
        if run.manifest.recorded:
            frames = frames_of(run)
            return frames, frames.begin_s
        session = session_of(run)
        return session, begin_of(session)
    except InputError as problem:
        missing = "pictures are left out and times" if pictured else "times"
        listener.warning(f"{str(problem).split(';')[0]}: {missing} count from its first record")
        return None, 0.0


def _scene(run: SavedRun, session: Session | None) -> McapScene:
    """Return what does not change with time; the map is the one that the run was made with."""
    camera = run.manifest.reading.camera
    scene = McapScene(None, None, None) if session is None else scene_of(session.info, camera)
    with suppress(InputError):  # a map that is gone or was changed; its walls are saved
        by_laser = not (run.manifest.channels or run.manifest.recorded)
        scene = replace(scene, occupancy=library_of(run).occupancy if by_laser else None)
    return replace(scene, arena=run.arena())


def _report_left_out(run: SavedRun, files: Files, events: int, listener: Listener) -> None:
    if "tum" not in files:
        return
    if events:
        listener.remark(f"{files['tum']}: left out: {events} events, as such files hold poses only")
    if not run.manifest.has_truth:
        listener.remark("the run has no truth: there is no file of it")
