"""The rule against a baseline: how often it fails where nothing changed, and what it sees."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.scoring.demands import CONVERGED, KEPT, LOCALIZED, Demands, RunJudgement
from maurice_mcl.values.arrays import F64
from maurice_viz.app.check.rules import LEAST_PAIRS, WORSE_P, BaselineChange, changes
from maurice_viz.style import Scale, units_named

DEMANDS = Demands(max_error_m=np.inf, localized_by=20, converged_by=20)
KINDS = (LOCALIZED, KEPT, CONVERGED)


def compared(before_m: F64, after_m: F64, limit_m: float) -> tuple[BaselineChange, ...]:
    """Compare runs by their errors; demands are met by those below a limit, each with a limit of its own."""

    def judgements(errors_m: F64) -> list[RunJudgement]:
        limits = limit_m * np.array([1.0, 1.2, 0.9])
        return [
            RunJudgement(seed, dict(zip(KINDS, (error_m < limits).tolist(), strict=True)), error_m=error_m)
            for seed, error_m in enumerate(errors_m.tolist())
        ]

    old = {run.seed: run for run in judgements(before_m)}
    return changes(old, judgements(after_m), DEMANDS, Scale(units_named("m")))


@pytest.mark.parametrize("seeds", [LEAST_PAIRS, 20])
@pytest.mark.parametrize("limit_m", [0.2, 0.4])  # met by half of the runs, and by most
def test_what_did_not_change_fails_no_more_often_than_promised(seeds: int, limit_m: float) -> None:
    rng, trials = np.random.default_rng(1), 400
    failed = 0
    for _ in range(trials):
        before, after = rng.gamma(4.0, 0.05, (2, seeds))
        failed += not all(change.passed for change in compared(before, after, limit_m))
    nominal = WORSE_P / 2
    assert failed / trials < nominal + 4 * np.sqrt(nominal * (1 - nominal) / trials)


def test_a_change_for_the_worse_is_seen_and_one_for_the_better_passes() -> None:
    before = np.random.default_rng(2).gamma(4.0, 0.05, 12)
    worse = compared(before, before + 0.5, 0.5)
    assert [change.passed for change in worse] == [False] * 4
    assert all(change.passed for change in compared(before + 0.5, before, 0.5))
    assert all(change.passed for change in compared(before, before + 0.0005, 0.5))  # another machine
