"""`maurice-replay export RUN`: a saved run as files for other tools."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from maurice_loaders.errors import InputError
from maurice_loaders.export.evo import EvoSink, evo_sink
from maurice_loaders.export.run import McapScene, mcap_sink, scene_of
from maurice_loaders.export.tables import (
    PATHS,
    ExportStep,
    PathSink,
    Sink,
    csv_sink,
    export_steps,
    kitti_line,
    parquet_sink,
    path_files,
    path_sink,
    tum_line,
)
from maurice_loaders.recorded_session import begin_of
from maurice_loaders.runs.store import SavedRun, open_runs

from ...app.open import AnySession
from ...app.restoring import Pictures
from ...app.saved import session_of
from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

RunArgument = Annotated[
    Path, typer.Argument(metavar="RUN", show_default=False, help="A saved run's folder, or a comparison's.")
]


@dataclass(frozen=True, slots=True)
class Targets:
    """The files that were asked for; None: not asked for."""

    tum: Path | None
    kitti: Path | None
    csv: Path | None
    parquet: Path | None
    mcap: Path | None
    evo: Path | None

    @property
    def given(self) -> list[Path]:
        """The files that were asked for."""
        files = (self.tum, self.kitti, self.csv, self.parquet, self.mcap, self.evo)
        return [file for file in files if file is not None]


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for beside the files."""

    only: str | None  # one of PATHS
    t_offset_s: float
    scored: bool
    force: bool


