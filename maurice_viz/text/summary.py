"""The scores of runs as rows of a table and as JSON, how several differ, and the names of trials."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from maurice_mcl.reasons.causes import Failure
from maurice_mcl.scoring.comparison import (
    CAMERA,
    SENSORS,
    ComparisonResult,
    ErrorDifference,
)
from maurice_mcl.scoring.metrics import LEFT_TRUTH, SEGMENT_RADII, RelativeError
from maurice_mcl.scoring.table import SEARCHING
from maurice_mcl.values import INCH_M, Radii, plain, plain_value

from ..playback import RunResult
from ..style import Scale, Units
from .causes import say_failure, steps_text
from .comparison import not_averaged
from .verdict import headline

Cell = Callable[[RunResult], str]
ONE_LOST = "one was lost"  # instead of an average
UNDECIDED = "undecided"  # instead of an interval: the drive is too short, or one stretch of it decides


def score_rows(results: Sequence[RunResult], units: Units) -> list[tuple[str, list[str]]]:
    """Return the rows of a table of scores in display units: a name, and one cell per run."""
    return [(name, [cell(result) for result in results]) for name, cell in _rows(units, results)]


def short_rows(results: Sequence[RunResult], units: Units) -> list[tuple[str, list[str]]]:
    """Return the five rows that say most; where no run is judged by a truth, what is known without one."""
    unit = units.name
    rows: list[tuple[str, Cell]] = [
        (f"error, mean ({unit})", lambda r: _length(r.score.error_mean_m, units)),
        ("heading error, mean (deg)", lambda r: _degrees(r.score.heading_error_mean_rad)),
        ("localized", lambda r: _written(r.score.localized_share, ".0%")),
        ("lost", _lost),
        ("why", _why),
    ]
    if not any(result.verdict.has_truth for result in results):
        rows = [
            ("steps", lambda r: str(r.score.updates)),
            ("dots together", lambda r: f"{r.verdict.converged_share:.0%}"),
            ("knows where it is", _known),
            ("probably lost", _probably_lost),
            ("why", _why),
        ]
    return [(name, [cell(result) for result in results]) for name, cell in rows]


def _why(result: RunResult) -> str:
    """Return the causes of a run's failures, each once."""
    titles = dict.fromkeys(failure.title for failure in result.verdict.failures)
    return ", ".join(titles) or "-"


def paired_rows(results: Sequence[RunResult], units: Units) -> list[tuple[str, list[str]]]:
    """Return the rows that compare every run with the first: a name and one cell per run."""
    if len(results) == 1:
        return []
    first, many = results[0].label, 1 / units.per_m
    degrees = float(np.deg2rad(1))
    lost = {run.label for run in results if not_averaged(results[0], run)}
    averages: list[tuple[str, Callable[[ComparisonResult], str]]] = [
        (f"error against {first}, 95 % ({units.name})", lambda p: _against(p.position, many, units.digits)),
        (f"heading against {first}, 95 % (deg)", lambda p: _against(p.heading, degrees, 1)),
    ]
    rows: list[tuple[str, Callable[[ComparisonResult], str]]] = [
        (f"closer to the truth than {first}", lambda p: _closer(p.position)),
        (f"distance to {first}, mean ({units.name})", lambda p: _length(p.apart_mean_m, units)),
        (f"parts from {first}", _parts),
    ]
    return [
        *((name, [_cell(run, cell, lost) for run in results]) for name, cell in averages),
        *((name, [_cell(run, cell) for run in results]) for name, cell in rows),
    ]


def _cell(run: RunResult, cell: Callable[[ComparisonResult], str], lost: Collection[str] = ()) -> str:
    """Return a cell of a run that is compared; of a run whose average would be that of a loss what it is."""
    if run.paired is None:
        return ""
    return ONE_LOST if run.label in lost else cell(run.paired)


def _against(difference: ErrorDifference | None, unit: float, digits: int) -> str:
    return "-" if difference is None else say_difference(difference, unit, digits)


def say_difference(difference: ErrorDifference, unit: float, digits: int) -> str:
    """Write a mean difference and its 95 % interval in multiples of `unit`: "-0.4 [-0.9, 0.1]"."""
    ends = () if difference.interval is None else difference.interval
    mean, *interval = (f"{value / unit:z.{digits}f}" for value in (difference.mean, *ends))
    agreement = (
        f"all {difference.blocks} blocks agree" if difference.agrees and difference.is_sure else UNDECIDED
    )
    return f"{mean} [{', '.join(interval) or agreement}]"


