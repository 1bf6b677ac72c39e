"""The verdict in words: the headline, two lines on all runs, and the account, a line for each event.

The command line, recordings, reports and JSON say the same. All terms are those of docs/evaluation.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from maurice_mcl.filter.recovery import DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import KIDNAPPED, UNKNOWN
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, shared_incidents, shared_kidnappings
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import RIGHT_RAD, SEARCHING

from ..style import Scale, capital
from .causes import say_failure, say_incident, say_rival, steps_text

NEVER_DRAWS = "recovery_alpha 0: no new particles"
BY_SCANS = ", by particles drawn where the scan fits"
SURE_OF_WRONG = ", sure of a wrong place"
NOTHING_YET = "No step yet."
ALIKE_Q = 0.1  # qualities that differ by less are about equal
TWO_LINES = 210  # letters
MOSTLY = 0.5  # share of the steps at which the dots were together: from here on a run kept them so
FEW = 5  # steps, below which nothing can be said of a run but where it is
NO_TRUTH = " No truth is known to judge by."


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run did in the end. Runs that did the same are told together."""

    did: str  # with {was} and {itself}, where several runs did it
    value: str = ""  # a number of this run, in brackets
    before: str = ""  # words around it
    after: str = ""
    alone: str = ""  # what is told after it of a single run


def headline(verdicts: Mapping[str, RunVerdict], scale: Scale) -> str:
    """Return what happened: "Kidnapped at step 41: `thesis` stayed lost (63.5 in off at the end). ..."."""
    runs = list(verdicts.values())
    if not any(run.updates for run in runs):
        return NOTHING_YET
    if max(run.updates for run in runs) < FEW:
        return _too_few(verdicts, scale)
    groups: dict[str, list[tuple[str, Outcome]]] = {}
    for label, verdict in verdicts.items():
        outcome = _outcome(verdict, scale)
        groups.setdefault(outcome.did, []).append((f"`{label}`" if len(runs) > 1 else "the filter", outcome))
    happened = _happened(runs)
    for detail in (2, 1, 0):  # as much as there is room for
        text = " ".join(_sentence(group, detail) for group in groups.values())
        text = f"{happened}: {text}" if happened else f"{capital(text)}"
        text += "" if any(run.has_truth for run in runs) else NO_TRUTH
        if len(text) <= TWO_LINES:
            break
    return text


def now_line(verdicts: Mapping[str, RunVerdict]) -> str:
    """Return how runs of a live drive stand: "Now: localized, since step 640. "; "" where nothing tells."""
    named = {f"`{label}` " if len(verdicts) > 1 else "": run.now for label, run in verdicts.items()}
    parts = [f"{name}{now.words}, since step {now.since}" for name, now in named.items() if now is not None]
    return f"Now: {'; '.join(parts)}. " if parts else ""


def _too_few(verdicts: Mapping[str, RunVerdict], scale: Scale) -> str:
    """Return where runs of a few steps are: "After 1 step: `a` is 63.5 in off. Too early to say more."."""
    names = {label: f"`{label}`" if len(verdicts) > 1 else "the filter" for label in verdicts}
    off = [f"{names[label]} is {off_at(run.end, scale)}" for label, run in verdicts.items() if run.has_truth]
    steps = max(run.updates for run in verdicts.values())
    after = f"After {steps} step{'s' * (steps > 1)}"
    return (
        f"{after}: {joined(off)}. Too early to say more."
        if off
        else f"{after} it is too early to say anything."
    )


def _sentence(group: Sequence[tuple[str, Outcome]], details: int) -> str:
    """Return what runs did: "`a` and `b` stayed lost (63.5 in and 40.2 in off at the end)."."""
    first = group[0][1]
    was, itself = ("were", "themselves") if len(group) > 1 else ("was", "itself")
    text = f"{joined([name for name, _ in group])} {first.did.format(was=was, itself=itself)}"
    values = [outcome.value for _, outcome in group if outcome.value]
    values = values[:1] if len(set(values)) == 1 else values  # one that all share, or one of each
    detail = f"{first.before}{joined(values)}{first.after}" if values and details else ""
    detail += first.alone if len(group) == 1 and details > 1 else ""
    return f"{text} ({detail})." if detail else f"{text}."


