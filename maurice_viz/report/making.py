"""From an opened run to a report: once through all updates for numbers, once more for the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maurice_loaders.bookmarks import Bookmark, read_bookmarks
from maurice_loaders.errors import LogError
from maurice_mcl.events import BOOKMARK, Event
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment
from maurice_mcl.typing import F64

from ..console import note, progress
from ..look import scale_for
from ..restoring import Pictures, restored_together
from .choosing import choose, happenings
from .page import Report, page
from .shots import Photographer, shots
from .tracks import Collected, collect

if TYPE_CHECKING:
    from ..commands.saved import Opened


def html_report(opened: Opened, folder: Path) -> str:
    """Make the page about a saved run, or about all runs of a comparison.

    LogError where the run holds no step. The same run gives the same page, byte for byte.
    """
    library = opened.scene.library
    scale = scale_for(opened.scene.info.display_units, library.arena)
    starts = {run.manifest.label: _start(run.manifest.start) for run in opened.runs}
    total = opened.runs[0].manifest.pictures
    with progress("read") as advance:
        collected = collect(opened.updates(), starts, scale, library.arena.size_m, advance, total)
    if not collected.steps:
        raise LogError(folder, "holds no step, so there is nothing to report; replay its session anew")
    _add_bookmarks(opened, folder, collected)
    happened = happenings(collected)
    scenes = choose(collected, happened)
    photographer = Photographer(library.arena, scale, opened.session is not None)
    drawn = shots(photographer, _quietly(opened), [scene.step for scene in scenes])
    return page(Report(opened.runs, opened.scene.info, library, scale, collected, happened, scenes, drawn))


def _start(pose: tuple[float, ...] | None) -> F64 | None:
    return None if pose is None else np.array(pose)


def _quietly(opened: Opened) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
    """Go through the updates again; what is wrong with pictures was said the first time."""
    return restored_together(opened.restored, Pictures(opened.session, lambda text: None))


def _add_bookmarks(opened: Opened, folder: Path, collected: Collected) -> None:
    """Add a person's own bookmarks to the events: those of the folder to all runs, others to their run."""
    for run, track in zip(opened.runs, collected.tracks, strict=True):
        times = {int(row[0]): row[1] for row in track.rows}
        for place in dict.fromkeys((folder.resolve(), run.folder.resolve())):
            for mark in _bookmarks(place):
                if mark.step in times:
                    track.events.append(Event(mark.step, times[mark.step], BOOKMARK, mark.note))


def _bookmarks(folder: Path) -> tuple[Bookmark, ...]:
    found = read_bookmarks(folder)
    if found.problem:
        note(found.problem)
    return found.kept
