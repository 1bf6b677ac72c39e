"""The scores of runs as JSON: numbers in meters and radians, texts in the units of the session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from maurice_mcl.reasons.causes import Failure
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.comparison import ErrorDifference

from ..playback import RunResult
from ..style import Scale
from .causes import say_failure
from .verdict import say_verdict


def to_json(results: Sequence[RunResult], scale: Scale) -> dict[str, Any]:
    """Return `{"runs": [...]}` in meters and radians; null where a figure does not apply.

    Texts for people are in the units of `scale`.

    If several runs are compared, each has "against_first", which is null for the first one.
    """
    if len(results) == 1:
        return {"runs": [_run_json(results[0], scale)]}
    return {"runs": [_run_json(run, scale) | {"against_first": _paired_json(run)} for run in results]}


def _paired_json(result: RunResult) -> dict[str, Any] | None:
    paired = result.paired
    if paired is None:
        return None
    return {
        "label": result.against,
        "position_error": _difference_json(paired.position, "m"),
        "heading_error": _difference_json(paired.heading, "rad"),
        "apart_mean_m": paired.apart_mean_m,
        "apart_most_m": paired.apart_most_m,
        "parted_at_step": paired.parted_at,
    }


def _difference_json(difference: ErrorDifference | None, unit: str) -> dict[str, Any] | None:
    if difference is None:
        return None
    return {
        f"difference_mean_{unit}": difference.mean,
        f"interval_95_{unit}": None if difference.interval is None else list(difference.interval),
        "block_steps": difference.block,
        "steps": difference.updates,
        "better": difference.better,
        "worse": difference.worse,
    }


SCORES = (
    "updates",
    "distance_m",
    "position_error_mean_m",
    "position_error_median_m",
    "position_error_final_m",
    "heading_error_mean_rad",
    "heading_error_median_rad",
    "localized_share",
    "lost",
    "reached",
    "wrong_confident_share",
)
SUCCESS = ("at_step", "at_m", "at_s", "failed", "failed_at_step")


def _run_json(result: RunResult, scale: Scale) -> dict[str, Any]:
    success = {success.preset: _values(success, SUCCESS) for success in result.score.success}
    scores = _values(result.score, SCORES)
    head = {"label": result.label, "verdict": _verdict_json(result, scale)}
    relative = None if result.score.relative is None else asdict(result.score.relative)
    scores["localized_at_step"] = result.verdict.localized
    scores["lost_at_step"] = _lost_at(result.verdict)
    scores["relative_error"] = relative
    scores["knows_where_it_is"] = _signal_json(result)
    scores["odometry_alone"] = _alone_json(result)
    tail = {"thesis_success": success, "radii": asdict(result.radii), "steps_per_s": result.steps_per_s}
    return head | scores | tail


def _signal_json(result: RunResult) -> dict[str, Any] | None:
    signal = result.signal
    if signal is None:
        return None
    spans = [{"from_step": first, "to_step": last} for first, last in result.verdict.doubts]
    return {"share": signal.share, "at_end": signal.at_end, "probably_lost": spans}


def _alone_json(result: RunResult) -> dict[str, Any] | None:
    alone = result.verdict.odometry_alone
    if alone is None:
        return None
    errors_m = {"position_error_mean_m": alone.error_mean_m, "position_error_final_m": alone.error_final_m}
    return errors_m | {"run_against_it": _difference_json(alone.against, "m"), "better": alone.is_better}


def _verdict_json(result: RunResult, scale: Scale) -> dict[str, Any]:
    verdict = result.verdict
    return {
        "updates": verdict.updates,
        "has_truth": verdict.has_truth,
        "found": verdict.localized,
        "decisive": verdict.decisive,
        "error_end_m": verdict.error_end_m,
        "error_most_m": verdict.error_most_m,
        "most_at": verdict.most_at,
        "left_map": list(verdict.left_map),
        "text": say_verdict(verdict, scale),
        "in_obstacles": [asdict(stay) for stay in verdict.in_obstacles],
        "episodes": [asdict(episode) | {"text": episode.account} for episode in verdict.episodes],
        "failures": [failure_json(failure, scale) for failure in verdict.failures],
        "causes": [asdict(incident) for incident in verdict.incidents],
    }


def failure_json(failure: Failure, scale: Scale) -> dict[str, Any]:
    """Return a failure as JSON, with its cause in words."""
    return asdict(failure) | {"also": list(failure.also), "text": say_failure(failure, scale)}


def _values(of: object, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(of, name) for name in names}


def _lost_at(verdict: RunVerdict) -> int | None:
    """Return the first step at which a run was declared lost, also while it had not been localized yet."""
    return next((episode.lost for episode in verdict.episodes if episode.lost is not None), None)
