"""Views that layouts are made of: maps, pictures, histograms, words. Every one has a title with a unit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.api import VisualizerLike
from rerun.encodings import EntityPathLike

from maurice_mcl.sensor.descriptors import CHANNELS

from .. import entities
from ..drawing.canvas import Extent, map_extent
from ..entities import RunPaths
from ..panels.filmstrip import COLUMNS, size_px
from ..panels.headings import REACH
from ..panels.likelihood import names
from ..panels.modes import HEIGHT, LENGTH, MARGIN
from ..panels.pictures import EDGE_GAIN
from ..scene import SceneInfo
from ..style import GROUND, TRUTH

Overrides = dict[EntityPathLike, VisualizerLike | Iterable[VisualizerLike]]

MAP = (entities.FLOORS, entities.WALLS)
LEGEND = ": picture blue, match orange, both pale"
SHORT_LEGEND = ", match orange"
SMALL_AND_WHITE = rr.Points2D.from_fields(colors=[TRUTH], radii=rr.components.Radius.ui_points(1.0))


def map_view(
    name: str, contents: list[str], shown: SceneInfo, white_cloud: str | None = None
) -> rrb.Spatial2DView:
    """Show some entities on the map, the whole of which is seen; a cloud can be drawn small and white."""
    overrides: Overrides = {white_cloud: SMALL_AND_WHITE} if white_cloud else {}
    return drawn_over(name, contents, map_extent(shown.arena, shown.scale), overrides)


def drawn_over(
    name: str, contents: list[str], extent: Extent, overrides: Overrides | None = None
) -> rrb.Spatial2DView:
    """Show some entities in a part of the map's plane, all of which is seen."""
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


def arena_view(
    paths: RunPaths, shown: SceneInfo, title: str = "", name: str = "Belief: particles by weight"
) -> rrb.Spatial2DView:
    """Show the map with the weighted cloud, the estimate and the truth."""
    contents = [*MAP, entities.NODES, entities.WEIGHT_KEY, f"{paths.at('belief')}/**"]
    if shown.has_truth:
        contents.append(f"{entities.TRUTH}/**")
    return map_view(f"{title}{name} ({shown.scale.units.name})", contents, shown)


def circles_view(paths: RunPaths, shown: SceneInfo, title: str = "") -> rrb.Spatial2DView:
    """Show the match circles with the cloud in white over them."""
    contents = [*MAP, entities.MATCH_KEY]
    contents += [f"{paths.at('match')}/**", f"- {paths.contact_sheet}", paths.particles]
    return map_view(f"{title}Match circles ({shown.scale.units.name})", contents, shown, paths.particles)


def likelihood_tabs(paths: RunPaths, channels: Sequence[str], shown: SceneInfo) -> list[rrb.Spatial2DView]:
    """Show the likelihood over the whole map, all channels together and each alone, under the cloud."""
    views: list[rrb.Spatial2DView] = []
    for channel in names(tuple(channels)):
        contents = [*MAP, entities.LIKELIHOOD_KEY, paths.likelihood(channel), paths.particles]
        contents += [f"{paths.at('belief', 'estimate')}/**"]
        contents += [f"{entities.TRUTH}/**"] if shown.has_truth else []
        title = f"Likelihood: {channel} ({shown.scale.units.name})"
        views.append(map_view(title if not views else channel, contents, shown, paths.particles))
    return views


def closeup_view(paths: RunPaths, shown: SceneInfo, name: str) -> rrb.Spatial2DView:
    """Show the cloud from near: the view follows it, and a bar says how near."""
    contents = [*MAP, entities.NODES, f"{paths.at('belief')}/**", f"{paths.closeup}/**"]
    contents += [f"{entities.TRUTH}/**"] if shown.has_truth else []
    return rrb.Spatial2DView(
        name=name,
        origin=paths.closeup,
        contents=contents,
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(-1, 1), y_range=(-1, 1)),
    )


def rose_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show which way the cloud looks."""
    return rrb.Spatial2DView(
        name="Headings (deg)",
        origin="/",
        contents=f"{paths.rose}/**",
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(-REACH, REACH), y_range=(-REACH, REACH)),
    )


def river_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show how the weight was shared among the modes of the last updates."""
    left, right, top, bottom = MARGIN
    return rrb.Spatial2DView(
        name="Modes: share of the weight (%), a color each",
        origin="/",
        contents=f"{paths.river}/**",
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(-left, LENGTH + right), y_range=(-top, HEIGHT + bottom)),
    )


def film_view(paths: RunPaths, shown: SceneInfo) -> rrb.Spatial2DView:
    """Show what was seen in the last updates, over the references at the truth and at the estimate."""
    width, height = size_px(shown.picture_height, shown.has_truth)
    return rrb.Spatial2DView(
        name=f"Last {COLUMNS} updates: seen, and the references there",
        origin="/",
        contents=f"{paths.at('film')}/**",
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(0, width), y_range=(0, height)),
    )


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
    return rrb.Tabs(*histograms(paths, channels, "", LEGEND), active_tab=0)


def difference_tabs(paths: RunPaths, channels: Sequence[str]) -> rrb.Tabs:
    """Show how far each bin is off, a tab a channel."""
    return rrb.Tabs(*differences(paths, channels), active_tab=0)


def histograms(paths: RunPaths, channels: Sequence[str], rest: str, legend: str) -> list[rrb.BarChartView]:
    """The legend stands in the first tab's title: in the chart it would cover bars."""
    titles = [f"{c}{rest}{'' if k else f' ({CHANNELS[c].unit}){legend}'}" for k, c in enumerate(channels)]
    kinds = ("bands", "reference", "sample")
    return [chart(paths, c, title, kinds) for c, title in zip(channels, titles, strict=True)]


def differences(paths: RunPaths, channels: Sequence[str]) -> list[rrb.BarChartView]:
    """Show what each element adds to the distance D from the best match, a view a channel."""
    rests = [", D: what each element adds to it", *(", D" for _ in channels[1:])]
    kinds = ("difference_bands", "difference")
    return [chart(paths, c, f"{c}{rest}", kinds) for c, rest in zip(channels, rests, strict=True)]


def chart(paths: RunPaths, channel: str, name: str, kinds: Sequence[str]) -> rrb.BarChartView:
    """Show bars of some kinds in one chart."""
    contents = [f"{paths.histogram(channel, kind)}/**" for kind in kinds]
    return rrb.BarChartView(
        name=name[0].upper() + name[1:],
        origin="/",
        contents=contents,
        plot_legend=rrb.PlotLegend(visible=False),
    )
