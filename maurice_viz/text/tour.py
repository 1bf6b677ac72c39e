"""A tour in words: at each moment where to look, what is seen there, and where the next moment is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from maurice_mcl.reasons.causes import CARRIED, DARK, JUMPED, OVERSTATED, SLIPPED, Failure
from maurice_mcl.reasons.incidents import Incident
from maurice_mcl.reasons.tour import BACK, BEGINS, DIVIDED, ENDS, FOUND, LOST, SURE, TourMoment
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.episodes import Episode

from ..scene import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY, RunView
from ..style import Scale
from .causes import say_cause, say_incident
from .phases import of_scans

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
    CARRIED: "The white disk jumps; the dots do not: odometry did not feel it.",
    JUMPED: "The white disk jumps; the dots do not: odometry did not feel it.",
    SLIPPED: WENT_ON,
    OVERSTATED: WENT_ON,
    DARK: "The camera is dark. The best match beside it can be any place now.",
}


DRAWS = {
    DRAWS_NEVER: "never draws new dots",
    DRAWS_EVENLY: "draws new dots anywhere once no dot fits",
    DRAWS_WHERE_LIKELY: "draws new dots where the picture fits",
}
DOT = "A **dot** is one guess of where the robot is (a particle); an **oval** holds most of a run's dots"
TRUTH = "; the **white** disk is where the robot really is"
CROWDED = 3  # runs beside whose pictures there is little room for words
LANES = "Lanes: **dark** localized, **gray** searching, **magenta** sure of a wrong place, **red** lost."
LANES_WITHOUT_TRUTH = "Lanes: **dark** dots together, **gray** dots spread, **red** probably lost."
NOTICED = "Lane noticed: at **few count** few dots hold nearly all weight, at **reseeded** new ones begin"
NOTICED_OF_TRUTH = "; at **3 sigma** the truth is far outside of the dots"
GO_THERE = "Right-click a lane to go there."


def words(runs: Sequence[RunView], has_truth: bool = True) -> str:
    """Explain the words of the first screen, and what tells its runs apart."""
    draws = [DRAWS.get(run.draws_new or "", "") for run in runs]
    parts = [f"{DOT}{TRUTH if has_truth else ''}."]
    if len(runs) < CROWDED:
        parts += [LANES if has_truth else LANES_WITHOUT_TRUTH]
        parts += [f"{NOTICED}{NOTICED_OF_TRUTH if has_truth else ''}."] if len(runs) == 1 else []
        parts += [GO_THERE]
    if all(draws) and len(set(draws)) > 1 and len(runs) < CROWDED:
        does = (f"`{run.label}` {draw}" for run, draw in zip(runs, draws, strict=True))
        draws_words = f"{'; '.join(does)}."
        parts.insert(0, of_scans(draws_words) if all(run.sees_alone for run in runs) else draws_words)
    return " ".join(parts)


def tour_pages(
    tour: tuple[TourMoment, ...], verdicts: Mapping[str, RunVerdict], scale: Scale, explained: str = ""
) -> list[tuple[int, str]]:
    """Return step and Markdown of each moment, to be shown from its step until the next one's.

    Each ends with the words that are `explained`, and where these say what to do, with the command that walks
    through the step.
    """
    names = [_name(moment, len(verdicts) > 1) for moment in tour]
    has_truth = any(verdict.has_truth for verdict in verdicts.values())
    pages = []
    for number, (moment, name) in enumerate(zip(tour, names, strict=True)):
        title = f"**{number + 1} of {len(tour)} · step {moment.step}: {name}.**"
        look = _look(moment, scale, has_truth)
        if number + 1 < len(tour):
            look = f"{look} Next: **step {tour[number + 1].step}**, {names[number + 1]}."
        walk = f"Phase by phase: `maurice-replay open FILE --step {moment.step} --phase weight`"
        below = f"{explained} {walk}" if explained.endswith(GO_THERE) else explained
        pages.append((moment.step, "\n\n".join(part for part in (f"{title} {look}", below) if part)))
    return pages


def _name(moment: TourMoment, several: bool) -> str:
    if isinstance(moment.fact, Incident):
        return moment.fact.about.title
    if isinstance(moment.fact, Failure):
        name = f"the cause, {moment.fact.title}"
    else:
        name = NAMES.get(moment.kind, "farthest off")
    return f"`{moment.label}` {name}" if several and moment.label else name


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
        none = "; no dot is near it" if fact.bereft else ""
        where = f"{away} from the white disk{none}"
        return f"{fact.share:.0%} of the weight is in one place, {where}."
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
        account = f"{episode.account[:1].upper()}{episode.account[1:]}"
        return f"{account}. In the plot at the bottom, what is above the red line is too far off."
    after = f", after {episode.fresh} were drawn anew" if episode.fresh else ""
    return f"The dots are at the white disk again{after}. The lane turns dark green."
