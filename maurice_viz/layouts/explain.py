"""Why the winner wins: the references that matter side by side, at every update."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from maurice_mcl.analysis.explanation import ESTIMATE, TRUTH, WINNER

from .. import entities
from ..drawing.canvas import map_extent
from ..entities import RunPaths
from ..explanations.paths import NAMES, card_path, chart_path, columns_of, marks_path, table_path
from ..panels.explanation import FOOT_NATS
from ..scene import RunView, SceneInfo
from ..style import GROUND
from .views import camera_view, edges_view, map_view, text_view

TITLES = {TRUTH: "Truth's reference", ESTIMATE: "Estimate's reference", WINNER: "Winning reference"}
MOST_NAMED = 6  # channels that a title lists
LOSES = "of each channel: nats it loses · distance D · quality · rank"
SIDES = {2: "left {}, right {}", 3: "left {}, middle {}, right {}"}
LEFT_SHARE = 1.9  # how much higher than the words a square map is
FEW_CHANNELS = 4  # beyond it the table gets more of the screen


def layout(run: RunView, shown: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the map and the words left; the references, their charts and their figures right."""
    paths, whose = RunPaths(run.label), columns_of(shown.has_truth)
    left = rrb.Vertical(marks_view(paths, shown), text_view(paths), row_shares=[map_share(shown), 1])
    seen = rrb.Vertical(camera_view(), edges_view())
    cards = rrb.Horizontal(seen, *(card_view(paths, who) for who in whose))
    sides = SIDES[len(whose)].format(*(NAMES[who] for who in whose))
    heights = f"Descriptors (1: usual top): picture blue, reference orange, both pale; {sides}"
    costs = f"What each element costs (nats; tint {FOOT_NATS:g} high): {_named(run.channels)}"
    table = rrb.TextDocumentView(name=f"Figures ({LOSES})", origin=table_path(paths))
    right = rrb.Vertical(
        cards,
        chart_view(paths, heights, "tints", "reference", "sample"),
        chart_view(paths, costs, "feet", "cost"),
        table,
        row_shares=[1.2, 0.5, 0.6, 1.32 + 0.19 * max(len(run.channels) - FEW_CHANNELS, 0)],
    )
    return rrb.Horizontal(left, right, column_shares=[1, 1.9])


def map_share(shown: SceneInfo) -> float:
    """Give how much higher than the words the map is: as much as its shape needs, and neither too little."""
    extent = map_extent(shown.arena, shown.scale)
    return float(np.clip(LEFT_SHARE * extent.height / extent.width, 1.0, 2.6))


def marks_view(paths: RunPaths, shown: SceneInfo) -> rrb.Spatial2DView:
    """Show where the references of the columns are, over the match circles and under truth and estimate."""
    contents = [entities.FLOORS, entities.WALLS, entities.EXPLAIN_KEY, paths.circles, marks_path(paths)]
    contents.append(f"{paths.estimate}/**")
    contents += [f"{entities.TRUTH}/**"] if shown.has_truth else []
    return map_view(
        f"Match circles, and the references explained ({shown.scale.units.name})", contents, shown
    )


def card_view(paths: RunPaths, who: str) -> rrb.Spatial2DView:
    """Show a reference's picture over its edges."""
    return rrb.Spatial2DView(name=TITLES[who], origin=card_path(paths, who), background=GROUND)


def chart_view(paths: RunPaths, name: str, *kinds: str) -> rrb.BarChartView:
    """Show bars of some kinds, a block a reference."""
    return rrb.BarChartView(
        name=name,
        origin="/",
        contents=[f"{chart_path(paths, kind)}/**" for kind in kinds],
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _named(channels: tuple[str, ...]) -> str:
    if len(channels) > MOST_NAMED:
        return f"{len(channels)} channels as in the table"
    return ", ".join(channels)
