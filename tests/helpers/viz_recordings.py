"""Draws fake runs into files, and reads recordings back as plain tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from helpers import viz_fakes as fakes
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo
from maurice_viz.entities import RunPaths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.observer import RerunObserver
from maurice_viz.panels.panel import DrawnRun
from maurice_viz.scene import RunView, Scene
from maurice_viz.style import RUN_COLORS, scale_for
from maurice_viz.viewer import sinks

Update = tuple[Moment, StepRecord]
Played = list[Update]


def draw(
    path: Path, session: fakes.FakeSession, features: Sequence[str], particles: int = 60
) -> list[Played]:
    """Draw one run per feature into one recording; return what was drawn."""
    library = session.library
    runs = [RunView(feature, tuple(FEATURES[feature])) for feature in features]
    shown = Scene(session.info, library, session.has_truth)
    played = [fakes.play(session, feature, particles) for feature in features]
    with sinks.to_file(path, session.info.name, runs_blueprint(runs, shown)) as rec:
        for number, (run, records) in enumerate(zip(runs, played, strict=True)):
            distances, color = distances_of(run.channels), RUN_COLORS[number]
            observer = RerunObserver(rec, run.label, distances, number == 0, session.has_truth, color=color)
            observe(observer, session.info, library, records)
    return played


def draw_run(path: Path, session: fakes.FakeSession, label: str, localizer: Any, played: Played) -> None:
    """Draw one run that was played already."""
    run = RunView.live(label, localizer)
    shown = Scene(session.info, session.library, session.has_truth)
    with sinks.to_file(path, session.info.name, runs_blueprint([run], shown)) as rec:
        distances = localizer.sensor.distances
        observer = RerunObserver(rec, label, distances, True, session.has_truth, sensor=localizer.sensor)
        observe(observer, session.info, session.library, played)


def observe(observer: RerunObserver, info: SessionInfo, library: Library, updates: Iterable[Update]) -> None:
    """Draw all updates of a run."""
    observer.begin(info, library)
    for moment, record in updates:
        observer.see(moment, record)
    observer.end()


def scene_of(arena: Arena, units: str = "in", has_truth: bool = True) -> Scene:
    """Return a scene on a map, of a library without pictures."""
    library = Library("x", np.zeros((0, 3)), (), {}, arena)
    return Scene(SessionInfo("x", units), library, has_truth)


def drawn_run(paths: RunPaths, library: Library, **known: Any) -> DrawnRun:
    """Return what panels know of a run, in inches."""
    return DrawnRun(paths, library, scale_for("in", library.arena), {}, **known)


def distances_of(channels: Sequence[str]) -> dict[str, str]:
    return {channel: CHANNELS[channel].distance for channel in channels}


@dataclass(frozen=True, slots=True)
class Row:
    """One logged row: where it stands on each timeline, and the components that it has."""

    step: int | None
    session_s: float | None
    phase: int | None
    values: dict[str, Any]


def entities_of(path: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(path).stream()}


def rows(path: Path, entity: str) -> list[Row]:
    """Return an entity's rows that are not static, in the order of the phase timeline."""
    found = []
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "phase" in batch.schema.names:
            found += [_row(batch, k) for k in range(batch.num_rows)]
    return sorted(found, key=lambda row: row.phase or 0)


def static(path: Path, entity: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "phase" not in batch.schema.names:
            found |= _row(batch, 0).values
    return found


def _row(batch: pa.RecordBatch, k: int) -> Row:
    names = batch.schema.names
    values = {n: batch.column(n)[k].as_py() for n in names if ":" in n and batch.column(n)[k].is_valid}
    return Row(_index(batch, "step", k), _seconds(batch, k), _index(batch, "phase", k), values)


def _index(batch: pa.RecordBatch, name: str, k: int) -> int | None:
    return batch.column(name)[k].as_py() if name in batch.schema.names else None


def _seconds(batch: pa.RecordBatch, k: int) -> float | None:
    if "session" not in batch.schema.names:
        return None
    nanoseconds = batch.column("session").cast(pa.int64())[k].as_py()
    return None if nanoseconds is None else nanoseconds / 1e9


def having(found: list[Row], component: str) -> list[Row]:
    return [row for row in found if component in row.values]


def positions(row: Row) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(row.values["Points2D:positions"])
