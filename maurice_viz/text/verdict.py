"""The verdict in words: one line that says what happened to one run, or to several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from maurice_mcl.analysis.events import KIDNAPPED
from maurice_mcl.analysis.verdict import RunVerdict, Trouble

from ..style import Scale

SURE = ", and sure of it"
NOTHING_YET = "No update yet."


def verdict_line(verdicts: Mapping[str, RunVerdict], scale: Scale) -> str:
    """Return one line about all runs of a recording, shared part first: "Kidnapped at 61. `a` ..."."""
    if len(verdicts) == 1:
        return said(next(iter(verdicts.values())), scale)
    shared = _kidnapped_at(list(verdicts.values()))
    parts = [f"`{label}` {_predicate(one, scale, bool(shared))}" for label, one in verdicts.items()]
    return f"{shared}{'; '.join(parts)}."


def said(verdict: RunVerdict, scale: Scale) -> str:
    """Return one line about one run."""
    if not verdict.updates:
        return NOTHING_YET
    shared = _kidnapped_at([verdict])
    rest = f"{_predicate(verdict, scale, bool(shared))}."
    left = f" Its cloud would have left the map at {_listed(verdict.left_map)}." if verdict.left_map else ""
    return f"{shared}{rest[:1].upper()}{rest[1:]}{left}"


def _kidnapped_at(verdicts: list[RunVerdict]) -> str:
    """Return the kidnappings in the log that all runs share: "Kidnapped at 61. "."""
    at = [[t.step for t in one.troubles if t.kind == KIDNAPPED] for one in verdicts]
    if not at[0] or any(other != at[0] for other in at):
        return ""
    return f"Kidnapped at {_listed(at[0])}. "


def _predicate(verdict: RunVerdict, scale: Scale, kidnapping_said: bool) -> str:
    """Return what one run did, as a predicate: "found itself at 63 by 100 fresh particles"."""
    if not verdict.has_truth:
        return _without_truth(verdict)
    if not verdict.troubles:
        return _untroubled(verdict, scale)
    parts = [_trouble(one, verdict, scale, kidnapping_said) for one in verdict.troubles[:2]]
    more = len(verdict.troubles) - len(parts)
    if more:
        parts.append(f"was lost {more} more time{'s' * (more > 1)}")
    return ", ".join(parts)


def _trouble(trouble: Trouble, verdict: RunVerdict, scale: Scale, kidnapping_said: bool) -> str:
    carried = trouble.kind == KIDNAPPED
    what = "kidnapped" if carried else "lost"
    began = "" if carried and kidnapping_said else f"was {what} at {trouble.step}"
    if trouble.recovered is not None:
        by = f" by {trouble.fresh} fresh particles" if trouble.fresh else ""
        found = f"found itself at {trouble.recovered}{by}"
        return f"{began} and {found}" if began else found
    sure = SURE if trouble.is_sure else ""
    end = f" ({scale.say(verdict.error_end_m or 0.0)} off at the end)"
    stayed = f"stayed lost{sure}" if trouble.lost and verdict.is_off_at_end else "did not find itself again"
    return f"{began} and {stayed}{end}" if began else f"{stayed}{end}"


def _untroubled(verdict: RunVerdict, scale: Scale) -> str:
    end, mean = verdict.error_end_m or 0.0, verdict.error_mean_m or 0.0
    if verdict.found is None:
        sure = f", wrong and confident in {verdict.sure_share:.0%} of the updates"
        return f"was never localized ({scale.say(end)} off at the end{sure})"
    most = f"{scale.say(verdict.error_most_m or 0.0)} at most (step {verdict.most_at})"
    off = f"{scale.say(mean)} off on average, {most}"
    if verdict.found <= verdict.first + 1:
        stayed = (
            "stayed localized"
            if (verdict.error_most_m or 0.0) <= verdict.lost_m
            else "was never lost for long"
        )
        return f"{stayed}: {off}"
    return f"found itself at {verdict.found} and stayed localized: {off}"


def _without_truth(verdict: RunVerdict) -> str:
    share = f"{verdict.converged_share:.0%}"
    return f"has no truth to be judged by; its cloud was converged in {share} of the updates"


def _listed(steps: Sequence[int]) -> str:
    """Return the first few of some steps."""
    more = f" and {len(steps) - 3} more times" if len(steps) > 3 else ""
    return ", ".join(str(step) for step in steps[:3]) + more
