"""Runs drawn into a recording that somebody else opened: their layout, and an observer a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import rerun as rr
import rerun.blueprint as rrb

from ..contact_sheet import cell_height
from ..layouts.registry import for_runs
from ..layouts.shown import Run, Shown
from ..look import scale_for
from ..observe import Observer, RerunObserver
from ..thinning import Detail
from .showing import Drawn, Scene


def layout_of(runs: Sequence[Drawn], scene: Scene, first: str | None = None) -> rrb.Blueprint:
    """Give the layout of runs; `first` names the tab that is open."""
    arena = scene.library.arena
    scale, height = scale_for(scene.info.display_units, arena), cell_height(scene.library.pictures)
    drawn = [Run(run.label, tuple(run.channels), run.own_drive) for run in runs]
    shown = Shown(arena, scale, scene.has_truth, scene.has_pictures, height)
    return for_runs(drawn, shown, first, live=scene.live)


@contextmanager
def observed(
    rec: rr.RecordingStream, runs: Sequence[Drawn], scene: Scene, detail: Detail = Detail.FULL
) -> Iterator[dict[str, Observer]]:
    """Begin one observer a run, the first of which draws what they share; end them, also after a failure."""
    observers: dict[str, Observer] = {}
    for run in runs:
        observers[run.label] = RerunObserver(
            rec,
            run.label,
            {} if run.sensor is None else run.sensor.distances,
            scene=not observers,
            has_truth=scene.has_truth,
            detail=detail,
            sensor=run.sensor,
            updates=scene.updates,
            bookmarks=run.bookmarks,
        )
    for observer in observers.values():
        observer.begin(scene.info, scene.library)
    try:
        yield observers
    finally:
        for observer in observers.values():
            observer.end()
