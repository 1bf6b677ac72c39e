"""From an opened run to a report: once through all updates for numbers, once more for the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.errors import InputError
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..app.restoring import Pictures, restored_together
from ..app.tracks import collect, known_of
from ..cli.console import progress
from ..style import scale_for
from .choosing import choose, happenings
from .page import Report, page
from .shots import Photographer, shots

if TYPE_CHECKING:
    from ..app.saved import Opened


def html_report(opened: Opened, folder: Path) -> str:
    """Make the page about a saved run, or about all runs of a comparison.

    InputError where the run holds no step. The same run gives the same page, byte for byte.
    """
    library = opened.scene.library
    scale = scale_for(opened.scene.info.display_units, library.arena)
    known = {one.saved.manifest.label: known_of(one) for one in opened.restored}
    total = opened.runs[0].manifest.pictures
    with progress("read") as advance:
        collected = collect(opened.updates(), known, scale, library.arena.size_m, advance, total)
    if not collected.steps:
        raise InputError(folder, "holds no step, so there is nothing to report; replay its session anew")
    happened = happenings(collected)
    scenes = choose(collected, happened)
    photographer = Photographer(library.arena, scale, opened.session is not None)
    drawn = shots(photographer, _quietly(opened), [scene.step for scene in scenes])
    return page(Report(opened.runs, opened.scene.info, library, scale, collected, happened, scenes, drawn))


def _quietly(opened: Opened) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
    """Go through the updates again; what is wrong with pictures was said the first time."""
    return restored_together(opened.restored, Pictures(opened.session, lambda text: None))
