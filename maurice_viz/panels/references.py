"""What the picture was compared with: match circles, the five best references, likelihood over the map.

In a saved run without its library these panels are empty.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values import F32, Comparison, Library, distinct_places, spacing

from .. import entities
from ..drawing.arrow import blob_of, floats_of, points_of, row_of, texts_of
from ..drawing.canvas import Extent
from ..drawing.contact_sheet import (
    BEST,
    CAPTION_PX,
    CELL_PX,
    GAP_PX,
    ContactSheet,
    best_matches,
    no_caption,
    no_picture,
)
from ..drawing.indexed import IndexedColors
from ..drawing.keys import LIKELIHOOD, MATCHES
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import CIRCLE, DEEPEST, LUT, MISSING, RANK, SAYS_NOTHING, TRUTH, Order, Scale
from .belief import run_key
from .camera import NAME, CaptionedPicture, draw_name, named_view
from .laser.scan import PlacesOnMap, reading_of
from .panel import Panel, StepUpdate, joined_labels, set_phase, set_phase_only
from .views import BARE_MAP, map_view, plane_view

CIRCLE_OFFSET = 0.33  # of a circle from its node, in node spacings, along the heading
LARGEST_RADIUS = 0.15  # radius of the circle of quality 1, in node spacings
LEAST_SPACING = 0.085  # share of the arena's long side: circles of nodes that are nearer together overlap
LABEL_ROOM = 0.9  # node spacings: labels of ranks that are nearer together overlap
SMALLEST_RADIUS = 0.012  # so that every entry is visible
NOTHING_WORDS = "this picture hardly changes the weights"
NOTHING_OF_SCAN = "this scan says almost nothing"
MAP_PX = 120  # along the longer side of a map
ALL_CHANNELS = "all"  # the map of all channels together


class MatchCirclesPanel(Panel):
    """Draws one circle per heading at every library node, its radius the match quality (thesis fig. 34)."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._circles = MatchCircles(scene.library, scene.scale)

    def prepare(self, rec: rr.RecordingStream) -> None:
        self._circles.prepare(rec, self._paths)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        comparison = update.record.sighting.comparison
        if update.whole and len(comparison.quality):
            set_phase(rec, update.moment, Phase.MEASURE)
            self._circles.draw(rec, self._paths, comparison)

    def clear(self, rec: rr.RecordingStream) -> None:
        self._circles.clear(rec, self._paths)


class MatchCircles:
    """One circle per entry, off its node along its heading; made once from the library."""

    def __init__(self, library: Library, scale: Scale) -> None:
        places, _ = distinct_places(library.poses[:, :2])
        spacing_m = max(spacing(places), LEAST_SPACING * max(library.arena.size_m))
        heading = library.poses[:, 2]
        along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        self.centers = scale.screen(library.poses[:, :2] + CIRCLE_OFFSET * spacing_m * along)  # (L, 2) drawn
        middle, top = (self.centers[:, 0].mean(), self.centers[:, 1].min()) if library.size else (0.0, 0.0)
        self._words_at = np.array([[middle, top]], np.float32)  # where it says that a picture says nothing
        self._tells = True  # whether the last picture told places apart
        self.spacing = scale.length(spacing_m)  # between nodes, or what it is drawn as, in display units

    def prepare(self, rec: rr.RecordingStream, paths: RunPaths) -> None:
        """Log what does not change: places and colors."""
        circles = rr.Points2D.from_fields(positions=self.centers, colors=[CIRCLE], draw_order=Order.CIRCLES)
        rec.log(paths.circles, circles, static=True)
        # no labels yet: static ones would hide all later ones
        best = rr.Points2D.from_fields(colors=[RANK], show_labels=True, draw_order=Order.MARKS)
        rec.log(paths.best, best, static=True)
        log_words(rec, paths, NOTHING_WORDS)

    def draw(self, rec: rr.RecordingStream, paths: RunPaths, comparison: Comparison) -> None:
        """Log the sizes, and where the five best are."""
        radii = np.maximum(comparison.quality * np.float32(LARGEST_RADIUS), np.float32(SMALLEST_RADIUS))
        rec.log(paths.circles, row_of(rr.Points2D, radii=floats_of(radii * np.float32(self.spacing))))
        self._tell_nothing(rec, paths, comparison.log_likelihood)
        best = comparison.best(BEST)
        places, sizes = self.centers[best], floats_of(radii[best] * np.float32(self.spacing))
        ranks = [str(rank + 1) for rank in range(len(places))]
        labels = texts_of(joined_labels(places, LABEL_ROOM * self.spacing, ranks))
        rec.log(paths.best, row_of(rr.Points2D, positions=points_of(places), radii=sizes, labels=labels))

    def clear(self, rec: rr.RecordingStream, paths: RunPaths) -> None:
        """Log no circles, until the next are drawn."""
        rec.log(paths.circles, rr.Points2D.from_fields(radii=[0.0]))
        for path in (paths.says_nothing, paths.best):
            rec.log(path, rr.Points2D.from_fields(positions=np.zeros((0, 2), np.float32)))
        self._tells = True

    def _tell_nothing(self, rec: rr.RecordingStream, paths: RunPaths, log_likelihood: F32) -> None:
        """Say where the map is that the picture hardly tells places apart, or take that away."""
        tells = tells_apart(log_likelihood)
        if tells != self._tells:
            places = self.centers[:0] if tells else self._words_at
            rec.log(paths.says_nothing, row_of(rr.Points2D, positions=points_of(places)))
            self._tells = tells


