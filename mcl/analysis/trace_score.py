"""The score of a run from its trace: the same numbers as `maurice_mcl.score` of its records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..filter.batch import RunTrace
from ..map import Arena
from ..session import Moment
from .metrics import MORE_THAN, RunScore, Scorer, SuccessJudge, is_tenth


def score_trace(trace: RunTrace, moments: Sequence[Moment], arena: Arena | None = None) -> RunScore:
    """Score a trace of `run_batch` against the truth of the moments it was made from."""
    scorer, judge = Scorer(), None if arena is None else SuccessJudge(arena.size_m)
    for update, moment in enumerate(moments):
        estimate = trace.estimate(update)
        scorer.add(estimate, moment.truth, moment.frame.motions)
        if judge is not None:
            tenth = is_tenth(estimate.converged, trace.mean_sd_m[update], judge.arena_m)
            circle = bool(trace.circle[update] > MORE_THAN)
            judge.see(moment.frame, estimate, (tenth, circle), moment.truth)
    return replace(scorer.result(), success=() if judge is None else judge.result())
