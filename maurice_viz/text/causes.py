"""Causes in words: a failure as a clause, with the numbers that decided it; an incident as a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from maurice_mcl.reasons import causes as kinds
from maurice_mcl.reasons.causes import Failure, Incident
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.events import FAILURE, KINDS, RunEvent, joined
from maurice_mcl.scoring.table import CONVERGED, LOST, PROBABLY_LOST, SPREAD, WRONG

from ..style import Scale, capital
from .explanation import planes_of
from .laser import causes as laser_causes

NAMES: Mapping[str, str] = {  # of evidence; others are their own names without a unit
    "told": "known from",
    "skipped": "pictures skipped",
    "source": "the source told of",
    "moved_m": "the truth moved",
    "driven_m": "odometry says",
    "estimate_jump_m": "the estimate jumped",
    "jump_m": "odometry jumped",
    "within_s": "between two updates, in",
    "usual_speed": "otherwise odometry goes at most at (m/s)",
    "gap_s": "time without a record",
    "usual_s": "usual time between pictures",
    "tilt_deg": "tilt out of the plane (deg)",
    "sd": "standard deviations of the motion model",
    "movements": "movements taken together",
    "worst_step": "farthest off",
    "spread_nats": "best place over a middling one",
    "to_reference_m": "nearest reference",
    "none_looks_that_way": "steps without a reference that looks that way",
    "spacing_m": "usual distance between references",
    "brightness": "brightness, references = 1",
    "level": "mean gray level",
    "expected_level": "mean gray level of the references",
    "over_usual_nats": "cost above the usual",
    "corrected_nats": "cost once made as bright",
    "times_usual": "cost, usual = 1",
    "times_before": "cost, before = 1",
    "channel": "channel that costs most",
    "channel_nats": "cost of that channel",
    "elements": "its elements that cost most",
    "of_elements": "of how many elements",
    "elements_share": "their share of its cost",
    "behind_nats": "true place behind the best by",
    "rank": "rank of the true place",
    "references": "of how many references",
    "of_pictures": "of how many pictures",
    "places": "places that fit as well",
    "rival_x_m": "one of them, x",
    "rival_y_m": "one of them, y",
    "share": "weight at the true place",
    "copies": "copies that it was worth",
    "near": "particles at the true place",
    "particles": "of how many particles",
    "ever": "any weight at the true place, ever",
    "held_until": "weight at the true place until",
    "came": "first weight at the true place",
    "died": "last particle there died",
    "nearest_m": "nearest particle",
    "knows": "probability that it was not lost",
    "last": "until",
    "cloud_nats": "evidence of the cloud",
    "usual_cloud_nats": "usual evidence of the cloud",
    "best_nats": "evidence of the best reference",
    "usual_best_nats": "usual evidence of the best reference",
    "confused": "share of the library's own pictures that are confused",
    **laser_causes.NAMES,
}
STEPS = {"worst_step", "held_until", "came", "died", "last"}  # of evidence, whose values are steps
UNEXPLAINED = "not explained by anything that is looked for"
NOT_KNOWN = "the cause is not known"
WITHOUT_TRUTH = " (without ground truth)"
Clause = Callable[[Failure, Mapping[str, Any], Scale], str]


def failure_event(failure: Failure, time_s: float, scale: Scale) -> RunEvent:
    """Return a failure as an event of the step at which its cause shows first."""
    text = f"{failure.kind}: {say_cause(failure, scale)}; {failure.episode.account}"
    return RunEvent(failure.first, time_s, FAILURE, text)


def with_failures(
    events: Iterable[RunEvent], failures: Iterable[Failure], times_s: Mapping[int, float], scale: Scale
) -> list[RunEvent]:
    """Return the events of a run in order, those of several steps in a row as one, with its failures."""
    causes = [failure_event(f, times_s[f.first], scale) for f in failures if f.first in times_s]
    order = list(KINDS)
    return sorted([*joined(list(events)), *causes], key=lambda event: (event.step, order.index(event.kind)))


def say_cause(failure: Failure, scale: Scale) -> str:
    """Return the cause as a clause: "the robot was carried 2.13 m at step 18, unseen by its odometry"."""
    clause = (laser_causes.CLAUSES if failure.has_laser else CLAUSES).get(failure.kind)
    if failure.kind == kinds.UNKNOWN and not failure.truth_known:
        known = say_rival(failure, scale) or _off_beams(failure)
        return f"{_estimate_jump(failure, scale)}{known}{WITHOUT_TRUTH}"
    text = UNEXPLAINED if clause is None else clause(failure, failure.evidence, scale)
    if failure.kind == kinds.UNKNOWN and (jump := _estimate_jump(failure, scale)):
        text = f"{jump}{NOT_KNOWN}"
    return text if failure.truth_known else f"{text}{WITHOUT_TRUTH}"


def _estimate_jump(failure: Failure, scale: Scale) -> str:
    """Return how far the estimate jumped, as the beginning of a clause; empty where it did not."""
    e = failure.evidence
    if "estimate_jump_m" not in e:
        return ""
    jumped = f"the estimate jumped {scale.say(float(e['estimate_jump_m']))} at step {failure.first}"
    return f"{jumped}, where odometry says {scale.say(float(e['driven_m']))}; "


def say_rival(failure: Failure, scale: Scale) -> str:
    """Return which other run fits the pictures elsewhere, as a clause; empty where none does."""
    if "rival" not in failure.evidence:
        return ""
    sees = "scans" if failure.has_laser else "pictures"
    away = scale.say(float(failure.evidence["apart_m"]))
    return f"`{failure.evidence['rival']}` fits these {sees} {away} away"


def _off_beams(failure: Failure) -> str:
    """Return how much of the scans disagrees with the map, where that is all that is known."""
    if "off_beams" not in failure.evidence:
        return NOT_KNOWN
    share = f"{float(failure.evidence['off_beams']):.0%}"
    return f"{share} of the beams disagree with the map at the estimate; {NOT_KNOWN}"


def say_failure(failure: Failure, scale: Scale) -> str:
    """Return one sentence: when it was wrong, and why."""
    episode = failure.episode
    when = ", ".join(filter(None, [episode.account, episode.ending]))
    return f"{capital(when)}: {say_cause(failure, scale)}."


def say_remedy(failure: Failure, run: RunVerdict) -> str:
    """Return what the owner of a run can do that it does not yet, by AMCL's names; empty: nothing is known.

    Without a laser little is.
    """
    for name, remedy in laser_causes.REMEDIES_BY.items():
        if name in failure.evidence and (run.has_laser or name == "jump_m"):
            return remedy
    known = laser_causes.REMEDIES.get(failure.kind, ()) if run.has_laser else ()
    return "; or ".join(remedy.text for remedy in known if remedy.helps(run))


def say_evidence(failure: Failure, scale: Scale) -> list[str]:
    """Return a line for each number that decided, lengths in display units."""
    return [f"{_name(name)}: {_value(name, value, scale)}" for name, value in failure.evidence.items()]


def _name(name: str) -> str:
    if name in NAMES:
        return NAMES[name]
    for ending in ("_m", "_s", "_nats"):
        name = name.removesuffix(ending)
    return name.replace("_", " ")


def _value(name: str, value: float | str, scale: Scale) -> str:
    if isinstance(value, str):
        return value
    if name.endswith("_m"):
        return scale.say(value)
    if name in STEPS:
        return f"step {value:.0f}"
    unit = {"_s": " s", "_nats": " nats"}.get(name[name.rfind("_") :], "")
    return f"{value:.3g}{unit}" if value < 1000 else f"{value:.0f}{unit}"


def _data(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "equal_pictures" in e:
        return f"the camera gave the same picture {e['equal_pictures']} times from step {failure.first} on"
    count = e.get("skipped", 0)
    if failure.of_live == kinds.SKIPPED:
        some = f"{count} picture{'s' * (count > 1)} before step {failure.first}"
        return f"the filter was too slow for this robot: {some} {'were' if count > 1 else 'was'} skipped"
    if failure.of_live == kinds.CLOCK:
        return f"the robot's clock was set back before step {failure.first}"
    if failure.of_live == kinds.AWAY:
        return f"the source was away for {e['gap_s']:.0f} s before step {failure.first}"
    gap = f"a gap of {e['gap_s']:.0f} s before step {failure.first} (usually {e['usual_s']:.1f} s)"
    moved = f", in which the robot moved {scale.say(e['moved_m'])}" if "moved_m" in e else ""
    return f"the recording has {gap}{moved}"


def _kidnapped(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if not failure.truth_known:
        return f"the robot was carried away at step {failure.first}, as the log says"
    by = f" {scale.say(e['moved_m'])}" if "moved_m" in e else " away"
    return f"the robot was carried{by} at step {failure.first}, unseen by its odometry"


def _left_map(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "truth" in e:
        return f"the robot was off the map from step {failure.first} on"
    drove = f": odometry says {scale.say(e['driven_m'])}" if e["driven_m"] > 0 else ""
    return f"no particle was on the map at step {failure.first}{drove}"


def _out_of_plane(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    return f"the robot was tilted {e['tilt_deg']:.0f} deg out of the plane from step {failure.first} on"


def _motion(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if "jump_m" in e:
        moved = f", the robot moved {scale.say(e['moved_m'])}" if "moved_m" in e else ""
        jumped = f"odometry jumped {scale.say(e['jump_m'])} in {e['within_s']:.2g} s at step {failure.first}"
        return f"{jumped}{moved}: it was set anew, or its counter overflowed"
    floor = f" on {e['floor']}" if "floor" in e else ""
    several = f"in {e['movements']} movements" if e["movements"] > 1 else ""
    how = " ".join(part for part in (f"{e['sd']:.1f} sigma of its {e['axis']}", several) if part)
    moved = f"; odometry says {scale.say(e['driven_m'])}, the robot moved {scale.say(e['moved_m'])}"
    when = f"at step {failure.first}" if e["movements"] == 1 else f"from step {failure.first} on"
    moved = "" if e["axis"] == "turn" else moved
    return f"the robot moved beyond the motion model {when}{floor} ({how}{moved})"


def _numeric(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if e["weights"] == "not a number":
        return f"the likelihood is not a number from step {failure.first} on"
    if "spread_nats" not in e:
        return f"all weights were zero at step {failure.first}"
    spread = f"{e['spread_nats']:.0f} nats from a middling place to the best one"
    return f"the likelihood is so sharp that all weights but one vanish ({spread})"


def _library_gap(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    unseen, usual = e.get("none_looks_that_way", 0), f"usually {scale.say(e['spacing_m'])} apart"
    if 2 * unseen > e["updates"]:
        turned = f"at {unseen} of {e['updates']} steps; references are {usual}"
        return f"no reference looks the way that the robot did from step {failure.first} on ({turned})"
    nearest = f"{scale.say(e['to_reference_m'])} to the nearest, {usual}"
    return f"the library has no reference near the true place from step {failure.first} on ({nearest})"


def _lighting(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    there = "the references there"
    if not failure.truth_known:
        there = f"the {'darkest' if e['brightness'] < 1 else 'brightest'} reference"
    times = f"{e['brightness']:.2g} times as bright as {there}"
    not_this = "expected" if failure.truth_known else "not"
    levels = f"mean gray level {e['level']:.0f}, {not_this} {e['expected_level']:.0f}"
    return f"the pictures are {times} from step {failure.first} on ({levels})"


def _view(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    if not failure.truth_known:
        times = f"the best of all costs {e['times_usual']:.1f} times the usual"
        return f"the pictures from step {failure.first} on fit no reference of the library ({times})"
    how = f"{_times(e)}, most by {e['channel']}{_bins(e)}"
    return f"the pictures from step {failure.first} on do not show what the references there do ({how})"


def _sensor(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    """Say how pictures misled; `behind_nats` is of the true pose, `rank` of the best reference near it."""
    some, most = f"{e['pictures']} of {e['of_pictures']} pictures", f"most by {e['channel']}{_bins(e)}"
    rank = f"rank {e['rank']:.0f} of {e['references']:.0f}"
    if e["behind_nats"] <= 0:
        cost = f"{_times(e)}, " if _times(e) else ""
        return f"{some} fit the true place badly, but no other better ({cost}{most}; the truth has {rank})"
    how = f"by {e['behind_nats']:.1f} nats, {most}"
    if e["rank"] <= 1:
        near = f"though the best reference is near it: {rank}"
        return f"{some} fit references of other places better than the true pose ({how}, {near})"
    return f"{some} fit wrong places better than the true one ({how}; the truth has {rank})"


def _times(e: Mapping[str, Any]) -> str:
    """Return how much more than usual, or than before, the true place costs; empty where it does not."""
    if "times_usual" in e:
        return f"{e['times_usual']:.1f} times the usual cost"
    return f"{e['times_before']:.1f} times the cost before" if "times_before" in e else ""


def _bins(e: Mapping[str, Any]) -> str:
    """Return the elements of the channel that cost most: ": 41% of it red 96 to 111 and blue 16 to 23"."""
    if "elements" not in e:
        return ""
    size, numbers = int(e["of_elements"]), [int(number) for number in e["elements"].split(", ")]
    planes = planes_of(e["channel"], size)
    long = max(size // planes.count, 1)
    names = list[str]()
    while numbers:
        run = [numbers.pop(0)]
        while numbers and numbers[0] == run[-1] + 1 and numbers[0] // long == run[0] // long:
            run.append(numbers.pop(0))
        names.append(planes.name(run[0] // long, run[0] % long, run[-1] % long))
    return f", {e['elements_share']:.0%} of it in {' and '.join(names)}"


def _ambiguity(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    at = f"x {scale.say(e['rival_x_m'])}, y {scale.say(e['rival_y_m'])}"
    if "places" not in e:
        alike = f"another place looks like the true one in {e['pictures']} pictures, at {at}"
        return f"{alike}: the cloud never decided"
    return f"{e['places']:.0f} places look alike in {e['pictures']} pictures, another is at {at}"


def _resampling(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    had = f"{e['share']:.1%} of the weight, worth {e['copies']:.1f} copies"
    return f"resampling at step {failure.first} left no particle at the true place, which had {had}: chance"


def _impoverished(failure: Failure, e: Mapping[str, Any], scale: Scale) -> str:
    nearest = f"the nearest of {e['particles']:.0f} was {scale.say(e['nearest_m'])} away"
    if e["ever"] == "no":
        return f"no particle with any weight was ever at the true place ({nearest})"
    if e["ever"] == "late":
        return f"no particle with any weight was at the true place before step {e['came']}"
    return f"the last particle at the true place died at step {e['died']}, and no other came there"


CLAUSES: Mapping[str, Clause] = {
    kinds.DATA: _data,
    kinds.KIDNAPPED: _kidnapped,
    kinds.LEFT_MAP: _left_map,
    kinds.OUT_OF_PLANE: _out_of_plane,
    kinds.MOTION: _motion,
    kinds.NUMERIC: _numeric,
    kinds.LIBRARY_GAP: _library_gap,
    kinds.LIGHTING: _lighting,
    kinds.VIEW: _view,
    kinds.SENSOR: _sensor,
    kinds.AMBIGUITY: _ambiguity,
    kinds.RESAMPLING: _resampling,
    kinds.PROPOSAL: _impoverished,
    kinds.START: laser_causes.CLAUSES[kinds.START],  # of which the truth tells, no scan
}


# Incidents: what befell the robot or its camera.


def say_incident(incident: Incident, scale: Scale) -> str:
    """Return what befell the robot or its camera: "The wheels slipped at step 34: odometry says ..."."""
    at = steps_text(incident.step, incident.last)
    if incident.kind == kinds.DARK:
        gray = f"mean gray level {incident.expected or 0:.0f} before, {incident.actual or 0:.0f} since"
        return f"The picture went dark at step {incident.step} ({gray})"
    expected, actual = scale.say(incident.expected or 0.0), scale.say(incident.actual or 0.0)
    if incident.kind == kinds.SLIPPED:
        return f"The wheels slipped at {at}: odometry says {expected}, the robot moved {actual}"
    if incident.kind == kinds.LEAPT:
        return f"Odometry jumped at {at}: by {expected}, the robot moved {actual}"
    if incident.kind == kinds.JUMPED:
        return f"The true pose jumped at {at}: by {actual}, odometry says {expected}"
    if incident.kind == kinds.CARRIED:
        by = "as the log says" if incident.actual is None else f"carried {actual}, unseen by its odometry"
        return f"The robot was kidnapped at {at} ({by})"
    if incident.kind == kinds.TURNED:
        turned = incident.words.removeprefix("slip ")
        return f"The wheels slipped at {at}: a turn of {turned} that odometry did not see"
    return f"The light changed at {at} ({incident.words})"


def steps_text(first: int, last: int) -> str:
    """Return "step 34" or "steps 34 to 37"."""
    return f"step {first}" if first == last else f"steps {first} to {last}"


STATE_WORDS = {
    WRONG: "sure of a wrong place",
    PROBABLY_LOST: "probably lost",
    CONVERGED: "dots together",
    SPREAD: "dots spread",
}


def say_state(state: str, failure: Failure | None = None) -> str:
    """Return a localization status; of a lost run how sure it was and why: "lost, sure of ...: too dark"."""
    if failure is None:
        return STATE_WORDS.get(state, state)
    lost = LOST if failure.truth_known else STATE_WORDS[PROBABLY_LOST]
    sure = f", {STATE_WORDS[WRONG]}" if failure.episode.is_sure else ""
    return f"{lost}{sure}" if failure.kind == kinds.UNKNOWN else f"{lost}{sure}: {failure.title}"
