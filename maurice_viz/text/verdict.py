"""The verdict in words: one line that says what happened to one run, or to several."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from maurice_mcl.reasons.causes import CARRIED
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, shared_incidents, shared_kidnappings
from maurice_mcl.scoring.episodes import KIDNAPPED, SEARCHING, Episode
from maurice_mcl.scoring.metrics import StepScore
from maurice_mcl.scoring.table import RIGHT_RAD

from ..style import Scale, capital
from .causes import ROBOT_KIDNAPPED, say_cause, say_incident, steps_text

SURE = ", sure of a wrong place"
NOTHING_YET = "No step yet."
MOSTLY = 0.5  # share of the steps
MOST_INCIDENTS = 2  # that a line tells of
ALIKE_Q = 0.1  # qualities that differ by less are about equal


def verdict_line(verdicts: Mapping[str, RunVerdict], scale: Scale) -> str:
    """Return one line about all runs, what they share first: "The wheels slipped at step 34. `a` ..."."""
    if len(verdicts) == 1:
        return say_verdict(next(iter(verdicts.values())), scale)
    runs = list(verdicts.values())
    carried = bool(shared_kidnappings(runs))
    parts = [_of_several(f"`{label}`", verdict, scale, carried) for label, verdict in verdicts.items()]
    return f"{_shared(runs, scale)}{'; '.join(parts)}."


def _of_several(name: str, verdict: RunVerdict, scale: Scale, kidnapping_told: bool) -> str:
    """Return what one of several runs did, as a clause: "`robust` was localized from step 63 on"."""
    if not verdict.has_truth:
        return f"{name}: {_without_truth(verdict, scale)}"
    did = _predicate(verdict, scale, kidnapping_told)
    before = "; ".join(filter(None, [_made_worse(verdict, scale), _before(verdict, scale)]))
    why = _why(verdict, scale)
    because = f" ({why})" if why else f" ({ruled_out(verdict)})" if verdict.in_obstacles else ""
    return f"{name}: {before}; it {did}{because}" if before else f"{name} {did}{because}"


def _why(verdict: RunVerdict, scale: Scale) -> str:
    """Return why a run was not localized (again): its first failure that no incident told before explains."""
    failure = verdict.unexplained
    if failure is None:
        return ""
    since = f"from step {failure.episode.onset}: " if len(verdict.episodes) > 1 else ""
    return f"{since}{say_cause(failure, scale)}"


def say_verdict(verdict: RunVerdict, scale: Scale) -> str:
    """Return one line about one run."""
    if not verdict.updates:
        return NOTHING_YET
    shared = _shared([verdict], scale)
    left = off_map(verdict)
    if not verdict.has_truth:
        return f"{shared}{capital(_without_truth(verdict, scale))}.{left}"
    before = _before(verdict, scale)
    sentences = f"{shared}{capital(before)}. " if before else shared
    because = f" Why: {why}." if (why := _why(verdict, scale)) else ""
    did = _predicate(verdict, scale, bool(shared_kidnappings([verdict])))
    worse = f"{capital(made_worse)}. " if (made_worse := _made_worse(verdict, scale)) else ""
    return f"{worse}{sentences}The filter {did}.{because}{left}"


def _made_worse(verdict: RunVerdict, scale: Scale) -> str:
    """Return a clause if odometry alone was better: "the camera made it worse: 0.82 m, 0.25 m without it"."""
    alone = verdict.odometry_alone
    if alone is None or not alone.is_better:
        return ""
    off, without = scale.say(alone.error_mean_m + alone.against.mean), scale.say(alone.error_mean_m)
    return f"the {alone.sensors} made it worse: {off} off on average, {without} by odometry alone"


def off_map(verdict: RunVerdict) -> str:
    """Return where map and run contradict each other, as sentences after the others."""
    if verdict.in_obstacles:
        ruled = ruled_out(verdict)
        return f" {capital(ruled)}: --set map.obstacles=movable allows it."
    if not verdict.left_map:
        return ""
    at = _listed(verdict.left_map)
    return f" No particle was left on the map at {at}, so the cloud was kept in place."


def ruled_out(verdict: RunVerdict) -> str:
    """Return where the map ruled the truth out, as a clause: "the map has the sofa where the robot was"."""
    first, more = verdict.in_obstacles[0], len(verdict.in_obstacles) - 1
    at = steps_text(first.first, first.last)
    times = f" and {more} more time{'s' * (more > 1)}" if more else ""
    there = f"the map has the {first.obstacle} where the robot was at {at}{times}"
    return f"{there}, so no particle could be there"


def _shared(runs: Sequence[RunVerdict], scale: Scale) -> str:
    """Return what befell all runs of a drive, as sentences: "The wheels slipped at step 34. "."""
    incidents = [f"{say_incident(incident, scale)}. " for incident in shared_incidents(runs)]
    return "".join([_kidnapped_at(runs, scale), *incidents[:MOST_INCIDENTS]])


def _kidnapped_at(runs: Sequence[RunVerdict], scale: Scale) -> str:
    """Return the kidnappings in the log that all runs share: "The robot was kidnapped at step 61. "."""
    at = shared_kidnappings(runs)
    if len(at) != 1:
        return f"{ROBOT_KIDNAPPED} at {_listed(at)}. " if at else ""
    known = [i for i in runs[0].incidents if i.kind == CARRIED and i.actual is not None]
    return f"{say_incident(known[0], scale)}. " if known else f"{ROBOT_KIDNAPPED} at step {at[0]}. "


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


def _predicate(verdict: RunVerdict, scale: Scale, kidnapping_told: bool) -> str:
    """Return what one run did: "was wrong from step 61, localized again from step 63 on"."""
    episodes = [episode for episode in verdict.episodes if episode.kind != SEARCHING or episode.is_failure]
    if few := hardly_localized(verdict):
        sure = _how_sure(episodes[-1], verdict, scale) if episodes else ""
        return f"was {few}{sure} ({off_at(verdict.end, scale)} at the end){_beyond(verdict)}"
    if not episodes:
        return _never_wrong(verdict, scale)
    parts = [_say_episode(episode, verdict, scale, kidnapping_told) for episode in episodes[:2]]
    text, more = "; then it ".join(parts), len(episodes) - len(parts)
    return f"{text}; and it was wrong {more} more time{'s' * (more > 1)}" if more else text


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


def _beyond(verdict: RunVerdict) -> str:
    """Return at how many steps a run was too far off that was not lost, as a clause."""
    if not verdict.beyond or any(episode.lost is not None for episode in verdict.episodes):
        return ""
    steps = f"{verdict.beyond} step{'s' * (verdict.beyond > 1)}"
    return f", beyond the lost radius at {steps}, but never at four in a row"


def _say_episode(episode: Episode, verdict: RunVerdict, scale: Scale, kidnapping_told: bool) -> str:
    """Return one episode as a predicate, with how it ended."""
    sure = _how_sure(episode, verdict, scale)
    is_last = episode == verdict.episodes[-1]
    if episode.kind == SEARCHING:
        from_step = f"localized from step {episode.localized} on"
        return f"was confident of a wrong place at {episode.sure} steps before it was {from_step}"
    carried = episode.kind == KIDNAPPED and not (kidnapping_told and episode.wrong)
    parts = [f"kidnapped at step {episode.first}"] if carried and not kidnapping_told else []
    parts += [episode.account] if episode.wrong is not None else []
    incident = verdict.incident_of(episode)
    parts += ["while all reference pictures scored alike"] if incident and incident.alike else []
    if episode.localized is not None:
        drawn = f"{episode.fresh} fresh particles up to step {episode.last}"
        fresh = f", after {drawn}" if episode.fresh else ""
        parts.append(f"localized again from step {episode.localized} on{fresh}")
    elif is_last and verdict.end is not None:
        parts.append(f"{at_the_end(verdict.end)} ({off_at(verdict.end, scale)}){sure}")
    else:
        parts.append("not localized again")
    return f"was {', '.join(parts)}"


def at_the_end(end: StepScore) -> str:
    """Return how a run that was not localized again ended, by the radii (docs/evaluation.md)."""
    if end.lost:
        return "still lost at the end"
    return "right at the end, but not localized again" if end.correct else "neither right nor lost at the end"


def off_at(end: StepScore | None, scale: Scale) -> str:
    """Return an error: "63.5 in off"; with the heading where that is not right."""
    if end is None or end.position_error_m is None:
        return "truth not known"
    turned = end.heading_error_rad or 0.0
    heading = f" and {math.degrees(turned):.0f} deg" if turned > RIGHT_RAD else ""
    return f"{scale.say(end.position_error_m)}{heading} off"


def _how_sure(episode: Episode, verdict: RunVerdict, scale: Scale) -> str:
    """Return how sure a lost run was, and whether a particle was near the truth."""
    worst, text, is_bereft = verdict.sure_and_wrong, "", episode.is_bereft
    if episode.is_sure:
        text = SURE
        if worst is not None and episode.first <= worst.step <= episode.last:
            away = scale.say(worst.error_m)
            within = f"within {scale.say(verdict.radii.cluster_m)} of a place {away} from the truth"
            text += f": at step {worst.step}, {worst.share:.0%} of the weight lay {within}"
            is_bereft = worst.bereft
    is_bereft = is_bereft and not _why(verdict, scale)  # which says more
    return f"{text}, with no particle near" if is_bereft else text


def _never_wrong(verdict: RunVerdict, scale: Scale) -> str:
    """Return what is to be said of a run without an episode, or whose search ended well."""
    end = verdict.end
    if end is None:
        return f"was not judged: {off_at(end, scale)}"
    if verdict.localized is not None and verdict.localized > verdict.first:
        right = "right" if end.correct else "too far off" if end.lost else "neither right nor lost"
        return (
            f"was localized from step {verdict.localized} on, and {right} at the end ({off_at(end, scale)})"
        )
    how = f"right at {verdict.every_step}" if not verdict.off else f"never lost{_beyond(verdict)}"
    most = f"{scale.say(verdict.error_most_m or 0.0)} at most (step {verdict.most_at})"
    return f"was {how}: {scale.say(verdict.error_mean_m or 0.0)} off on average, {most}"


def _without_truth(verdict: RunVerdict, scale: Scale) -> str:
    """Return what can be said of a run that no truth judges, as a clause."""
    share = f"{verdict.converged_share:.0%}"
    text = f"the cloud was converged at {share} of the steps, and there is no truth to judge it by"
    if verdict.failures:
        first, more = verdict.failures[0], len(verdict.failures) - 1
        times = f", and {more} more time{'s' * (more > 1)}" if more else ""
        text += f"; it was {first.episode.account}{times}: {say_cause(first, scale)}"
    if any(incident.alike for incident in verdict.incidents):
        text = f"{text}; in the dark all reference pictures score alike"
    before = _before(verdict, scale)
    return f"{text}; {before}" if before else text


def _before(verdict: RunVerdict, scale: Scale) -> str:
    """Return which two places shared the weight before the run was localized; empty if none."""
    return "" if verdict.telling is None else _divided(verdict.telling, scale)


def _listed(steps: Sequence[int]) -> str:
    """Return the first few of some steps: "steps 3, 7 and 9"."""
    if len(steps) == 1:
        return f"step {steps[0]}"
    more = f" and {len(steps) - 3} more" if len(steps) > 3 else ""
    first = [str(step) for step in steps[:3]]
    return f"steps {', '.join(first) if more else ', '.join(first[:-1]) + ' and ' + first[-1]}{more}"