def log_words(rec: rr.RecordingStream, paths: RunPaths, words: str) -> None:
    """Log the warning that a picture hardly tells places apart; its place on the map is logged by step."""
    radius = rr.components.Radius.ui_points(0.0)
    points = rr.Points2D.from_fields(
        colors=[TRUTH], radii=radius, labels=[words], show_labels=True, draw_order=Order.FRAME
    )
    rec.log(paths.says_nothing, points, static=True)


def tells_apart(log_likelihood: F32) -> bool:
    """Return whether a picture tells places apart: half of the entries (L,) are well behind the best."""
    middle = len(log_likelihood) // 2
    return not float(log_likelihood.max() - np.partition(log_likelihood, middle)[middle]) < SAYS_NOTHING


class BestReferencesPanel(Panel):
    """Draws the pictures of the five best references."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._sheet = ContactSheet(scene.library, scene.scale)
        paths = (run.paths.match(rank) for rank in range(1, BEST + 1))
        self._cells = [CaptionedPicture(path, self._sheet.height) for path in paths]

    def prepare(self, rec: rr.RecordingStream) -> None:
        for column, cell in enumerate(self._cells):
            cell.prepare(rec, column * (CELL_PX + GAP_PX), 0)
        name = f"{self._run.short}: best match"
        draw_name(rec, self._paths.match(1), name, CELL_PX, self._run.color)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the pictures; in the very first phase, before anything is compared, empty ones."""
        if update.whole and update.is_first:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            self.clear(rec)
        set_phase(rec, update.moment, Phase.MEASURE)
        matches = best_matches(update.record.sighting.comparison)
        matches = matches if update.whole else matches[:1]  # the best one is cheap, and part of the story
        for cell, match in zip(self._cells, matches, strict=False):
            cell.draw(rec, self._sheet.picture(match.entry), self._sheet.caption(match))
        self._empty(rec, len(matches))

    def clear(self, rec: rr.RecordingStream) -> None:
        """Log an empty sheet."""
        self._empty(rec, 0)

    def _empty(self, rec: rr.RecordingStream, first: int) -> None:
        """Log cells without pictures, from this one on: a library may have fewer than five entries."""
        for cell in self._cells[first:]:
            cell.draw(rec, no_picture(self._sheet.height), no_caption(CAPTION_PX))


class LikelihoodPanel(Panel):
    """Draws for every place the likelihood of the picture there in the best heading.

    There is one map per channel, and one of all channels together. Only surveyed references are drawn, each
    over the part of the map that is nearest to it.
    """

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        assert scene.nearest is not None  # this panel is only made where the library has entries
        self._maps = LikelihoodMaps(scene.library, scene.nearest, scene.scale)
        self._places = PlacesOnMap(scene.library) if run.sees_alone else None

    def prepare(self, rec: rr.RecordingStream) -> None:
        for name in map_names(tuple(self._run.distances)):
            rec.log(
                self._paths.likelihood(name),
                rr.Transform3D(translation=[*self._maps.left_top, 0], scale=self._maps.unit_per_px),
                rr.EncodedImage.from_fields(media_type="image/png", draw_order=Order.OVERLAY, opacity=0.85),
                static=True,
            )
        if self._places is not None:
            log_words(rec, self._paths, NOTHING_OF_SCAN)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        comparison = update.record.sighting.comparison
        if not update.whole or not (len(comparison.quality) or self._places):
            return
        set_phase(rec, update.moment, Phase.MEASURE)
        if self._places is not None:
            self._draw_scan(rec, update, self._places)
            return
        parts = dict(zip(comparison.channels, -comparison.channel_cost, strict=True))
        for name in map_names(comparison.channels):
            logs = comparison.log_likelihood if name == ALL_CHANNELS else parts[name]
            image = row_of(rr.EncodedImage, blob=blob_of(self._maps.encoded(logs)))
            rec.log(self._paths.likelihood(name), image)

    def _draw_scan(self, rec: rr.RecordingStream, update: StepUpdate, places: PlacesOnMap) -> None:
        laser = self._scene.laser_of(self._run)
        reading = None if laser is None else reading_of(update.moment, update.record, laser)
        nats = np.zeros(self._library.size, np.float32)
        if laser is not None and reading is not None:
            nats = places.nats(laser, reading)
        middle = self._library.poses[:, :2].mean(axis=0, keepdims=True)
        where = self._scale.screen(middle if reading is not None and not tells_apart(nats) else middle[:0])
        rec.log(self._paths.says_nothing, row_of(rr.Points2D, positions=points_of(where)))
        image = row_of(rr.EncodedImage, blob=blob_of(self._maps.encoded(nats)))
        rec.log(self._paths.likelihood(ALL_CHANNELS), image)

    def clear(self, rec: rr.RecordingStream) -> None:
        rec.log(self._paths.at("likelihood"), rr.Clear(recursive=True))


