"""A branched run in words: when it parts from the run, how both end, and what would have helped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..style import Scale

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


def what_if_line(found: Mapping[str, Any], scale: Scale) -> str:
    """Return one line about a branch, from what `WhatIf.to_json` holds about it."""
    change, start = ", ".join(found["change"]), found["from_step"]
    head = f"From step {start} with {change}" if change else "Nothing changed"
    if found["differs"] is None:
        return f"{head}: the branch is the run, bit for bit, up to step {found['same_until']}."
    step, field = found["differs"]["step"], found["differs"]["field"]
    what = next(text for begin, text in DIFFERENCES.items() if field.startswith(begin))
    same = f"the same bit for bit up to step {step - 1}, " if step > start + 1 else ""
    apart = "never part" if found["parted_at"] is None else f"part at step {found['parted_at']}"
    return (
        f"{head}: {same}{what} at step {step}; the estimates {apart}. {_ends(found['after_branch'], scale)}"
    )


def _ends(after: Mapping[str, Mapping[str, Any]], scale: Scale) -> str:
    run, branch = after["run"], after["branch"]
    if branch["error_mean_m"] is None:
        return "There is no truth to judge either by."
    then, now = (scale.say(one["error_mean_m"]) for one in (run, branch))
    share, before = (f"{one['localized_share']:.0%}" for one in (branch, run))
    return f"Since then {now} off on average (was {then}), localized at {share} of the steps (was {before})."


HOLM = "p < 0.05 after Holm"  # for the number of remedies
USUALLY = 0.8  # least share of the seeds in which a remedy that is proposed is localized at the end
LUCK = 0.8  # share of the seeds from which on a run that is not changed would usually have been right


def remedies_line(found: Mapping[str, Any]) -> str:
    """Return one line about remedies, from what `Remedies.to_json` holds."""
    was, tried = found["as_it_was"], found["tried"]
    best = next((one for one in tried if one["name"] == found["proposed"]), None)
    before = f"as it was in {_share(was)}"
    if best is not None:
        text = f"{best['name']} helps ({HOLM}): localized at the end in {_share(best)} seeds, {before}"
        good = [one for one in tried if one["verdict"] == "better" and one["localized"]["value"] >= USUALLY]
        others = [one["name"] for one in good if one is not best]
        return f"{text}. {_also(others)}"
    some = next((one for one in tried if one["verdict"] == "better"), None)
    if some is not None:
        text = f"{some['name']} is better ({HOLM}), but localized at the end in only {_share(some)} seeds"
        return f"{text}, {before}: nothing tried helps reliably."
    right = f"localized at the end in {_share(was)} seeds"
    if was["localized"]["value"] >= LUCK:
        other = f"with other noise from step {found['from_step']} on, the run as it was is {right}"
        return f"No remedy is better ({HOLM}): {other}."
    advice = "`maurice-replay diagnose` says why it was lost"
    return f"Nothing tried helps ({HOLM}): the run as it was is {right}; {advice}."


def _share(one: Mapping[str, Any]) -> str:
    localized = one["localized"]
    return f"{round(localized['value'] * localized['count'])} of {localized['count']}"


def _also(others: Sequence[str]) -> str:
    if not others:
        return "Nothing else helps as reliably."
    return f"So do: {', '.join(others)}."
