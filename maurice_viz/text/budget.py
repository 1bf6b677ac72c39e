"""An error budget in words and as rows of a table."""

from __future__ import annotations

from maurice_datasets.trials.budget import ErrorBudget

from ..style import units_named


def budget_rows(found: ErrorBudget) -> list[tuple[str, ...]]:
    """Return a row for each part: its name, error, interval, lost runs, what it costs, and how much."""
    per_m = units_named(found.display_units).per_m
    digits = units_named(found.display_units).digits
    rows: list[tuple[str, ...]] = []
    for one in found.parts:
        error, cost = one.error, one.cost
        told = ("", "") if cost is None else (one.costs, cost.said(per_m, digits, "+"))
        lost = f"{100 * one.lost.value:.0f} %"
        rows.append((one.part, error.said(per_m, digits), lost, *told))
    return rows


def say_budget(found: ErrorBudget) -> str:
    """Say in one sentence which part costs most."""
    units, most, as_is = units_named(found.display_units), found.costliest, found.parts[0]
    if as_is.lost.value >= OFTEN:
        share = f"{100 * as_is.lost.value:.0f} %"
        return f"It is lost in {share} of its runs, and errors are those of lost runs; first `diagnose` it."
    if most is None or most.cost is None:
        return "No cost is above 0 with 95 % confidence; more seeds or drives narrow the intervals."
    whole, cost = found.parts[0].error.value, most.cost.value
    share = f"{100 * min(cost / whole, 1):.0f} %"
    value, error = (f"{length * units.per_m:.{units.digits}f}" for length in (cost, whole))
    return f"The {most.costs} costs most: {value} of {error} {units.name} ({share}). {ADVICE[most.costs]}"


OFTEN = 0.5  # share of lost runs from which on an error says little
ADVICE = {
    "odometry": "Calibrate the motion model (`calibrate motion`), or measure movements better.",
    "sensor model": "Try other features (`compare --feature`), tune them to the library (`library tune`).",
    "distance between references": "Add references (`library check` says where).",
    "number of particles": "Use more particles (`--particles`).",
}
