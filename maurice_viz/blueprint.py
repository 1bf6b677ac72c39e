"""Layouts: where everything stands on a screen of 1600 x 1000, as functions of what is present."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.api import VisualizerLike
from rerun.encodings import EntityPathLike

from maurice_mcl.arena import Arena
from maurice_mcl.channels import CHANNELS

from . import entities
from .canvas import map_extent
from .draw_pictures import EDGE_GAIN
from .draw_traces import CONFIDENCE, EFFECTIVE, HEADING_ERROR, POSITION_ERROR, SPREAD
from .entities import RunPaths
from .look import GROUND, RUN_COLORS, TRUTH, Scale

Overrides = dict[EntityPathLike, VisualizerLike | Iterable[VisualizerLike]]

FPS = 4.0
LEGEND = ": picture white, match orange"
SHORT_LEGEND = ", match orange"
SMALL_AND_WHITE = rr.Points2D.from_fields(colors=[TRUTH], radii=rr.components.Radius.ui_points(1.0))
COLOR_WORDS = ("orange", "sky blue", "pink", "green")  # of RUN_COLORS, in order


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What a layout has to know of what will be drawn."""

    arena: Arena
    scale: Scale
    has_truth: bool


@dataclass(frozen=True, slots=True)
class Run:
    """One run: its label, and the channels whose histograms there are."""

    label: str
    channels: tuple[str, ...]


def single(run: Run, shown: Shown) -> rrb.Blueprint:
    """Lay out one run: the arena and the words left, matching in the middle, pictures and traces right."""
    paths = RunPaths(run.label)
    distances, *others = _single_traces(paths, shown)
    left = rrb.Vertical(arena_view(paths, shown), text_view(paths), distances, row_shares=[2.6, 0.85, 1.2])
    middle = rrb.Vertical(
        circles_view(paths, shown),
        histogram_tabs(paths, run.channels),
        difference_tabs(paths, run.channels),
        row_shares=[1.85, 1, 1],
    )
    right = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        sheet_view(paths),
        *others,
        row_shares=[1.3, 0.8] + [2 / len(others)] * len(others),
    )
    return _screen(rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1]))


def compare(runs: Sequence[Run], shown: Shown) -> rrb.Blueprint:
    """Lay out runs of one drive: the first left, the others right, what they share between them."""
    first, *others = runs
    middle = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        *_compared_traces([run.label for run in runs], shown),
    )
    columns = [_side(first, shown), middle, *(_side(run, shown) for run in others)]
    return _screen(rrb.Horizontal(*columns, column_shares=[1.2, 1.0] + [1.2] * len(others)))


def for_runs(runs: Sequence[Run], shown: Shown) -> rrb.Blueprint:
    """Lay out as many runs as there are: one by itself, more side by side."""
    return single(runs[0], shown) if len(runs) == 1 else compare(runs, shown)


def _side(run: Run, shown: Shown) -> rrb.Vertical:
    paths = RunPaths(run.label)
    title = f"{run.label}: "
    return rrb.Vertical(
        rrb.Tabs(arena_view(paths, shown, title), circles_view(paths, shown, title)),
        sheet_view(paths, title),
        rrb.Tabs(
            *_histograms(paths, run.channels, "", SHORT_LEGEND),
            *_differences(paths, run.channels, " D"),
            active_tab=0,
        ),
        text_view(paths, title),
        row_shares=[2.6, 0.95, 1.3, 0.95],
    )


