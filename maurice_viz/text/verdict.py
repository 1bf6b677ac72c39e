"""The verdict in words: one line that says what happened to one run, or to several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from maurice_mcl.analysis.events import KIDNAPPED, SEARCHING
from maurice_mcl.analysis.failures.ambiguity import Ambiguity
from maurice_mcl.analysis.failures.causes import CARRIED, DARK, JUMPED, OVERSTATED, SLIPPED, TURNED, Cause
from maurice_mcl.analysis.failures.kinds import KIDNAPPED as WAS_KIDNAPPED
from maurice_mcl.analysis.failures.kinds import LIGHTING, MOTION
from maurice_mcl.analysis.failures.verdict import RunVerdict, Trouble

from ..style import Scale
from .failure import say_cause

SURE = ", sure of a wrong place"
KIDNAPPED_ROBOT = "The robot was kidnapped"
NOTHING_YET = "No update yet."
TOLD = (WAS_KIDNAPPED, MOTION, LIGHTING)  # causes that the sentence on the drive has told already
MOST_CAUSES = 2  # that a line tells of
ALIKE_Q = 0.1  # qualities that differ by less are about equal


def verdict_line(verdicts: Mapping[str, RunVerdict], scale: Scale) -> str:
    """Return one line about all runs, what they share first: "The wheels slipped at 34. `a` ..."."""
    if len(verdicts) == 1:
        return said(next(iter(verdicts.values())), scale)
    runs = list(verdicts.values())
    carried = bool(_kidnappings(runs))
    parts = [_of_several(f"`{label}`", one, scale, carried) for label, one in verdicts.items()]
    return f"{_shared(runs, scale)}{'; '.join(parts)}."


def _of_several(name: str, verdict: RunVerdict, scale: Scale, kidnapping_said: bool) -> str:
    """Return what one of several runs did, as a clause: "`robust` found itself at 63"."""
    if not verdict.has_truth:
        return f"{name}: {_without_truth(verdict, scale)}"
    did = _predicate(verdict, scale, kidnapping_said)
    before = "; ".join(filter(None, [_made_worse(verdict, scale), _before(verdict, scale)]))
    why = _why(verdict, scale)
    because = f" ({why})" if why else f" ({ruled_out(verdict)})" if verdict.in_obstacles else ""
    return f"{name}: {before}; it {did}{because}" if before else f"{name} {did}{because}"


def _why(verdict: RunVerdict, scale: Scale) -> str:
    """Return why a run did not find itself (again), of the first failure that nothing told explains."""
    told = [one.step for one in verdict.troubles if one.has_loud_cause]
    quiet = [one for one in verdict.failures if not (one.kind in TOLD and told)]
    return say_cause(quiet[0], scale) if quiet else ""


def said(verdict: RunVerdict, scale: Scale) -> str:
    """Return one line about one run."""
    if not verdict.updates:
        return NOTHING_YET
    shared = _shared([verdict], scale)
    left = _off_map(verdict)
    if not verdict.has_truth:
        return f"{shared}{_sentence(_without_truth(verdict, scale))}{left}"
    before = _before(verdict, scale)
    sentences = f"{shared}{_sentence(before)} " if before else shared
    who = "It" if sentences.startswith(KIDNAPPED_ROBOT) else "The robot"
    because = f" Why: {why}." if (why := _why(verdict, scale)) else ""
    did = _predicate(verdict, scale, bool(_kidnappings([verdict])))
    worse = f"{_sentence(made_worse)} " if (made_worse := _made_worse(verdict, scale)) else ""
    return f"{worse}{sentences}{who} {did}.{because}{left}"


def _made_worse(verdict: RunVerdict, scale: Scale) -> str:
    """Return a clause if odometry alone was better: "the camera made it worse: 0.82 m, 0.25 m without it"."""
    alone = verdict.odometry_alone
    if alone is None or not alone.is_better:
        return ""
    off, without = scale.say(alone.error_mean_m + alone.against.mean), scale.say(alone.error_mean_m)
    return f"the {alone.sensors} made it worse: {off} off on average, {without} by odometry alone"


def _off_map(verdict: RunVerdict) -> str:
    """Return where map and run contradict each other, as sentences after the others."""
    if verdict.in_obstacles:
        ruled = ruled_out(verdict)
        return f" {ruled[:1].upper()}{ruled[1:]}: --set map.obstacles=movable allows it."
    if not verdict.left_map:
        return ""
    return f" No particle was left on the map at {_listed(verdict.left_map)}, so the cloud was kept in place."


def ruled_out(verdict: RunVerdict) -> str:
    """Return where the map ruled the truth out, as a clause: "the map has the sofa where the robot was"."""
    first, more = verdict.in_obstacles[0], len(verdict.in_obstacles) - 1
    at = f"at {first.first}" if first.first == first.last else f"from {first.first} to {first.last}"
    times = f" and {more} more time{'s' * (more > 1)}" if more else ""
    there = f"the map has the {first.obstacle} where the robot was {at}{times}"
    return f"{there}, so no particle could be there"


def _sentence(clause: str) -> str:
    return f"{clause[:1].upper()}{clause[1:]}."


def _shared(runs: Sequence[RunVerdict], scale: Scale) -> str:
    """Return what befell all runs of a drive, as sentences: "The wheels slipped at 34. "."""
    told = dict.fromkeys(
        (one.kind, one.step) for run in runs for one in run.telling_causes if one.kind != CARRIED
    )
    causes = [
        {(one.kind, one.step): one for one in run.causes if (one.kind, one.step) in told} for run in runs
    ]
    both = [key for key in told if all(key in one for one in causes)]
    parts = [_kidnapped_at(runs, scale)]
    parts += [f"{befell(causes[0][key], scale)}. " for key in both[:MOST_CAUSES]]
    return "".join(parts)


def befell(cause: Cause, scale: Scale) -> str:
    """Return what befell the robot or its camera: "The wheels slipped at 34: they counted 12.0 in, ..."."""
    at = f"{cause.step}" if cause.last == cause.step else f"{cause.step} to {cause.last}"
    if cause.kind == DARK:
        gray = f"mean gray level {cause.expected or 0:.0f} before, {cause.actual or 0:.0f} since"
        return f"The picture went dark at {cause.step} ({gray})"
    expected, actual = scale.say(cause.expected or 0.0), scale.say(cause.actual or 0.0)
    if cause.kind == SLIPPED:
        return f"The wheels slipped at {at}: odometry says {expected}, the robot moved {actual}"
    if cause.kind == OVERSTATED:
        return f"Odometry from pictures was too long at {at}: it says {expected}, the robot moved {actual}"
    if cause.kind == JUMPED:
        return f"The true pose jumped at {at}: by {actual}, odometry says {expected}"
    if cause.kind == CARRIED:
        return f"{KIDNAPPED_ROBOT} at {at} (carried {actual}, unseen by its odometry)"
    if cause.kind == TURNED:
        turned = cause.words.removeprefix("slip ")
        return f"The wheels slipped at {at}: a turn of {turned} that odometry did not see"
    return f"The light changed at {at} ({cause.words})"


def _kidnappings(runs: Sequence[RunVerdict]) -> list[int]:
    """Return the steps of the kidnappings, if all runs share them."""
    at = [[t.step for t in one.troubles if t.kind == KIDNAPPED] for one in runs]
    return at[0] if all(other == at[0] for other in at) else []


def _kidnapped_at(runs: Sequence[RunVerdict], scale: Scale) -> str:
    """Return the kidnappings in the log that all runs share: "The robot was kidnapped at 61. "."""
    at = _kidnappings(runs)
    if len(at) != 1:
        return f"{KIDNAPPED_ROBOT} at {_listed(at)}. " if at else ""
    known = [one for one in runs[0].causes if one.kind == CARRIED and one.actual is not None]
    return f"{befell(known[0], scale)}. " if known else f"{KIDNAPPED_ROBOT} at {at[0]}. "


def divided(one: Ambiguity, scale: Scale) -> str:
    """Return how two places shared the weight: "two places looked alike at 3: 47% of the weight ..."."""
    where = {None: "", 0: "; the truth is in neither", 1: "; the truth is in the first"}
    truth = where.get(one.truth_in, "; the truth is in the second")
    first, second = (f"{share:.0%}" for share in one.shares)
    there = f"{second} at the other, {scale.say(one.apart_m)} away"
    return f"two places looked alike at {one.step}: {first} of the weight at one, {there}{truth}{_fits(one)}"


def _fits(one: Ambiguity) -> str:
    """Return how well the picture fitted both places: "; both fit about as well (q 0.81 and ...)"."""
    if one.fits is None or one.usual is None or abs(one.fits[0] - one.fits[1]) > ALIKE_Q:
        return ""
    first, second = one.fits
    values = f"q {first:.2f} and {second:.2f}; a typical place {one.usual:.2f}"
    return f"; both fit about as well ({values})"


def _predicate(verdict: RunVerdict, scale: Scale, kidnapping_said: bool) -> str:
    """Return what one run did, as a predicate: "found itself at 63 by 100 fresh particles"."""
    if not verdict.troubles:
        return _untroubled(verdict, scale)
    parts = [_trouble(one, verdict, scale, kidnapping_said) for one in verdict.troubles[:2]]
    text, more = ", then ".join(parts), len(verdict.troubles) - len(parts)
    return f"{text}, and went wrong {more} more time{'s' * (more > 1)}" if more else text


def _trouble(trouble: Trouble, verdict: RunVerdict, scale: Scale, kidnapping_said: bool) -> str:
    began = _began(trouble, kidnapping_said)
    if trouble.recovered is not None:
        by = f" by {trouble.fresh} fresh particles" if trouble.fresh and trouble.kind != SEARCHING else ""
        found = f"found itself at {trouble.recovered}{by}"
        return f"{began} and {found}" if began else found
    end = f"{scale.say(verdict.error_end_m or 0.0)} off at the end"
    stayed = "stayed lost" if trouble.lost and verdict.is_off_at_end else "did not find itself again"
    if trouble.kind == SEARCHING:
        stayed = "never found itself"
    stayed = f"{stayed}{_how_sure(trouble, verdict, scale)} ({end})"
    return f"{began} and {stayed}" if began else stayed


def _began(trouble: Trouble, kidnapping_said: bool) -> str:
    if trouble.kind == SEARCHING or (trouble.kind == KIDNAPPED and kidnapping_said):
        return ""
    what = "was kidnapped" if trouble.kind == KIDNAPPED else "went wrong"  # its lane says lost later
    alike = trouble.cause is not None and trouble.cause.alike
    return f"{what} at {trouble.step}{', with all reference pictures scoring alike,' if alike else ''}"


def _how_sure(trouble: Trouble, verdict: RunVerdict, scale: Scale) -> str:
    """Return how sure a lost run was, and why it could not find itself."""
    worst, text, is_bereft = verdict.sure_and_wrong, "", trouble.is_bereft
    if trouble.is_sure:
        text = SURE
        if worst is not None and worst.step >= trouble.step:
            away = scale.say(worst.error_m)
            text += f": at step {worst.step}, {worst.share:.0%} of the weight lay {away} from the truth"
            is_bereft = worst.bereft
    is_bereft = is_bereft and not _why(verdict, scale)  # which says more
    return f"{text}, with no particle near" if is_bereft else text


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
    return f"found itself at {verdict.found} and stayed localized ({scale.say(end)} off at the end)"


def _without_truth(verdict: RunVerdict, scale: Scale) -> str:
    """Return what can be said of a run that no truth judges, as a clause."""
    share = f"{verdict.converged_share:.0%}"
    text = f"the cloud was converged in {share} of the updates, and there is no truth to judge it by"
    if verdict.failures:
        first, more = verdict.failures[0], len(verdict.failures) - 1
        times = f", and {more} more time{'s' * (more > 1)}" if more else ""
        text += f"; it was probably lost from {first.lost} to {first.last}{times}: {say_cause(first, scale)}"
    if any(one.alike for one in verdict.causes):
        text = f"{text}; in the dark all reference pictures score alike"
    before = _before(verdict, scale)
    return f"{text}; {before}" if before else text


def _before(verdict: RunVerdict, scale: Scale) -> str:
    """Return which two places shared the weight before the run was localized; empty if none."""
    return "" if verdict.telling is None else divided(verdict.telling, scale)


def _listed(steps: Sequence[int]) -> str:
    """Return the first few of some steps."""
    more = f" and {len(steps) - 3} more times" if len(steps) > 3 else ""
    first = [str(step) for step in steps[:3]]
    if len(first) < 2 or more:
        return ", ".join(first) + more
    return f"{', '.join(first[:-1])} and {first[-1]}"
