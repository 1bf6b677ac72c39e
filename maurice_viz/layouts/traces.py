"""Everything that is one number an update, over the whole session."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from maurice_mcl.filter.estimate import CONFIDENCE_M

from ..entities import RunPaths
from ..panels.events import events_view
from ..panels.traces import (
    ANCESTORS,
    CONFIDENCE,
    EFFECTIVE,
    HEADING_ERROR,
    POSITION_ERROR,
    SPREAD,
    SURVIVORS,
    TRUTH_RANK,
    TRUTH_RATIO,
)
from ..scene import RunView, SceneInfo
from ..style import COLOR_WORDS
from .plots import compared, evidence_key, evidence_plot, key_share


def layout(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Container:
    """Plot one quantity a panel, a line a run."""
    labels = [run.label for run in runs]
    unit = shown.scale.units.name
    who = "".join(f"{', ' if k else ': '}{label} {COLOR_WORDS[k]}" for k, label in enumerate(labels))
    who = who if len(runs) > 1 else ""
    near = shown.scale.say(CONFIDENCE_M)
    of_truth = [
        compared(POSITION_ERROR, f"Position error ({unit}){who}", labels),
        compared(HEADING_ERROR, "Heading error (deg)", labels),
        compared(TRUTH_RATIO, "Log-likelihood of truth less estimate (nats)", labels),
        compared(TRUTH_RANK, "Rank of the truth's reference (1 is best)", labels),
    ]
    of_cloud = [
        compared(SPREAD, f"Spread of the cloud ({unit})" + ("" if shown.has_truth else who), labels),
        compared(CONFIDENCE, f"Confidence (share of weight within {near})", labels, top=1.1),
        compared(EFFECTIVE, "Effective sample size (share of particles)", labels, top=1.1),
        compared(SURVIVORS, "Survivors of resampling (share)", labels, top=1.1),
        compared(ANCESTORS, "Distinct ancestors ten updates back (share)", labels, top=1.1),
    ]
    left = [*of_truth] if shown.has_truth else []
    columns = [rrb.Vertical(*column) for column in (left, of_cloud) if column]
    return rrb.Horizontal(*columns, _last(runs))


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, a panel a run, over the key of its lines and the events."""
    labels = [run.label for run in runs]
    evidence = [evidence_plot_of(run, len(runs) > 1) for run in runs]
    by_channels = {run.channels: run for run in reversed(runs)}  # the same channels have the same key
    several = len(by_channels) > 1
    keys = [evidence_key_of(run, several) for run in runs if by_channels[run.channels] is run]
    key = rrb.Tabs(*keys, active_tab=0) if several else keys[0]
    shares = [2.4 / len(runs)] * len(runs) + [key_share(runs[0]), 0.45 + 0.42 * len(runs)]
    return rrb.Vertical(*evidence, key, events_view(labels), row_shares=shares)


def evidence_plot_of(run: RunView, several: bool) -> rrb.TimeSeriesView:
    """Plot a run's evidence; with its label where there are several."""
    return evidence_plot(RunPaths(run.label), f"{run.label}: " if several else "")


def evidence_key_of(run: RunView, several: bool) -> rrb.Spatial2DView:
    """Show the colors of a run's evidence; with its label where others have other channels."""
    return evidence_key(RunPaths(run.label), f"{run.label}: " if several else "")
