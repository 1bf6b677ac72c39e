"""What a replay ends with: a table for people, JSON for programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from maurice_mcl.success import LEFT, Success

from .look import Units
from .replaying import RunResult

Cell = Callable[[RunResult, Units], str]


def to_json(results: Sequence[RunResult]) -> dict[str, Any]:
    """Give `{"runs": [...]}` in metres and radians; null where a figure does not apply."""
    return {"runs": [_run_json(result) for result in results]}


def _run_json(result: RunResult) -> dict[str, Any]:
    score = result.score
    return {
        "label": result.label,
        "updates": score.updates,
        "distance_m": score.distance_m,
        "position_error_mean_m": score.position_error_mean_m,
        "position_error_median_m": score.position_error_median_m,
        "position_error_final_m": score.position_error_final_m,
        "heading_error_mean_rad": score.heading_error_mean_rad,
        "heading_error_median_rad": score.heading_error_median_rad,
        "localized_at_update": score.localized_at_update,
        "localized_share": score.localized_share,
        "lost": score.lost,
        "lost_at_update": score.lost_at_update,
        "reached": score.reached,
        "wrong_confident_share": score.wrong_confident_share,
        "thesis_success": {one.preset: _success_json(one) for one in score.success},
        "steps_per_s": result.steps_per_s,
    }


def _success_json(success: Success) -> dict[str, Any]:
    return {
        "at_update": success.at_update,
        "at_m": success.at_m,
        "at_s": success.at_s,
        "failed": success.failed,
        "failed_at_update": success.failed_at_update,
    }


def to_table(results: Sequence[RunResult], units: Units, title: str) -> Table:
    """Give a table with a column a run, in the session's own units."""
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    table.add_column("")
    for result in results:
        table.add_column(result.label, justify="right")
    for name, cell in _rows(units):
        table.add_row(name, *(cell(result, units) for result in results))
    return table


def _rows(units: Units) -> list[tuple[str, Cell]]:
    return [
        ("updates", lambda r, u: str(r.score.updates)),
        (f"distance ({units.name})", lambda r, u: _length(r.score.distance_m, u)),
        (f"position error, mean ({units.name})", lambda r, u: _length(r.score.position_error_mean_m, u)),
        (f"position error, median ({units.name})", lambda r, u: _length(r.score.position_error_median_m, u)),
        (f"position error, final ({units.name})", lambda r, u: _length(r.score.position_error_final_m, u)),
        ("heading error, mean (deg)", lambda r, u: _degrees(r.score.heading_error_mean_rad)),
        ("localized share", lambda r, u: _share(r.score.localized_share)),
        ("localized at update", lambda r, u: _or_never(r.score.localized_at_update, r.score.lost)),
        ("lost", lambda r, u: _lost(r)),
        ("wrong and confident", lambda r, u: _share(r.score.wrong_confident_share)),
        ("localized (thesis, sd < 10 %)", lambda r, u: _success(r, "tenth", u)),
        ("localized (thesis, one foot)", lambda r, u: _success(r, "circle", u)),
        ("filter steps a second", lambda r, u: "-" if r.steps_per_s is None else f"{r.steps_per_s:.0f}"),
    ]


def _length(value_m: float | None, units: Units) -> str:
    return "-" if value_m is None else f"{value_m * units.per_m:.{units.digits}f}"


def _degrees(value_rad: float | None) -> str:
    return "-" if value_rad is None else f"{np.rad2deg(value_rad):.1f}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"


def _or_never(update: int | None, lost: bool | None) -> str:
    if lost is None:  # no truth to say so
        return "-"
    return "never" if update is None else str(update)


def _lost(result: RunResult) -> str:
    score = result.score
    if score.lost is None:
        return "-"
    if score.lost:
        return f"at update {score.lost_at_update}"
    return "no, goal reached" if score.reached else "no"


def _success(result: RunResult, preset: str, units: Units) -> str:
    """Say when, and how far driven by then; or how it failed."""
    for one in result.score.success:
        if one.preset == preset:
            if one.failed == LEFT:
                return f"left the truth at {one.failed_at_update}"
            if one.at_update is not None and one.at_m is not None and one.at_s is not None:
                return f"update {one.at_update}, {_length(one.at_m, units)} {units.name}, {one.at_s:.0f} s"
            return "no, 5 min over" if one.failed else "no"
    return "-"