def _closer(difference: ErrorDifference | None) -> str:
    return "-" if difference is None else f"at {difference.better} of {difference.updates} steps"


def _parts(paired: ComparisonResult) -> str:
    if paired.apart_mean_m is None:  # runs of different drives
        return "-"
    return "never" if paired.parted_at is None else f"at step {paired.parted_at}"


def _rows(units: Units, results: Sequence[RunResult]) -> list[tuple[str, Cell]]:
    unit = units.name
    return [
        ("steps", lambda r: str(r.score.updates)),
        (f"distance ({unit})", lambda r: _length(r.score.distance_m, units)),
        (f"position error, mean ({unit})", lambda r: _length(r.score.error_mean_m, units)),
        (f"position error, median ({unit})", lambda r: _length(r.score.error_median_m, units)),
        (f"position error, final ({unit})", lambda r: _length(r.score.error_final_m, units)),
        (f"without the {_sensors(results)}, mean ({unit})", lambda r: _length(_alone_m(r), units)),
        ("heading error, mean (deg)", lambda r: _degrees(r.score.heading_error_mean_rad)),
        (
            f"RPE over {_segment(results, units)}, median ({unit}, deg)",
            lambda r: _relative(r.score.relative, units),
        ),
        ("localized share", lambda r: _written(r.score.localized_share, ".0%")),
        ("localized", _localized),
        ("lost or carried, wrong from", _wrong),
        ("declared lost", _lost),
        ("wrong and confident", lambda r: _written(r.score.wrong_confident_share, ".0%")),
        ("knows where it is, without truth", _known),
        ("probably lost, without truth", _probably_lost),
        ("localized (thesis, sd < 10 %)", lambda r: _success(r, "tenth", units)),
        ("localized (thesis, one foot)", lambda r: _success(r, "circle", units)),
        (f"right, converged, lost ({unit})", lambda r: _radii(r.radii, units)),
        ("filter steps per second", lambda r: _written(r.steps_per_s, ".0f")),
    ]


def _sensors(results: Sequence[RunResult]) -> str:
    """Return what the runs had besides odometry, which is not known of those without a known start."""
    known = {alone.sensors for run in results if (alone := run.verdict.odometry_alone) is not None}
    return CAMERA if known == {CAMERA} else SENSORS


def _alone_m(result: RunResult) -> float | None:
    alone = result.verdict.odometry_alone
    return None if alone is None else alone.error_mean_m


def _known(result: RunResult) -> str:
    return "-" if result.signal is None else f"{result.signal.share:.0%}"


def _probably_lost(result: RunResult) -> str:
    steps = [steps_text(first, last) for first, last in result.verdict.doubts]
    if not steps:
        return "-" if result.signal is None else "no"
    return steps[0] + (f", {len(steps) - 1} more" if len(steps) > 1 else "")


def _written(value: float | None, how: str, per_unit: float = 1.0) -> str:
    return "-" if value is None else f"{value * per_unit:{how}}"


def _degrees(value_rad: float | None) -> str:
    return "-" if value_rad is None else f"{np.rad2deg(value_rad):.1f}"


def _length(value_m: float | None, units: Units) -> str:
    return _written(value_m, f".{units.digits}f", units.per_m)


def _segment(results: Sequence[RunResult], units: Units) -> str:
    """Return the length of a segment of the relative pose error, which follows from a run's radii."""
    lengths = {f"{_length(SEGMENT_RADII * run.radii.right_m, units)} {units.name}" for run in results}
    return lengths.pop() if len(lengths) == 1 else f"{SEGMENT_RADII:g} x right"


def _relative(error: RelativeError | None, units: Units) -> str:
    """Return the relative pose error of position and heading."""
    if error is None:
        return "-"
    return f"{_length(error.position_median_m, units)}, {_degrees(error.heading_median_rad)}"


def _radii(radii: Radii, units: Units) -> str:
    """Return the radii that a run was judged by."""
    return ", ".join(_length(radius_m, units) for radius_m in (radii.right_m, radii.cluster_m, radii.lost_m))


def _localized(result: RunResult) -> str:
    if not result.verdict.has_truth:
        return "-"
    return "never" if result.verdict.localized is None else f"from step {result.verdict.localized}"


