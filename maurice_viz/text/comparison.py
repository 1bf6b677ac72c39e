"""How runs compare, in words: at a step and over the drive; what a branch or a remedy changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from maurice_mcl.scoring.comparison import ErrorDifference, Step
from maurice_mcl.scoring.table import SEARCHING
from maurice_mcl.values import Radii

from ..playback import RunResult
from ..style import Scale, units_named

if TYPE_CHECKING:
    from maurice_datasets.trials.budget import ErrorBudget


NOT_YET = "How the runs compare over the drive is told when they have ended."
LEAST_CLOSER = 1 / 18  # of the radius `right`: a smaller difference is none


def least_closer_m(radii: Radii) -> float:
    """Return how much closer a run must be to the truth to be called closer."""
    return LEAST_CLOSER * radii.right_m


def errors_m(steps: Mapping[str, Step]) -> dict[str, float]:
    """Return the position error of each run whose truth is known, the smallest first."""
    off = {
        label: float(np.hypot(*(record.estimate.pose - moment.truth)[:2]))
        for label, (moment, record) in steps.items()
        if moment.truth is not None
    }
    return dict(sorted(off.items(), key=lambda item: item[1]))


def closest(steps: Mapping[str, Step], radii: Radii) -> str | None:
    """Return the label of the run that is closer to the truth than all others, if one is."""
    off = list(errors_m(steps).items())
    if len(off) < 2 or off[1][1] - off[0][1] < least_closer_m(radii):
        return None
    return off[0][0]


def drive_words(results: Sequence[RunResult], scale: Scale) -> str:
    """Return how each run compares with the first over the drive, with its interval."""
    lines, compared = [], [results[0]]
    for result in results[1:]:
        paired = result.paired
        if paired is None:
            continue
        parted = "" if paired.parted_at is None else f" They part at step {paired.parted_at}."
        if paired.position is not None:
            compared.append(result)
            lines.append(f"{_difference(results[0], result, paired.position, scale)}{parted}")
        elif paired.apart_mean_m is not None:
            apart = scale.say(paired.apart_mean_m)
            lines.append(f"`{result.label}` is {apart} from it.{parted}")
    if not lines:
        return NOT_YET
    lost = not_averaged(*compared) if len(compared) > 1 else ""
    lines += [f"No average{'s' * (len(compared) > 2)}, as {lost}."] * bool(lost)
    return " ".join([f"Over the drive, against `{results[0].label}`:", *lines])


def not_averaged(*results: RunResult) -> str:
    """Return which runs failed, so that an average tells nothing: "`a` was lost from step 41"; or empty."""
    failed = [(run.label, e) for run in results for e in run.verdict.episodes if e.is_failure]
    first = dict(reversed(failed))
    was = {True: "not localized", False: "lost"}
    return " and ".join(
        f"`{label}` was {was[episode.kind == SEARCHING]} from step {episode.onset}"
        for label, episode in reversed(first.items())
    )


def _difference(first: RunResult, result: RunResult, off: ErrorDifference, scale: Scale) -> str:
    steps = f"closer at {off.better} of {off.updates} steps"
    if not_averaged(first, result):
        return f"`{result.label}` is {steps}."
    mean = f"`{result.label}` is **{_closer(off.mean, scale)}** on average"
    chance = "hardly chance" if off.is_sure else "**may be chance**"
    if off.agrees:
        which = "closer" if off.better else "farther"
        return f"{mean}, {which} at every one of {off.updates} steps, {blocks_of(off)}: {chance}."
    if off.interval is None:
        return f"{mean}, {steps}: {chance}, as the steps are few or one stretch of them decides."
    low, high = off.interval
    return f"{mean} (95 %: {_closer(high, scale)} to {_closer(low, scale)}): {chance}; {steps}."


def blocks_of(off: ErrorDifference) -> str:
    """Return the sample that steps which all agree are: "6 blocks of 19 that count as one each"."""
    if off.block == 1:
        return "which count one each"
    return f"{off.blocks} blocks of {off.block} that count as one each"


def _closer(difference_m: float, scale: Scale) -> str:
    return f"{scale.say(abs(difference_m))} {'closer' if difference_m <= 0 else 'farther'}"


# What if: a branch beside its run, remedies, and the error budget.

BRANCH = "branch"  # first word of what a branched run adds to its log

# what of an update differs first, by the beginning of its field in a saved run
DIFFERENCES = {
    "particles.log_weight": "the weights differ",
    "particles.carried": "the weights differ",
    "particles.": "the particles differ",
    "particles": "the number of particles differs",
    "renewed": "the particles after resampling differ",
    "events": "what becomes of the particles differs",
    "": "the evidence differs",
}


def what_if_line(facts: Mapping[str, Any], scale: Scale) -> str:
    """Return one line about a branch, from what `WhatIf.to_json` holds about it."""
    change, start = ", ".join(facts["change"]), facts["from_step"]
    head = f"From step {start} with {change}" if change else "Nothing changed"
    if facts["differs"] is None:
        return f"{head}: the branch is the run, bit for bit, up to step {facts['same_until']}."
    step, field = facts["differs"]["step"], facts["differs"]["field"]
    what = next(text for begin, text in DIFFERENCES.items() if field.startswith(begin))
    same = f"the same bit for bit up to step {step - 1}, " if step > start + 1 else ""
    parting = "never part" if facts["parted_at"] is None else f"part at step {facts['parted_at']}"
    return (
        f"{head}: {same}{what} at step {step}; the estimates {parting}. {_ends(facts['after_branch'], scale)}"
    )


def _ends(after: Mapping[str, Mapping[str, Any]], scale: Scale) -> str:
    run, branch = after["run"], after["branch"]
    if branch["error_mean_m"] is None:
        return "There is no truth to judge either by."
    then, now = (scale.say(facts["error_mean_m"]) for facts in (run, branch))
    before, share = (f"{facts['localized_share']:.0%}" for facts in (run, branch))
    return f"Since then {now} off on average (was {then}), localized at {share} of the steps (was {before})."


HOLM = "p < 0.05"  # adjusted by Holm for the number of remedies
USUAL_SHARE = 0.8  # of the seeds, in which a run has to be localized at the end to be usually right


def remedies_line(facts: Mapping[str, Any]) -> str:
    """Return one line about remedies, from what `Remedies.to_json` holds."""
    was, tried = facts["as_it_was"], facts["tried"]
    best = next((remedy for remedy in tried if remedy["name"] == facts["proposed"]), None)
    before = f"as it was in {_share(was)}"
    better = [remedy for remedy in tried if remedy["verdict"] == "better"]
    if best is not None:
        text = f"{best['name']} helps ({HOLM}): localized at the end in {_share(best)} seeds, {before}"
        good = [remedy for remedy in better if remedy["localized"]["value"] >= USUAL_SHARE]
        others = [remedy["name"] for remedy in good if remedy is not best]
        return f"{text}. So do: {', '.join(others)}." if others else f"{text}. {NOTHING_ELSE}"
    if better:
        name, share = better[0]["name"], _share(better[0])
        text = f"{name} is better ({HOLM}), but localized at the end in only {share} seeds"
        return f"{text}, {before}: nothing tried helps reliably."
    right = f"localized at the end in {_share(was)} seeds"
    if was["localized"]["value"] >= USUAL_SHARE:
        other = f"with other noise from step {facts['from_step']} on, the run as it was is {right}"
        return f"No remedy is better ({HOLM}): {other}."
    advice = "`maurice-replay diagnose` says why it was lost"
    return f"Nothing tried helps ({HOLM}): the run as it was is {right}; {advice}."


NOTHING_ELSE = "Nothing else helps as reliably."


def _share(remedy: Mapping[str, Any]) -> str:
    localized = remedy["localized"]
    return f"{round(localized['value'] * localized['count'])} of {localized['count']}"


# An error budget.

LOST_SHARE = 0.5  # of the runs, from which on an error says little
ADVICE = {
    "odometry": "Calibrate the motion model (`calibrate drive`), or measure movements better.",
    "sensor model": "Try other features (`compare --feature`), tune them to the library (`library tune`).",
    "distance between references": "Add references (`library check` says where).",
    "number of particles": "Use more particles (`--particles`).",
}


def budget_rows(budget: ErrorBudget) -> list[tuple[str, ...]]:
    """Return a row for each part: its name, error, interval, lost runs, what it costs, and how much."""
    units = units_named(budget.display_units)
    rows: list[tuple[str, ...]] = []
    for part in budget.parts:
        cost = ("", "")
        if part.cost is not None:
            cost = (part.costs, part.cost.text(units.per_m, units.digits, "+"))
        error, lost = part.error.text(units.per_m, units.digits), f"{100 * part.lost.value:.0f} %"
        rows.append((part.part, error, lost, *cost))
    return rows


def say_budget(budget: ErrorBudget) -> str:
    """Say in one sentence which part costs most."""
    units, most, as_is = units_named(budget.display_units), budget.costliest, budget.parts[0]
    if as_is.lost.value >= LOST_SHARE:
        share = f"{100 * as_is.lost.value:.0f} %"
        return f"It is lost in {share} of its runs, and errors are those of lost runs; first `diagnose` it."
    if most is None or most.cost is None:
        return "No cost is above 0 with 95 % confidence; more seeds or drives narrow the intervals."
    error_m, cost_m = as_is.error.value, most.cost.value
    share = f"{100 * min(cost_m / error_m, 1):.0f} %"
    cost, error = (f"{length_m * units.per_m:.{units.digits}f}" for length_m in (cost_m, error_m))
    return f"The {most.costs} costs most: {cost} of {error} {units.name} ({share}). {ADVICE[most.costs]}"
