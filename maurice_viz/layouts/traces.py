"""Everything that is one number an update, over the whole session."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..draw_events import events_view
from ..draw_traces import (
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
from ..entities import RunPaths
from .plots import COLOR_WORDS, compared, evidence_plot
from .shown import Run, Shown


def layout(runs: Sequence[Run], shown: Shown) -> rrb.Container:
    """Plot one quantity a panel, a line a run."""
    labels = [run.label for run in runs]
    unit = shown.scale.units.name
    who = ", ".join(f"{label} {word}" for label, word in zip(labels, COLOR_WORDS, strict=False))
    of_truth = [
        compared(POSITION_ERROR, f"Position error ({unit}): {who}", labels),
        compared(HEADING_ERROR, "Heading error (deg)", labels),
        compared(TRUTH_RATIO, "Log-likelihood of truth less estimate (nats)", labels),
        compared(TRUTH_RANK, "Rank of the truth's reference (1 is best)", labels),
    ]
    of_cloud = [
        compared(SPREAD, f"Spread of the cloud ({unit})" + ("" if shown.has_truth else f": {who}"), labels),
        compared(CONFIDENCE, "Confidence (share of weight within 12 in)", labels, top=1.1),
        compared(EFFECTIVE, "Effective sample size (share of particles)", labels, top=1.1),
        compared(SURVIVORS, "Survivors of resampling (share)", labels, top=1.1),
        compared(ANCESTORS, "Distinct ancestors ten updates back (share)", labels, top=1.1),
    ]
    evidence = [evidence_plot_of(run, len(runs) > 1) for run in runs]
    left = [*of_truth] if shown.has_truth else []
    last = rrb.Vertical(*evidence, events_view(labels), row_shares=[*(2.0 for _ in evidence), 1.2])
    columns = [rrb.Vertical(*column) for column in (left, of_cloud) if column]
    return rrb.Horizontal(*columns, last)


def evidence_plot_of(run: Run, several: bool) -> rrb.TimeSeriesView:
    """Plot a run's evidence; with its label where there are several."""
    return evidence_plot(RunPaths(run.label), f"{run.label}: " if several else "")
