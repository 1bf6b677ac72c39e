"""All quantities with one number per update, over the session."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.events import events_view
from ..panels.traces import (
    cloud_plots,
    error_plots,
    evidence_key,
    evidence_plot,
    key_share,
    survival_plots,
    truth_plots,
    who_is_who,
)
from ..scene import RunView, SceneInfo


def layout(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Container:
    """Plot one quantity per panel, one line per run."""
    labels = [run.label for run in runs]
    who = who_is_who(labels)  # stands in the first title
    columns = []
    if scene.has_truth:
        columns.append(rrb.Vertical(*error_plots(labels, scene, who), *truth_plots(labels)))
    cloud = cloud_plots(labels, scene, "" if scene.has_truth else who)
    columns.append(rrb.Vertical(*cloud, *survival_plots(labels)))
    return rrb.Horizontal(*columns, _last(runs))


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, one panel per run, over the key of its lines and the events."""
    titles = {run.label: f"{run.label}: " if len(runs) > 1 else "" for run in runs}
    evidence = [evidence_plot(RunPaths(run.label), titles[run.label]) for run in runs]
    by_channels = {run.channels: run for run in reversed(runs)}  # the same channels have the same key
    first_ones = [run for run in runs if by_channels[run.channels] is run]
    if len(first_ones) > 1:
        keys = [evidence_key(RunPaths(run.label), titles[run.label]) for run in first_ones]
        key: rrb.Tabs | rrb.Spatial2DView = rrb.Tabs(*keys, active_tab=0)
    else:
        key = evidence_key(RunPaths(runs[0].label))
    shares = [2.4 / len(runs)] * len(runs) + [key_share(runs[0]), 0.45 + 0.42 * len(runs)]
    return rrb.Vertical(*evidence, key, events_view(list(titles)), row_shares=shares)
