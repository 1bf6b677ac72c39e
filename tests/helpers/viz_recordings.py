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
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.events import LanesDrawing
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import RunView, Scene, numbered
from maurice_viz.viewer import sinks

Update = tuple[Moment, StepRecord]
Played = list[Update]


def draw(
    path: Path, session: fakes.FakeSession, features: Sequence[str], particles: int = 60
) -> list[Played]:
    """Draw one run per feature into one recording; return what was drawn."""
    runs = numbered(run_of(session, feature) for feature in features)
    scene = Scene(session.info, session.library, session.has_truth)
    played = [fakes.play(session, feature, particles) for feature in features]
    with sinks.to_file(path, session.info.name, runs_blueprint(runs, scene)) as rec:
        for run, records in zip(runs, played, strict=True):
            observe(RerunObserver(rec, run, scene), records)
    return played


def run_of(session: fakes.FakeSession, feature: str = "color", label: str = "") -> RunView:
    """Return the view of a run by one feature."""
    localizer = build_localizer(session.library, session, of_feature(feature, 60))
    return RunView.of(label or feature, localizer)


def draw_run(path: Path, session: fakes.FakeSession, label: str, localizer: Any, played: Played) -> None:
    """Draw one run that was played already."""
    run = RunView.of(label, localizer)
    scene = Scene(session.info, session.library, session.has_truth)
    with sinks.to_file(path, session.info.name, runs_blueprint([run], scene)) as rec:
        observer, lanes = RerunObserver(rec, run, scene), LanesDrawing(rec, [run], scene)
        for moment, record in played:
            lanes.see([observer.see(moment, record)])
        lanes.end({})
        observer.end()


def observe(observer: RerunObserver, updates: Iterable[Update]) -> None:
    """Draw all updates of a run."""
    for moment, record in updates:
        observer.see(moment, record)
    observer.end()


def scene_of(arena: Arena, units: str = "in", has_truth: bool = True) -> Scene:
    """Return a scene on a map, of a library without pictures."""
    return scene_with(Library("x", np.zeros((0, 3)), (), {}, arena), units, has_truth=has_truth)


def scene_with(library: Library, units: str = "in", *, has_truth: bool = True, updates: int = 0) -> Scene:
    """Return a scene with a library."""
    return Scene(SessionInfo("x", units), library, has_truth, updates)


@dataclass(frozen=True, slots=True)
class Row:
    """One logged row: where it stands on each timeline, and the components that it has."""

    step: int | None
    session_s: float | None
    phase: int | None
    values: dict[str, Any]


def entities_of(path: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(path).stream()}


def rows(path: Path, entity: str, timeline: str = "phase") -> list[Row]:
    """Return an entity's rows that are on a timeline, in the order of the phase timeline."""
    found = []
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if timeline in batch.schema.names:
            found += [_row(batch, k) for k in range(batch.num_rows)]
    return sorted(found, key=lambda row: row.phase or 0)


def static(path: Path, entity: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "phase" not in batch.schema.names:
            for k in range(batch.num_rows):  # the latest counts
                found |= _row(batch, k).values
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
