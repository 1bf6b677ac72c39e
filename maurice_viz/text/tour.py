"""The words of the first screen, for anybody: the headline, two lines on all runs, and where to look when.

The headline says what happened, to which run, and how that ended. The verdict's numbers are in `verdict`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from maurice_mcl.reasons.causes import (
    CARRIED,
    DARK,
    JUMPED,
    LEAPT,
    OVERSTATED,
    SLIPPED,
    UNKNOWN,
    Failure,
    Incident,
)
from maurice_mcl.reasons.tour import BACK, BEGINS, DIVIDED, ENDS, FOUND, LOST, SURE, TourMoment
from maurice_mcl.reasons.verdict import (
    Ambiguity,
    RunVerdict,
    SureAndWrong,
    shared_incidents,
    shared_kidnappings,
)
from maurice_mcl.scoring.episodes import SEARCHING, Episode

from ..entities import Phase, Place, open_command
from ..scene import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY, RunView
from ..style import Scale, capital
from .causes import say_cause, say_incident, say_rival
from .phases import of_scans
from .verdict import NOTHING_YET, hardly_localized, off_at
from .verdict import SURE as SURE_OF_WRONG

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
        return Outcome(did, off_at(verdict.end, scale), after=" at the end", alone=because)
    if last.localized is None:
        return Outcome("{was} lost", why)
    step, fresh = str(last.localized), f", with {last.fresh} new particles" if last.fresh else ""
    if last.kind == SEARCHING:
        return Outcome("found {itself}, after a wrong place", step, "at step ", alone=fresh)
    if len(episodes) == 1:
        did = "found {itself} again" if last.given is None else "{was} lost until somebody gave a pose"
        return Outcome(did, step, "at step ", alone=f"{fresh}{because}")
    return Outcome("{was} lost again and again", step, f"{len(episodes)} times, until step ", alone=because)


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
    share = f"{verdict.converged_share:.0%}"
    if verdict.converged_share < MOSTLY:
        return Outcome("did not keep the dots together", share, "together at ", " of the steps")
    return Outcome("kept the dots together", share, "at ", " of the steps")


# A tour: at each moment where to look, what is seen there, and where the next moment is.

NAMES = {
    BEGINS: "the drive begins",
    FOUND: "localized",
    DIVIDED: "two places look alike",
    LOST: "it goes wrong",
    SURE: "sure of a wrong place",
    BACK: "localized again",
    ENDS: "the end",
}
WENT_ON = "The dots moved as odometry says; the white disk hardly moved."
LOOKS = {
    CARRIED: "The white disk jumps; odometry did not feel it.",
    JUMPED: "The white disk jumps; odometry did not feel it.",
    SLIPPED: WENT_ON,
    LEAPT: "The dots jump with odometry; the white disk does not.",
    OVERSTATED: WENT_ON,
    DARK: "The camera is dark: its picture fits no place more than others.",
}


DRAWS = {
    DRAWS_NEVER: "never draws new dots",
    DRAWS_EVENLY: "draws new dots anywhere once no dot fits",
    DRAWS_WHERE_LIKELY: "draws new dots where the picture fits",
}
DOT = "A **dot** is one guess of where the robot is (a particle); an **oval** holds most of a run's dots"
TRUTH = "; the **white** disk is where the robot really is"
CROWDED, MOST_CROWDED = 3, 4  # runs beside whose pictures there is little room for words
LETTERS, FEWEST_LETTERS = 650, 345  # that there is room for beside the pictures of a few, and of four
LANES = "**dark** localized, **gray** searching, **magenta** sure of a wrong place, **red** lost."
LANES_WITHOUT_TRUTH = "**dark** dots together, **gray** dots spread, **red** probably lost."
NOTICED = "Lane noticed: at **few heavy** few dots hold nearly all weight, at **reseeded** new ones begin"
NOTICED_OF_TRUTH = "; at **3 sigma** the truth is far outside of the dots"
GO_THERE = "Right-click a lane to go there."


def words(runs: Sequence[RunView], has_truth: bool = True) -> str:
    """Explain the words of the first screen, and what tells its runs apart."""
    draws = [DRAWS.get(run.draws_new or "", "") for run in runs]
    lanes = LANES if has_truth else LANES_WITHOUT_TRUTH
    parts = [lanes]
    if len(runs) < MOST_CROWDED:
        parts = [f"{DOT}{TRUTH if has_truth else ''}.", f"Lanes: {lanes}"]
        parts += [f"{NOTICED}{NOTICED_OF_TRUTH if has_truth else ''}."] if len(runs) == 1 else []
        parts += [GO_THERE]
    if all(draws) and len(set(draws)) > 1 and len(runs) < CROWDED:
        does = (f"`{run.short}` {draw}" for run, draw in zip(runs, draws, strict=True))
        draws_words = f"{'; '.join(does)}."
        parts.insert(0, of_scans(draws_words) if all(run.sees_alone for run in runs) else draws_words)
    return " ".join(parts)


def tour_pages(
    tour: Sequence[TourMoment],
    verdicts: Mapping[str, RunVerdict],
    scale: Scale,
    lessons: Mapping[int, str],
    explained: str = "",
    opens: str = "",
    letters: int = LETTERS,
) -> Iterator[tuple[int, str]]:
    """Yield each step of `lessons` with its Markdown: what it is about, its lesson, and the next moment.

    Each ends with the words that are `explained`; where these say what to do, with the command that walks
    through the step of what `opens`, a recording or a saved run, if there is one. Where there is no room for
    so many `letters`, that command is left out or where to look at a moment, then what is explained.
    """
    names = [_name(moment, len(verdicts) > 1) for moment in tour]
    has_truth = any(verdict.has_truth for verdict in verdicts.values())
    passed = -1  # number of the last moment
    for step, lesson in lessons.items():
        while passed + 1 < len(tour) and tour[passed + 1].step <= step:
            passed += 1
        title, look = f"**Step {step}.**", ""
        if passed >= 0 and tour[passed].step == step:
            title = f"**{passed + 1} of {len(tour)} · step {step}: {names[passed]}.**"
            look = _look(tour[passed], scale, has_truth)
        elif passed >= 0 and tour[passed].kind != BEGINS:
            title = f"**Step {step}**, after step {tour[passed].step} ({names[passed]})."
        parts = [title, look, f"**{lesson}**" if lesson else ""]
        if passed + 1 < len(tour):
            parts.append(f"Next: **step {tour[passed + 1].step}**, {names[passed + 1]}.")
        command = open_command(opens, Place(step, Phase.WEIGHT))
        walk = f" Phase by phase: `{command}`" if opens and explained.endswith(GO_THERE) else ""
        whole, short = (" ".join(filter(None, kept)) for kept in (parts, [title, *parts[2:]]))
        pages = [(text, below) for text in (whole, short) for below in (explained + walk, explained)]
        fitting = (page for page in pages if sum(map(len, page)) <= letters)
        yield step, "\n\n".join(filter(None, next(fitting, (short,))))


def _name(moment: TourMoment, several: bool) -> str:
    if isinstance(moment.fact, Incident):
        return moment.fact.about.title
    if isinstance(moment.fact, Failure):
        why = "" if moment.fact.kind == UNKNOWN else f": {moment.fact.title}"
        name = f"{NAMES[LOST]}{why}"
    else:
        name = NAMES.get(moment.kind, "farthest off")
    return f"`{moment.label}` {name.removeprefix('it ')}" if several and moment.label else name


def _look(moment: TourMoment, scale: Scale, has_truth: bool) -> str:
    """Return where to look at a moment, and what is seen there."""
    fact = moment.fact
    if isinstance(fact, Incident):
        return LOOKS.get(fact.kind, f"{say_incident(fact, scale)}.")
    if isinstance(fact, Failure):
        return f"Why it failed: {say_cause(fact, scale)}."
    if isinstance(fact, Ambiguity):
        return _two_places(fact, scale)
    if isinstance(fact, SureAndWrong):
        away = scale.say(fact.error_m)
        return f"{fact.share:.0%} of the weight is in one place, {away} from the white disk."
    if isinstance(fact, Episode):
        return _episode(moment, fact)
    if moment.kind == BEGINS:
        return "Move the time cursor at the bottom to follow the robot."
    if moment.kind == FOUND:
        return "The dots are together, at the white disk. The lane turns dark green."
    if moment.kind == ENDS:
        what = "far off the estimate was" if has_truth else "spread out the dots were"
        return f"The plot at the bottom has how {what} at each step."
    return "The plot at the bottom has the largest error of the drive here."


def _two_places(fact: Ambiguity, scale: Scale) -> str:
    truth = {0: " at neither", 1: " there", 2: " at the other one"}.get(fact.truth_in or 0, "")
    white = "" if fact.truth_in is None else f"; the white disk is{truth}"
    distance = scale.say(fact.apart_m)
    return f"Most dots are in two places, {distance} apart. The estimate is at the heavier one{white}."


def _episode(moment: TourMoment, episode: Episode) -> str:
    if moment.kind == LOST:
        plot = "In the plot at the bottom, what is above the red line is too far off."
        return f"{capital(episode.account)}. {plot}"
    after = f", after {episode.fresh} were drawn anew" if episode.fresh else ""
    return f"The dots are at the white disk again{after}. The lane turns dark green."
