"""The best match of each run: where it was taken, its picture, and its histograms over the robot's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.scoring.comparison import Step
from maurice_mcl.values import F32, F64

from ... import entities
from ...drawing.arrow import blob_of, points_of, row_of
from ...drawing.canvas import Extent, arena_extent, long_side
from ...drawing.contact_sheet import CELL_PX
from ...drawing.histogram_row import COLUMNS, HIGH_PX, WIDE_PX, Cell, cells_of, draw_grid, rows_of
from ...entities import BARE_FLOORS, WALLS, bars_of, taken_of
from ...scene import RunView, Scene
from ...style import PALE, Order, font_safe, heading_vector, shortened
from ...text.side_by_side import BestMatch
from ..camera import NAME, NAME_ABOVE, named_view
from ..views import Overrides, labeled, plane_view

ARROW = 0.1  # of the map's long side: of a match
AROUND_MAP, CAPTION_MAP = 0.02, 0.13  # of the long side: around the small map, and of its caption above it
# of the long side: where the name of a match may stand, from where it was taken
NAMES_AT = np.array([(0, -0.16), (0, 0.04), (-0.25, -0.06), (0.25, -0.06), (0, -0.3), (0, 0.18)], np.float32)
NAME_ROOM = np.array([(0.16, 0.1), (0.16, 0.14)])  # of the long side: from the edges of the map to a name
CLEAR, TRUTH_NAME = 0.13, 0.1  # of the long side: away from all else; below a truth
COLOR, EDGES, BEST = "color", "edges", "best match by"
CHARTS_KEY = ("bars: the picture", "line: best match", "edges: square root")
CHARTS_KEY_PX, CHARTS_LINE_PX = 8, 15  # around the key, and of each of its lines
LETTER_PX, AROUND_PX = 6.4, 8  # of a label
TWO_LINES_ABOVE = 0.28  # of a picture's width: a name in two lines


class MatchesDrawing:
    """Draws the matches of all runs that compare pictures."""

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._scale, self._library = rec, scene.scale, scene.library
        self._runs = {run.label: run for run in runs}
        self._long = long_side(scene.arena, scene.scale)
        self._cells = {run.label: cells_of_run(run, runs, scene) for run in runs if run.channels}
        extent, room = small_map(scene), NAME_ROOM * self._long
        corners = np.array([(extent.left, extent.top), (extent.right, extent.bottom)])
        self._names_within = corners + room * [[1], [-1]]
        caption = rr.Points2D(
            [((extent.left + extent.right) / 2, extent.top)],
            colors=[PALE],
            radii=rr.components.Radius.ui_points(0.0),
            labels=["where the best matches were taken" if self._cells else "where each run thinks it is"],
            show_labels=True,
        )
        rec.log(entities.MATCHES, caption, static=True)
        for run in runs:
            self._prepare_place(run)
            if run.channels:
                self._prepare_charts(run)

    def _prepare_place(self, run: RunView) -> None:
        """Log the color of a run's mark on the small map, and its name."""
        points, path = rr.components.Radius.ui_points, taken_of(run.label)
        at = rr.Points2D.from_fields(colors=[run.color], radii=points(5.0), draw_order=Order.MARKS)
        arrow = rr.Arrows2D.from_fields(colors=[run.color], radii=points(1.75), draw_order=Order.MARKS)
        self._rec.log(path, at, arrow, static=True)
        name = rr.Points2D.from_fields(
            colors=[run.color],
            radii=points(0.0),
            labels=[font_safe(run.short)],
            show_labels=True,
            draw_order=Order.FRAME,
        )
        self._rec.log(f"{path}/{NAME}", name, static=True)

    def _prepare_charts(self, run: RunView) -> None:
        """Log where the histograms of a run stand, the titles of their cells, and their key."""
        points, label = rr.components.Radius.ui_points, run.label
        runs, cells = [*self._runs.values()], self._cells[label]
        stretch = chart_stretch(runs, cells)
        picture = rr.EncodedImage.from_fields(media_type="image/png", draw_order=Order.OVERLAY)
        shape = rr.Transform3D(scale=[1.0, stretch, 1.0])
        self._rec.log(bars_of(label, "charts"), picture, shape, static=True)
        places = [
            (WIDE_PX * (number % COLUMNS + 0.5), stretch * HIGH_PX * (number // COLUMNS))
            for number in range(len(cells))
        ]
        room = letters(view_px(runs)[0] / COLUMNS)
        titles = [
            shortened(cell.title if cell.channel in run.distances else f"no {cell.title}", room)
            for cell in cells
        ]
        labels = rr.Points2D(
            [*places, (WIDE_PX * COLUMNS / 2, stretch * HIGH_PX * rows_of(cells))],
            radii=points(0.0),
            colors=[PALE] * len(places) + [run.color],
            labels=[font_safe(title) for title in (*titles, charts_key(runs, cells))],
            show_labels=True,
        )
        self._rec.log(bars_of(label, "titles"), labels, static=True)

    def of(self, steps: Mapping[str, Step]) -> list[BestMatch]:
        """Return the best match of each run that has one, and its rank by every channel of its drive."""
        matches = []
        for run in self._runs.values():
            comparison = steps[run.label][1].sighting.comparison
            if not run.channels or len(comparison.quality) != self._library.size or not self._library.size:
                continue
            best = int(comparison.quality.argmax())
            ranks = {
                channel: 1 + int(np.count_nonzero(distances < distances[best]))
                for channel, distances in self._shared(run, steps, "distances").items()
            }
            pose = self._library.poses[best]
            matches.append(BestMatch(run.label, best, pose, self._library.size, ranks, comparison.channels))
        return matches

    def _shared(self, run: RunView, steps: Mapping[str, Step], what: str) -> dict[str, F32]:
        """Return `descriptors` or `distances` by channel: a run's own, then those of its drive."""
        others = [] if run.own_drive else [other for other in self._runs.values() if not other.own_drive]
        parts: dict[str, F32] = {}
        for other in (run, *others):
            comparison = steps[other.label][1].sighting.comparison
            values = comparison.descriptors
            if what == "distances":
                values = dict(zip(comparison.channels, comparison.distances, strict=False))
            parts = dict(values) | parts
        return parts

    def draw(self, steps: Mapping[str, Step], matches: Sequence[BestMatch]) -> None:
        """Log where the best matches were taken, and their histograms."""
        self._draw_places(steps, {match.label: match.pose for match in matches})
        index = self._library.index
        for match in matches:
            run = self._runs[match.label]
            references = {
                channel: index[channel].references[match.entry] for channel in match.ranks if channel in index
            }
            sample = self._shared(run, steps, "descriptors")
            charts = draw_grid(self._cells[run.label], sample, references, run.number)
            self._rec.log(bars_of(run.label, "charts"), row_of(rr.EncodedImage, blob=blob_of(charts)))

    def draw_estimates(self, steps: Mapping[str, Step]) -> None:
        """Log in place of matches where runs that compare no pictures think they are."""
        others = [label for label in self._runs if label not in self._cells]
        self._draw_places(steps, {label: steps[label][1].estimate.pose for label in others})

    def _draw_places(self, steps: Mapping[str, Step], poses: Mapping[str, F64]) -> None:
        """Log poses (3,) on the small map, with the names of their runs where there is room."""
        truths = [moment.truth[:2] for moment, _ in steps.values() if moment.truth is not None]
        places, true = (
            self._scale.screen(np.array(some).reshape(-1, 2))
            for some in ([pose[:2] for pose in poses.values()], truths)
        )
        for (label, pose), at, name_at in zip(
            poses.items(), places, self._names_at(places, true), strict=True
        ):
            vector = heading_vector(float(pose[2]), ARROW * self._long)
            self._rec.log(
                taken_of(label),
                row_of(rr.Points2D, positions=points_of(at)),
                row_of(rr.Arrows2D, origins=points_of(at), vectors=points_of(vector)),
            )
            name = row_of(rr.Points2D, positions=points_of(name_at))
            self._rec.log(f"{taken_of(label)}/{NAME}", name)

    def _names_at(self, places: F32, truths: F32) -> list[F32]:
        """Return where the names of places (K, 2) stand: as far as can be from all else."""
        under = np.array((0, TRUTH_NAME * self._long), np.float32)  # the name of a truth hangs below it
        places_taken = [*places, *truths, *(truths + under)]
        names: list[F32] = []
        for at in places:
            options = np.clip(at + NAMES_AT * self._long, *self._names_within)
            away = np.hypot(*(options[:, None] - np.array(places_taken)).transpose(2, 0, 1)).min(axis=1)
            names.append(options[int(np.minimum(away, CLEAR * self._long).argmax())])
            places_taken.append(names[-1])
        return names


def cells_of_run(run: RunView, runs: Sequence[RunView], scene: Scene) -> list[Cell]:
    """Return the cells of a run: its own channels before those of others; color, edges, the rest."""
    own = dict.fromkeys(run.distances)
    names = dict.fromkeys([*own, *(channel for other in runs for channel in other.distances)])
    order = sorted(names, key=lambda name: (name not in own, name != COLOR, not name.startswith(EDGES)))
    index = scene.library.index
    return cells_of({name: len(index[name].relevance) for name in order if name in index})


def letters(width_px: float) -> int:
    """Return how many letters of a label fit into a view of this width."""
    return int((width_px - AROUND_PX) / LETTER_PX)


def match_view(run: RunView, runs: Sequence[RunView]) -> rrb.Spatial2DView:
    """Show the best match of one of the runs, said as what it is; in two lines where it is narrow."""
    path, room, label = run.paths.match(1), letters(view_px(runs)[0]), font_safe(run.short)
    is_wide = len(BEST) + 1 + len(label) <= room
    text = f"{BEST} {label}" if is_wide else f"{BEST}\n{label}"
    at = [(CELL_PX / 2, -(NAME_ABOVE if is_wide else TWO_LINES_ABOVE) * CELL_PX)]
    name = rr.Points2D.from_fields(positions=at, labels=[text])
    return named_view("Best match", path, {f"{path}/{NAME}": name})


def matches_map(runs: Sequence[RunView], scene: Scene) -> rrb.Spatial2DView:
    """Show on a small map where each best match was taken, and the robot; of other runs the estimate."""
    contents, overrides = [BARE_FLOORS, WALLS], Overrides()
    for run in runs:
        contents.append(f"{taken_of(run.label)}/**")
        if scene.has_truth:
            truth = entities.truth_of(run.label, run.own_drive)
            contents.append(truth)
            overrides[truth] = labeled("truth")[:2]
    contents += [entities.MATCHES]
    return plane_view("Where matches were taken", list(dict.fromkeys(contents)), small_map(scene), overrides)


def small_map(scene: Scene) -> Extent:
    """Return what the small map shows: the arena, with a caption above it."""
    extent, side = arena_extent(scene.arena, scene.scale), long_side(scene.arena, scene.scale)
    around, top = AROUND_MAP * side, extent.top - CAPTION_MAP * side
    return Extent(extent.left - around, extent.right + around, top, extent.bottom + around)


def view_px(runs: Sequence[RunView]) -> tuple[float, float]:
    """Return width and height of the histograms of each run, on a screen of 1280 x 800."""
    beside = 3 if any(run.own_drive for run in runs) else 2  # with the camera of each drive
    return 1024 / max(len(runs), 1) / beside, 172 - 8.5 * (len(runs) - 2)


def charts_key(runs: Sequence[RunView], cells: Sequence[Cell]) -> str:
    """Return what bars and lines are, in as few lines as there is room for."""
    room = letters(view_px(runs)[0])
    lines: list[str] = []
    for part in CHARTS_KEY[: 3 if any(cell.channel.startswith(EDGES) for cell in cells) else 2]:
        if lines and len(lines[-1]) + len(part) + 2 <= room:
            lines[-1] += f", {part}"
        else:
            lines.append(part)
    return "\n".join(lines)


def _key_px(runs: Sequence[RunView], cells: Sequence[Cell]) -> float:
    return CHARTS_KEY_PX + CHARTS_LINE_PX * (1 + charts_key(runs, cells).count("\n"))


def chart_stretch(runs: Sequence[RunView], cells: Sequence[Cell]) -> float:
    """Return how many times as high as drawn the charts are shown, to fill their view."""
    width, height = view_px(runs)
    return (height - _key_px(runs, cells)) * COLUMNS * WIDE_PX / width / (rows_of(cells) * HIGH_PX)


def histograms_view(run: RunView, runs: Sequence[RunView], scene: Scene) -> rrb.Spatial2DView:
    """Show the histograms of what the robot saw under those of a run's best match."""
    cells, width = cells_of_run(run, runs, scene), COLUMNS * WIDE_PX
    high = chart_stretch(runs, cells) * HIGH_PX * rows_of(cells)
    extent = Extent(0, width, 0, high + _key_px(runs, cells) * width / view_px(runs)[0])
    return plane_view(f"Histograms of {run.label}"[:25], f"{bars_of(run.label)}/**", extent)
