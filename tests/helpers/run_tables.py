"""Tables of runs made by hand: the columns that a test asks for, the others as those of a run at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import KINDS, OF_A_RUN, OF_THE_DRIVE, SIZES, RunTable
from maurice_mcl.values.library import USUAL


def run_table(updates: int, **columns: Any) -> RunTable:
    """A run whose steps are counted from 1, right at (0, 0, 0), with some columns as they are given."""
    empty = {
        name: np.zeros((updates, *SIZES.get(name, ())), KINDS.get(name, "float64"))
        for name in (*OF_THE_DRIVE, *OF_A_RUN)
    }
    steps = np.arange(1, updates + 1, dtype=np.int32)
    usual = {"steps": steps, "times_s": steps.astype(float), "events": ((),) * updates}
    return RunTable(**({"seed": 0, "radii": USUAL} | empty | usual | columns))


def scored_table(scores: Sequence[StepScore], **columns: Any) -> RunTable:
    """A run of which each update has these errors and is as converged; None where the truth is not known."""
    off = [(score.error_m, 0.0, score.heading_error_rad) for score in scores]
    converged = np.array([float(score.converged) for score in scores])
    return run_table(len(scores), truths=np.array(off, float).reshape(-1, 3), converged=converged, **columns)