def _wrong(result: RunResult) -> str:
    """Return from which step on a run that had been right was wrong."""
    wrong = [episode.wrong for episode in result.verdict.episodes if episode.wrong is not None]
    more = f", {len(wrong) - 1} more" if len(wrong) > 1 else ""
    if wrong:
        return f"step {wrong[0]}{more}"
    return "-" if result.score.lost is None or result.verdict.localized is None else "never"


def _lost(result: RunResult) -> str:
    if result.score.lost is None:
        return "-"
    lost = [episode for episode in result.verdict.episodes if episode.lost is not None]
    if not lost:
        return "no"
    if lost[0].kind == SEARCHING and len(lost) == 1:
        never = lost[0].localized is None
        return "never localized" if never else f"no, localized from step {lost[0].localized}"
    lost = [episode for episode in lost if episode.kind != SEARCHING]
    return f"at step {lost[0].lost}" + (f", {len(lost) - 1} more" if len(lost) > 1 else "")


def _success(result: RunResult, preset: str, units: Units) -> str:
    """Return when the run succeeded, after what distance and time; or how it failed."""
    success = next((success for success in result.score.success if success.preset == preset), None)
    if success is None:
        return "-"
    if success.failed == LEFT_TRUTH:
        return f"left the truth at step {success.failed_at_step}"
    if success.at_step is not None and success.at_m is not None and success.at_s is not None:
        length = f"{_length(success.at_m, units)} {units.name}"
        return f"step {success.at_step}, {length}, {success.at_s:.0f} s"
    return "no, 5 min over" if success.failed else "no"


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table whose first column has names and whose others have numbers."""
    lines = [heads, ["---", *["---:"] * (len(heads) - 1)], *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def escaped(text: str) -> str:
    """Return a label with Markdown's signs escaped."""
    return "".join(f"\\{sign}" if sign in "\\`*_|[]<>#~" else sign for sign in text)


# Trials.

METRIC_UNITS = {"_m": ("in", 1 / INCH_M), "_rad": ("deg", 180 / math.pi), "_s": ("s", 1.0)}


def metric_title(metric: str) -> tuple[str, float]:
    """Return the title of a metric with its unit, and the factor that brings it there."""
    for ending, (unit, factor) in METRIC_UNITS.items():
        if metric.endswith(ending):
            return f"{metric.removesuffix(ending).replace('_', ' ')} ({unit})", factor
    from maurice_datasets.trials.rows import (
        SCHEMA,  # loads polars and the simulation, which a replay does without
    )

    flag = str(SCHEMA[metric][0]) == "Boolean"
    return f"{metric.replace('_', ' ')}{' (%)' if flag else ''}", 100.0 if flag else 1.0


def name_of(row: Mapping[str, Any]) -> str:
    """Return what names a run within its folder: PART/SESSION/VARIANT/SEED."""
    return f"{row['part']}/{row['session']}/{row['variant']}/{row['seed']}"


# The same as JSON: numbers in meters and radians, texts in the units of the session.


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
    "error_mean_m",
    "error_median_m",
    "error_final_m",
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
    relative = plain_value(result.score.relative)
    scores["localized_at_step"] = result.verdict.localized
    lost = (episode.lost for episode in result.verdict.episodes if episode.lost is not None)
    scores["lost_at_step"] = next(lost, None)  # declared, also while it had not been localized yet
    scores["relative_error"] = relative
    scores["knows_where_it_is"] = _signal_json(result)
    scores["odometry_alone"] = _alone_json(result)
    tail = {"thesis_success": success, "radii": plain(result.radii), "steps_per_s": result.steps_per_s}
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
    errors_m = {"error_mean_m": alone.error_mean_m, "error_final_m": alone.error_final_m}
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
        "text": headline({result.label: verdict}, scale),
        "in_obstacles": plain_value(verdict.in_obstacles),
        "episodes": [plain(episode) | {"text": episode.account} for episode in verdict.episodes],
        "failures": [failure_json(failure, scale) for failure in verdict.failures],
        "causes": plain_value(verdict.incidents),
    }


def failure_json(failure: Failure, scale: Scale) -> dict[str, Any]:
    """Return a failure as JSON, with its cause in words."""
    return plain(failure) | {"text": say_failure(failure, scale)}


def _values(of: object, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(of, name) for name in names}