def joined(words: Sequence[str], last: str = "and") -> str:
    """Join words: "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def _happened(runs: Sequence[RunVerdict]) -> str:
    """Return what befell all runs first: "Kidnapped at step 41"; of several kidnappings their number."""
    carried, shared = shared_kidnappings(runs), shared_incidents(runs)
    if carried:
        more = f" and {len(carried) - 1} more time{'s' * (len(carried) > 2)}" if len(carried) > 1 else ""
        return f"Kidnapped at step {carried[0]}{more}"
    if shared:
        title = shared[0].about.title
        return f"{capital(title)} at step {shared[0].step}"
    divided = [run.telling for run in runs]
    step = None if divided[0] is None else divided[0].step
    same = step is not None and all(places is not None and places.step == step for places in divided)
    return f"Two places looked alike at step {step}" if same else ""


def _outcome(verdict: RunVerdict, scale: Scale) -> Outcome:
    """Return what one run did in the end."""
    alone, at_end, off = verdict.odometry_alone, " at the end", off_at(verdict.end, scale)
    if alone is not None and alone.is_better:  # a sensor that is worse than none is told first
        error, without = scale.say(alone.error_mean_m + alone.against.mean), scale.say(alone.error_mean_m)
        after = f" off on average, {without} without the {alone.sensors}"
        return Outcome("did worse than odometry alone", error, after=after)
    if not verdict.has_truth:
        return _without_truth(verdict, scale)
    episodes = [episode for episode in verdict.episodes if episode.kind != SEARCHING or episode.is_failure]
    if few := hardly_localized(verdict):
        sure, why = any(episode.is_sure for episode in episodes), _why(verdict)
        did = f"{{was}} {few}{SURE_OF_WRONG if sure else ''}"
        return Outcome(did, off, after=at_end, alone=f"; {why}" if why else "")
    if episodes:
        return _of_episodes(verdict, episodes, scale)
    if verdict.localized is not None and verdict.localized > verdict.first:
        return Outcome("found {itself}", str(verdict.localized), "at step ", alone=f", {off} at the end")
    did = "{was} never lost" if verdict.off else f"{{was}} right at {verdict.every_step}"
    if verdict.error_mean_m is None:  # too short to be scored
        return Outcome(did, off, after=at_end)
    return Outcome(did, scale.say(verdict.error_mean_m), after=" off on average")


def _of_episodes(verdict: RunVerdict, episodes: Sequence[Episode], scale: Scale) -> Outcome:
    """Return how the times that a run was wrong ended."""
    last, why = episodes[-1], _why(verdict)
    because = f"; {why}" if why else ""
    if last.localized is None and last is verdict.episodes[-1]:
        sure = SURE_OF_WRONG if last.is_sure else ""
        end = verdict.end
        before = [episode for episode in episodes[:-1] if episode.lost is not None]
        did = "stayed lost" if end is None or end.lost else "{was} lost and not localized again"
        if before and before[0].localized is None and did == "stayed lost":
            did = f"{{was}} lost from step {before[0].onset} on"
        elif before:
            because = f"; lost from step {before[0].onset} before"
        did += ", though right in the end" if end is not None and end.correct else sure
        because += f"; {NEVER_DRAWS}" if _redrawn(verdict, last) == DRAWS_NEVER else ""
        return Outcome(did, off_at(verdict.end, scale), after=" at the end", alone=because)
    if last.localized is None:
        return Outcome("{was} lost", why)
    step, fresh = str(last.localized), f", with {last.fresh} new particles" if last.fresh else ""
    if last.kind == SEARCHING:
        return Outcome("found {itself}, after a wrong place", step, "at step ", alone=fresh)
    if len(episodes) == 1:
        recovery = "found {itself} again" if last.lost is None else "{was} lost, and found {itself} again"
        did = recovery if last.given is None else "{was} lost until somebody gave a pose"
        drawn = BY_SCANS if _redrawn(verdict, last) == DRAWS_WHERE_LIKELY else fresh
        later = f", {last.localized - last.onset} steps later" if last.lost is not None else ""
        return Outcome(did, step, "at step ", alone=f"{later}{drawn}{because}")
    return Outcome("{was} lost again and again", step, f"{len(episodes)} times, until step ", alone=because)


def _redrawn(verdict: RunVerdict, episode: Episode) -> str | None:
    """Return where a robot with a laser that was carried away had new particles; None of all others."""
    incident = verdict.incident_of(episode)
    is_carried = incident is not None and incident.about.cause == KIDNAPPED
    return verdict.draws_new if is_carried and verdict.laser is not None else None


def _why(verdict: RunVerdict) -> str:
    """Return the cause of the first failure in a word or two, where no incident was told before."""
    failure = verdict.unexplained
    if failure is not None and verdict.has_loud_incident(failure.episode):
        return ""
    return "" if failure is None or failure.kind == UNKNOWN else failure.title


def _without_truth(verdict: RunVerdict, scale: Scale) -> Outcome:
    """Return what can be said of a run that no truth judges."""
    if verdict.failures:
        failure = verdict.failures[0]
        why = say_rival(failure, scale) if failure.kind == UNKNOWN else failure.title
        why = f": {why}" if why else ""
        return Outcome("{was} probably lost", str(failure.episode.first), "from step ", alone=why)
    if verdict.now is not None and verdict.now.places > 1:
        return Outcome(f"ended at one of {verdict.now.places} places that its scans cannot tell apart")
    share = f"{verdict.converged_share:.0%}"
    if verdict.converged_share < MOSTLY:
        return Outcome("did not keep the dots together", share, "together at ", " of the steps")
    return Outcome("kept the dots together", share, "at ", " of the steps")


def hardly_localized(verdict: RunVerdict) -> str:
    """Return how right a run was that was localized at few steps or none, as a predicate without its verb.

    Empty of a run that was localized at most steps since it first was, or that was lost.
    """
    lost = [episode for episode in verdict.episodes if episode.kind != SEARCHING]
    if verdict.is_kept or lost or not verdict.judged:
        return ""
    steps, is_sure = f"of {verdict.judged} steps", any(episode.is_sure for episode in verdict.episodes)
    sure = f"sure of it at only {verdict.sure}" if verdict.sure else "never sure of it"
    if not verdict.off:
        return f"right at {verdict.every_step}, but {sure}{f' {steps}' * bool(verdict.sure)}"
    if verdict.right >= MOSTLY * verdict.judged and not is_sure:
        return f"right at {verdict.right} {steps}, but {sure}"
    if verdict.sure and verdict.sure == verdict.sure_lately:
        return f"localized only at the last {verdict.sure} {steps}"
    return f"localized at only {verdict.sure} {steps}" if verdict.localized else "never localized"


def off_at(end: StepScore | None, scale: Scale) -> str:
    """Return an error: "63.5 in off"; with the heading where that is not right."""
    if end is None or end.error_m is None:
        return "truth not known"
    turned = end.heading_error_rad or 0.0
    heading = f" and {math.degrees(turned):.0f} deg" if turned > RIGHT_RAD else ""
    return f"{scale.say(end.error_m)}{heading} off"


# The account: what the headline has no room for.


def account(verdicts: Mapping[str, RunVerdict], scale: Scale) -> list[str]:
    """Return what happened, a sentence each: to the robot, then how and why each run was wrong."""
    runs = verdicts.values()
    reasons = {(failure.kind, failure.first) for run in runs for failure in run.failures}  # with its numbers
    befell = [incident for run in runs for incident in run.telling_incidents]
    incidents = [incident for incident in befell if (incident.about.cause, incident.step) not in reasons]
    lines = list(dict.fromkeys(f"{capital(say_incident(incident, scale))}." for incident in incidents))
    for label, verdict in verdicts.items():
        name = f"`{label}`: " if len(verdicts) > 1 else ""
        lines += [f"{name}{sentence}" for sentence in _of_run(verdict, scale)]
    return lines


def _of_run(verdict: RunVerdict, scale: Scale) -> Iterator[str]:
    """Yield what is to be told of one run."""
    if any(incident.alike for incident in verdict.incidents):
        yield "In the dark all reference pictures score alike."
    if verdict.telling is not None:
        yield f"{capital(_divided(verdict.telling, scale))}."
    yield from (say_failure(failure, scale) for failure in verdict.failures)
    sure = verdict.sure_and_wrong
    if sure is not None and any(e.is_sure and e.first <= sure.step <= e.last for e in verdict.episodes):
        within, away = scale.say(verdict.radii.cluster_m), scale.say(sure.error_m)
        near = ", with no particle near it" if sure.bereft else ""
        place = f"within {within} of a place {away} from the truth{near}"
        yield f"Sure of a wrong place: at step {sure.step}, {sure.share:.0%} of the weight lay {place}."
    if left := off_map(verdict):
        yield left


def off_map(verdict: RunVerdict) -> str:
    """Return where map and run contradict each other, as a sentence; "" where they do not."""
    if verdict.in_obstacles:
        first, more = verdict.in_obstacles[0], len(verdict.in_obstacles) - 1
        at = steps_text(first.first, first.last)
        times = f" and {more} more time{'s' * (more > 1)}" if more else ""
        there = f"The map has the {first.obstacle} where the robot was at {at}{times}"
        return f"{there}, so no particle could be there: --set map.obstacles=movable allows it."
    if not verdict.left_map:
        return ""
    at = _listed(verdict.left_map)
    return f"No particle was left on the map at {at}, so the cloud was kept in place."


def _divided(ambiguity: Ambiguity, scale: Scale) -> str:
    """Return how two places shared the weight: "two places looked alike at step 3: 47% of the weight ..."."""
    where = {None: "", 0: "; the truth is in neither", 1: "; the truth is in the first"}
    truth = where.get(ambiguity.truth_in, "; the truth is in the second")
    first, second = (f"{share:.0%}" for share in ambiguity.shares)
    there = f"{second} at the other, {scale.say(ambiguity.apart_m)} away"
    at = f"two places looked alike at step {ambiguity.step}"
    return f"{at}: {first} of the weight at one, {there}{truth}{_fits(ambiguity)}"


def _fits(ambiguity: Ambiguity) -> str:
    """Return how well the picture fitted both places: "; both fit about as well (q 0.81 and ...)"."""
    if (
        ambiguity.fits is None
        or ambiguity.usual is None
        or abs(ambiguity.fits[0] - ambiguity.fits[1]) > ALIKE_Q
    ):
        return ""
    first, second = ambiguity.fits
    values = f"q {first:.2f} and {second:.2f}; a typical place {ambiguity.usual:.2f}"
    return f"; both fit about as well ({values})"


def _listed(steps: Sequence[int]) -> str:
    """Return the first few of some steps: "steps 3, 7 and 9"."""
    if len(steps) == 1:
        return f"step {steps[0]}"
    more = f" and {len(steps) - 3} more" if len(steps) > 3 else ""
    first = [str(step) for step in steps[:3]]
    return f"steps {', '.join(first) if more else ', '.join(first[:-1]) + ' and ' + first[-1]}{more}"