def export(
    folder: RunArgument,
    tum: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Paths as TUM: t x y z qx qy qz qw.")
    ] = None,
    kitti: Annotated[Path | None, typer.Option(metavar="FILE", help="Paths as KITTI: 12 numbers.")] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="A table, a row an update.")] = None,
    parquet: Annotated[Path | None, typer.Option(metavar="FILE", help="The same table as Parquet.")] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="ROS 2 messages: pictures, poses, clouds. Needs maurice-replay[ros]."
        ),
    ] = None,
    evo: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Position errors as `evo_ape --save_results` has them."),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(help=f"Of TUM and KITTI, only one path: {' | '.join(PATHS)}. [default: all three]"),
    ] = None,
    scored: Annotated[
        bool,
        typer.Option("--scored", help="Leave out the first three updates, as the table of figures does."),
    ] = False,
    t_offset: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Add this to every time; the clock is the session's."),
    ] = 0.0,
    run_label: Annotated[
        str | None, typer.Option("--run-label", metavar="LABEL", help="Which run of a comparison.")
    ] = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Write estimate, truth and odometry of a saved run as files for other tools; nothing is filtered."""
    targets = Targets(tum, kitti, csv, parquet, mcap, evo)
    _check(targets, only, t_offset)
    with one_line_errors():
        run = chosen_run(folder, run_label)
        if only == "truth" and not run.manifest.has_truth:
            raise InputError(
                run.folder, "knows no truth, and --only truth asks for nothing else; leave it out"
            )
        exported = _export(run, targets, Wanted(only, t_offset, scored, force))
    if json_output:
        results.print_json(json.dumps({"runs": [exported]}))
        return
    for file in exported["files"]:
        results.print(file, soft_wrap=True)


def _check(targets: Targets, only: str | None, t_offset: float) -> None:
    if not targets.given:
        raise typer.BadParameter("name a file: --tum, --kitti, --csv, --parquet, --mcap or --evo")
    if len({file.absolute() for file in targets.given}) < len(targets.given):
        raise typer.BadParameter("two formats cannot go to one file")
    if only is not None and only not in PATHS:
        raise typer.BadParameter(f"--only is {', '.join(PATHS)}, found {only!r}")
    if not np.isfinite(t_offset):
        raise typer.BadParameter(f"--t-offset is a number of seconds, found {t_offset}")


def chosen_run(folder: Path, label: str | None) -> SavedRun:
    """Open a saved run, or the one of that label of a comparison. InputError when it is not clear which."""
    runs = {run.manifest.label: run for run in open_runs(folder)}
    if label is None and len(runs) > 1:
        raise InputError(folder, f"holds the runs {', '.join(runs)}; choose one with --run-label")
    if label is not None and label not in runs:
        raise InputError(folder, f"holds no run {label!r}; it holds {', '.join(runs)}")
    return runs[label] if label is not None else next(iter(runs.values()))


def _export(run: SavedRun, targets: Targets, wanted: Wanted) -> dict[str, Any]:
    """Go through the run once and write every file; say what came of it."""
    manifest, steps, errors = run.manifest, 0, EvoSink(run.manifest.label)
    session, begin_s = _session(run, targets)
    pictures = Pictures(session, note) if targets.mcap else None
    with ExitStack() as stack, progress("export") as advance:
        files = _files(targets, wanted.only)
        sinks = _open(stack, run, targets, wanted, session)
        going = export_steps(run, t_offset_s=begin_s + wanted.t_offset_s)
        for number, step in enumerate(going, start=1):
            image = None if pictures is None else pictures.of(step.rows)
            if step.scored or not wanted.scored:
                _add(step, image, [*sinks, errors])
                steps += 1
            advance(number, manifest.pictures)
        if not steps:
            raise InputError(
                run.folder, "holds no such update, so there is nothing to export; replay further"
            )
    _remark(run, sinks, targets)
    written = [str(file) for file in files if file.exists()]
    return {
        "label": manifest.label,
        "updates": steps,
        "files": written,
        "position_error_m": errors.statistics() or None,
    }


def _add(step: ExportStep, image: Any, sinks: Sequence[Sink]) -> None:
    for sink in sinks:
        sink.add(step, image)


def _open(
    stack: ExitStack, run: SavedRun, targets: Targets, wanted: Wanted, session: AnySession | None
) -> list[Sink]:
    """Open all files that were asked for; they appear together at the end."""
    channels, label, force = run.manifest.channels, run.manifest.label, wanted.force
    paths = _paths(wanted.only)
    origin = np.array(run.manifest.origin_m)
    together = run.manifest.has_truth and wanted.only is None
    opening: Mapping[Path | None, Callable[[Path], Any]] = {
        targets.tum: lambda file: path_sink(path_files(file, paths), tum_line, force=force),
        targets.kitti: lambda file: path_sink(
            path_files(file, paths), kitti_line, together=together, force=force
        ),
        targets.csv: lambda file: csv_sink(file, channels, force=force),
        targets.parquet: lambda file: parquet_sink(file, channels, force=force),
        targets.mcap: lambda file: mcap_sink(file, origin, _scene(run, session), force=force),
        targets.evo: lambda file: evo_sink(file, label, force=force),
    }
    return [stack.enter_context(make(file)) for file, make in opening.items() if file is not None]


def _paths(only: str | None) -> Sequence[str]:
    return PATHS if only is None else (only,)


def _files(targets: Targets, only: str | None) -> list[Path]:
    """Name every file that may be written."""
    paths = _paths(only)
    several = [f for file in (targets.tum, targets.kitti) if file for f in path_files(file, paths).values()]
    others = (targets.csv, targets.parquet, targets.mcap, targets.evo)
    return [*several, *(file for file in others if file is not None)]


def _session(run: SavedRun, targets: Targets) -> tuple[AnySession | None, float]:
    """Give the session and when it began on its own clock, or say what is missing without it."""
    try:
        session = session_of(run)
        return session, begin_of(session)
    except InputError as problem:
        missing = "pictures are left out and times" if targets.mcap else "times"
        note(f"{str(problem).split(';')[0]}: {missing} count from its first record")
        return None, 0.0


def _scene(run: SavedRun, session: AnySession | None) -> McapScene:
    """Give what is told once; the map is the one that the run was made with."""
    if session is None:
        return McapScene(None, run.arena(), None)
    found = scene_of(session.info, run.manifest.reading.camera)
    return replace(found, arena=run.arena())


def _remark(run: SavedRun, sinks: Sequence[Sink], targets: Targets) -> None:
    """Say what is not in the files."""
    for sink in sinks:
        if isinstance(sink, PathSink) and sink.left_out:
            why = "KITTI rows have no time, so that only updates with a known truth are written"
            note(f"{targets.kitti}: {sink.left_out} updates are left out: {why}")
    if not run.manifest.has_truth and (targets.tum or targets.kitti):
        note("the run knows no truth: there is no file of it")