def _screen(body: rrb.Horizontal) -> rrb.Blueprint:
    return rrb.Blueprint(
        body,
        rrb.TimePanel(state="collapsed", timeline=entities.STEP, fps=FPS, play_state="paused"),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _map_view(
    name: str, contents: list[str], shown: Shown, white_cloud: str | None = None
) -> rrb.Spatial2DView:
    extent = map_extent(shown.arena, shown.scale)
    overrides: Overrides = {white_cloud: SMALL_AND_WHITE} if white_cloud else {}
    return rrb.Spatial2DView(
        name=name,
        origin="/",
        contents=contents,
        background=GROUND,
        overrides=overrides,
        visual_bounds=rrb.VisualBounds2D(
            x_range=(extent.left, extent.right), y_range=(extent.top, extent.bottom)
        ),
    )


def arena_view(paths: RunPaths, shown: Shown, title: str = "") -> rrb.Spatial2DView:
    """Show the map with the weighted cloud, the estimate and the truth."""
    contents = [f"{entities.WORLD}/**", f"- {entities.MATCH_KEY}", f"{paths.at('belief')}/**"]
    if shown.has_truth:
        contents.append(f"{entities.TRUTH}/**")
    return _map_view(f"{title}Belief: particles by weight ({shown.scale.units.name})", contents, shown)


def circles_view(paths: RunPaths, shown: Shown, title: str = "") -> rrb.Spatial2DView:
    """Show the match circles with the cloud in white over them."""
    contents = [f"{entities.WORLD}/**", f"- {entities.WEIGHT_KEY}", f"- {entities.NODES}"]
    contents += [f"{paths.at('match')}/**", f"- {paths.contact_sheet}", paths.particles]
    return _map_view(f"{title}Match circles ({shown.scale.units.name})", contents, shown, paths.particles)


def camera_view() -> rrb.Spatial2DView:
    """Show what the robot saw."""
    return rrb.Spatial2DView(name="Camera (px)", origin=entities.CAMERA, background=GROUND)


def edges_view() -> rrb.Spatial2DView:
    """Show the edge image of what the robot saw."""
    return rrb.Spatial2DView(name=f"Edges x {EDGE_GAIN} (px)", origin=entities.EDGES, background=GROUND)


def sheet_view(paths: RunPaths, title: str = "") -> rrb.Spatial2DView:
    """Show the five best references."""
    return rrb.Spatial2DView(
        name=f"{title}Five best references (q = match quality, 0 to 1)",
        origin=paths.contact_sheet,
        background=GROUND,
    )


def text_view(paths: RunPaths, title: str = "") -> rrb.TextDocumentView:
    """Show in words what happened."""
    return rrb.TextDocumentView(name=f"{title}What this step did", origin=paths.text)


def histogram_tabs(paths: RunPaths, channels: Sequence[str]) -> rrb.Tabs:
    """Show the picture's histogram over its best match's, a tab a channel."""
    return rrb.Tabs(*_histograms(paths, channels, "", LEGEND), active_tab=0)


def difference_tabs(paths: RunPaths, channels: Sequence[str]) -> rrb.Tabs:
    """Show how far each bin is off, a tab a channel."""
    return rrb.Tabs(*_differences(paths, channels, " difference by element"), active_tab=0)


def _histograms(paths: RunPaths, channels: Sequence[str], rest: str, legend: str) -> list[rrb.BarChartView]:
    """The legend stands in the first tab's title: in the chart it would cover bars."""
    titles = [f"{c}{rest}{'' if k else f' ({CHANNELS[c].unit}){legend}'}" for k, c in enumerate(channels)]
    kinds = ("bands", "reference", "sample")
    return [_chart(paths, c, title, kinds) for c, title in zip(channels, titles, strict=True)]


def _differences(paths: RunPaths, channels: Sequence[str], rest: str) -> list[rrb.BarChartView]:
    return [_chart(paths, c, f"{c}{rest}", ("difference_bands", "difference")) for c in channels]


def _chart(paths: RunPaths, channel: str, name: str, kinds: Sequence[str]) -> rrb.BarChartView:
    contents = [f"{paths.histogram(channel, kind)}/**" for kind in kinds]
    return rrb.BarChartView(
        name=name[0].upper() + name[1:],
        origin="/",
        contents=contents,
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _single_traces(paths: RunPaths, shown: Shown) -> list[rrb.TimeSeriesView]:
    unit = shown.scale.units.name
    both = [paths.trace(CONFIDENCE), paths.trace(EFFECTIVE)]
    shares = _plot("Confidence orange, effective sample blue (share)", both, top=1.1)
    if not shown.has_truth:
        return [_plot(f"Spread of the cloud ({unit})", [paths.trace(SPREAD)]), shares]
    distances = [paths.trace(POSITION_ERROR), paths.trace(SPREAD)]
    return [
        _plot(f"Position error orange, spread blue ({unit})", distances),
        _plot("Heading error (deg)", [paths.trace(HEADING_ERROR)]),
        shares,
    ]


def _compared_traces(labels: Sequence[str], shown: Shown) -> list[rrb.TimeSeriesView | rrb.Tabs]:
    who = ", ".join(f"{label} {word}" for label, word in zip(labels, COLOR_WORDS, strict=False))
    unit = shown.scale.units.name
    plots = [(SPREAD, f"Spread ({unit})" if shown.has_truth else f"Spread ({unit}): {who}")]
    if shown.has_truth:
        plots = [
            (POSITION_ERROR, f"Position error ({unit}): {who}"),
            (HEADING_ERROR, "Heading error (deg)"),
            *plots,
        ]
    *above, spread = [_compared(quantity, name, labels) for quantity, name in plots]
    confidence = _compared(CONFIDENCE, "Confidence (share)", labels, top=1.1)
    effective = _compared(EFFECTIVE, "ESS (share)", labels, top=1.1)
    if not above:
        return [spread, confidence, effective]
    return [*above, rrb.Tabs(spread, confidence, effective, active_tab=0)]


def _compared(
    quantity: str, name: str, labels: Sequence[str], top: float | None = None
) -> rrb.TimeSeriesView:
    paths = [RunPaths(label).trace(quantity) for label in labels]
    colors: Overrides = {
        path: rr.SeriesLines.from_fields(colors=[color])
        for path, color in zip(paths, RUN_COLORS, strict=False)
    }
    return _plot(name, paths, top, colors)


def _plot(
    name: str,
    contents: list[str],
    top: float | None = None,
    overrides: Overrides | None = None,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=contents,
        overrides=overrides,
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, top)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