class LikelihoodMaps:
    """Tables to draw with: pixels to places, and entries sorted by place; of a library with entries."""

    def __init__(self, library: Library, nearest: NearestReference, scale: Scale) -> None:
        grid, corner = nearest.grid, nearest.grid.corner
        places = nearest.place_of_cell[:-1].reshape(grid.shape)
        if library.is_map:  # where it is free alone: a map may be much larger than what is known of it
            places = np.where(grid.free, places, -1)
            rows, columns = (np.flatnonzero(grid.free.any(axis=axis)) for axis in (1, 0))
            places = places[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            corner = corner + grid.cell_m * np.array([columns[0], rows[0]])
        step = max(1, -(-max(places.shape) // MAP_PX))
        cells = places[step // 2 :: step, step // 2 :: step]
        self.place_of_pixel = np.array(cells[::-1], np.intp)  # (H, W), -1 outside; row 0 on top
        place = np.zeros(library.size, np.int32)  # of each entry
        for number, row in enumerate(nearest.entry_of[:-1]):
            place[np.unique(row)] = number
        self.entries = np.argsort(place, kind="stable")  # (L,) sorted by place
        # (P,) where each place's entries begin
        self.first = np.searchsorted(place[self.entries], np.arange(len(nearest.places)))
        size_m = step * grid.cell_m
        corner_m = np.array([[corner[0], corner[1] + len(cells) * size_m]])
        self.left_top: list[float] = scale.screen(corner_m)[0].tolist()  # of the first pixel, as drawn
        self.unit_per_px = scale.length(size_m)

    def encoded(self, log_likelihood: F32) -> bytes:
        """Draw log-likelihoods (L,) as a PNG: bright where likely, nothing where a robot cannot be."""
        best = np.maximum.reduceat(log_likelihood.take(self.entries), self.first)
        share = 1 + (best - best.max()) / DEEPEST
        if not tells_apart(log_likelihood):
            share = np.zeros_like(best)  # all alike: dark, and not all bright
        inks = np.append(np.clip(share * _BRIGHTEST, 0, _BRIGHTEST), _OUTSIDE).astype(np.uint8)
        return _LIKELIHOODS.png(inks.take(self.place_of_pixel))  # -1 is the last


_LIKELIHOODS = IndexedColors()
for _color in LUT[:-1].tolist():  # all but one: a color is left for what is outside
    _LIKELIHOODS.flat((_color >> 24, _color >> 16 & 255, _color >> 8 & 255))
_BRIGHTEST = len(LUT) - 2
_OUTSIDE = _LIKELIHOODS.flat(MISSING)


def map_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the maps: all channels together first, then each, unless there is only one."""
    return (ALL_CHANNELS, *channels) if len(channels) > 1 else (ALL_CHANNELS,)


def circles_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show the match circles with the cloud in white over them."""
    contents = [*BARE_MAP, paths.key(MATCHES), *_circles_of(paths)]
    return map_view("Match circles", contents, scene, paths.particles, run_key(MATCHES, scene))


def _circles_of(paths: RunPaths) -> list[str]:
    return [
        f"{paths.at('match')}/**",
        f"- {paths.contact_sheet}/**",
        paths.particles,
    ]


def best_references_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show the five best references."""
    name = "Five best references (q = match quality, 0 to 1)"
    width, height = BEST * (CELL_PX + GAP_PX) - GAP_PX, scene.picture_height + CAPTION_PX
    contents = [f"{paths.contact_sheet}/**", f"- {paths.match(1)}/{NAME}"]
    return plane_view(name, contents, Extent(0, width, 0, height), origin=paths.contact_sheet)


def best_match_view(run: RunView) -> rrb.Spatial2DView:
    """Show the best reference, by name."""
    return named_view("Best match", run.paths.match(1))


def likelihood_views(
    paths: RunPaths, channels: Sequence[str], scene: Scene, marks: Sequence[str] = ()
) -> list[rrb.Spatial2DView]:
    """Show the likelihood over the map under the cloud and marks, for all channels together and each one."""
    views: list[rrb.Spatial2DView] = []
    for channel in map_names(tuple(channels)):
        contents = [*BARE_MAP, paths.key(LIKELIHOOD), paths.likelihood(channel)]
        contents += [paths.particles, *marks]
        contents += [] if views else [paths.says_nothing]
        contents += [f"{paths.estimate}/**", *([f"{entities.TRUTH}/**"] if scene.has_truth else [])]
        title = channel if views else "Likelihood"  # of all channels together
        views.append(map_view(title, contents, scene, paths.particles, run_key(LIKELIHOOD, scene)))
    return views
