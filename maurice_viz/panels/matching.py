"""What the picture was compared with: circles, histograms, best references, likelihood maps, filmstrip.

Everything here needs the library's entries. A saved run may be shown without them; then these panels stay
empty, and nothing else does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import rerun as rr

from maurice_mcl.library import Library
from maurice_mcl.records import Comparison, StepRecord
from maurice_mcl.session import Moment

from ..drawing.contact_sheet import ContactSheet, best_matches
from ..entities import RunPaths
from ..style import Scale
from . import histograms as draw_histograms
from . import pictures as draw_pictures
from . import traces as draw_traces
from .circles import Circles, circles_for
from .filmstrip import Film
from .likelihood import LikelihoodMaps, likelihood_maps
from .traces import EntryFinder, entry_finder


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What can only be made where the library has entries."""

    places: EntryFinder
    maps: LikelihoodMaps
    film: Film


@dataclass(frozen=True, slots=True, eq=False)
class Matching:
    """Draws the panels of one run."""

    paths: RunPaths
    library: Library
    distances: Mapping[str, str]
    circles: Circles
    sheet: ContactSheet
    known: Known | None

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change."""
        draw_pictures.prepare_jpeg(rec, self.paths.contact_sheet)
        self.circles.prepare(rec, self.paths)
        draw_histograms.prepare_histograms(rec, self.paths, self.distances, self.library)
        if self.known is not None:
            self.known.maps.prepare(rec, self.paths, tuple(self.distances))
            self.known.film.prepare(rec)

    def draw_nothing(self, rec: rr.RecordingStream) -> None:
        """Log an empty sheet, for before the first picture."""
        draw_pictures.draw_sheet(rec, self.paths.contact_sheet, self.sheet.draw(()))

    def draw(self, rec: rr.RecordingStream, seen: Comparison) -> None:
        """Log what the comparison says of all references."""
        if len(seen.quality):
            self.circles.draw(rec, self.paths, seen)
            draw_histograms.draw_histograms(rec, self.paths, seen, self.library, self.distances)
            if self.known is not None:
                self.known.maps.draw(rec, self.paths, seen)
        sheet = self.sheet.draw(best_matches(seen))
        draw_pictures.draw_sheet(rec, self.paths.contact_sheet, sheet)

    def draw_where(self, rec: rr.RecordingStream, moment: Moment, record: StepRecord, *, whole: bool) -> None:
        """Log what it says of where the robot is and of where it is thought to be."""
        if self.known is None or not len(record.sighting.comparison.quality):
            return
        places = self.known.places
        if moment.truth is not None:
            draw_traces.draw_truth_seen(rec, self.paths, record, moment.truth, places)
        if whole:
            at_truth = None if moment.truth is None else places.entry_at(moment.truth)
            self.known.film.draw(rec, record, at_truth, places.entry_at(record.estimate.pose))

    def draw_left_out(self, rec: rr.RecordingStream) -> None:
        """Empty what is not drawn from here on, or it would show an earlier update."""
        self.circles.draw_none(rec, self.paths)
        self.draw_nothing(rec)
        for path in (self.paths.at("histogram"), self.paths.at("likelihood")):
            rec.log(path, rr.Clear(recursive=True))


def matching_of(
    paths: RunPaths, library: Library, distances: Mapping[str, str], scale: Scale, has_truth: bool
) -> Matching:
    """Make what draws the panels of a run."""
    known = None
    if library.size:
        places = entry_finder(library)
        maps = likelihood_maps(library, places.nearest, scale)
        known = Known(places, maps, Film(paths, library, has_truth))
    circles, sheet = circles_for(library, scale), ContactSheet(library, scale)
    return Matching(paths, library, distances, circles, sheet, known)
