"""Where everything stands when one update is explained at full size, on a screen of 1600 x 1000."""

from __future__ import annotations

import rerun.blueprint as rrb

from maurice_mcl.analysis.explanation import ASKED, ESTIMATE, TRUTH, WINNER, Explained, StepExplanation
from maurice_mcl.sensor.descriptors import CHANNELS

from .. import entities
from ..entities import RunPaths
from ..explanations.paths import marks_path, table_path
from ..panels.explanation_screen import (
    bars_path,
    costliest_first,
    edges_path,
    notes_path,
    picture_path,
    words_path,
)
from ..panels.pictures import EDGE_GAIN
from ..scene import SceneInfo
from ..style import GROUND
from .explain import LOSES
from .views import camera_view, edges_view, map_view

WHO = {TRUTH: "Truth's", ESTIMATE: "Estimate's", WINNER: "Winner", ASKED: "Asked for"}


def full(paths: RunPaths, step: StepExplanation, shown: SceneInfo) -> rrb.Blueprint:
    """Lay out map, camera and words left; a column a reference right, over the table of their figures."""
    name = f"Match circles (area: likelihood), particles, references ({shown.scale.units.name})"
    contents = [entities.FLOORS, entities.WALLS, paths.circles, paths.particles, marks_path(paths)]
    contents += [f"{paths.estimate}/**"] + ([f"{entities.TRUTH}/**"] if shown.has_truth else [])
    left = rrb.Vertical(
        map_view(name, contents, shown, paths.particles),
        rrb.Horizontal(camera_view(), edges_view()),
        rrb.TextDocumentView(name="Why the winner wins", origin=words_path(paths)),
        row_shares=[1.7, 0.85, 2.3],
    )
    columns = rrb.Horizontal(*(_column(paths, explained, step) for explained in step.shown))
    table = rrb.TextDocumentView(name=f"Figures ({LOSES})", origin=table_path(paths))
    notes = rrb.TextDocumentView(name="How to read this", origin=notes_path(paths))
    below = rrb.Horizontal(table, notes, column_shares=[0.7 * len(step.shown), 1])
    right = rrb.Vertical(columns, below, row_shares=[24, 8.5 + len(step.channels)])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[1, 2.1]),
        rrb.TimePanel(state="collapsed", timeline=entities.STEP, play_state="paused"),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _column(paths: RunPaths, explained: Explained, step: StepExplanation) -> rrb.Vertical:
    """Show one reference; the channel that costs most has the first tab, the same in all columns."""
    who, channels = explained.who, [step.channels[k] for k in costliest_first(step)]
    entry = "none" if explained.entry is None else f"entry {explained.entry.entry}"
    descriptors = [_chart(paths, who, c, "descriptor", f"{c} ({_unit(c)})") for c in channels]
    costs = [_chart(paths, who, c, "cost", f"{c}, nats") for c in channels]
    return rrb.Vertical(
        _image(f"{WHO[who]}: {entry}", picture_path(paths, who)),
        _image(f"Its edges x {EDGE_GAIN}", edges_path(paths, who)),
        rrb.Tabs(*descriptors, active_tab=0),
        rrb.Tabs(*costs, active_tab=0),
        row_shares=[0.9, 0.9, 1.2, 1.2],
    )


def _image(name: str, path: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(name=name, origin=path, background=GROUND)


def _chart(paths: RunPaths, who: str, channel: str, kind: str, name: str) -> rrb.BarChartView:
    return rrb.BarChartView(
        name=name,
        origin="/",
        contents=[f"{bars_path(paths, who, channel, kind)}/**"],
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _unit(channel: str) -> str:
    return CHANNELS[channel].unit if channel in CHANNELS else "its own unit"
