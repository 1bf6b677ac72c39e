"""A tour in words: at each moment where to look, what is seen there, and where the next moment is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from maurice_mcl.reasons.causes import CARRIED, CAUSES, DARK, JUMPED, OVERSTATED, SLIPPED, Failure
from maurice_mcl.reasons.incidents import Incident
from maurice_mcl.reasons.tour import BACK, BEGINS, DIVIDED, ENDS, FOUND, LOST, SURE, TourMoment
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.episodes import Episode

from ..scene import EVENLY, LIKELY, NEVER, RunView
from ..style import Scale
from .causes import say_cause, say_incident

NAMES = {
    BEGINS: "the drive begins",
    FOUND: "localized",
    DIVIDED: "two places look alike",
    LOST: "it goes wrong",
    SURE: "sure and wrong",
    BACK: "localized again",
    ENDS: "the end",
}
WENT_ON = "Map: the dots (particles) moved as odometry says; the white disk (the truth) hardly moved."
LOOKS = {
    CARRIED: "Map: the white disk (the truth) jumps. The dots (particles) do not: odometry has not seen it.",
    JUMPED: "Map: the white disk (the truth) jumps. The dots (particles) do not: odometry has not seen it.",
    SLIPPED: WENT_ON,
    OVERSTATED: WENT_ON,
    DARK: "The camera, on the right, is dark. The best match below it can be any place now.",
}


DRAWS = {
    NEVER: "never draws new dots",
    EVENLY: "draws new dots anywhere once no dot fits",
    LIKELY: "draws new dots where the picture fits",
}
DOT = "**Dot**: a particle, one guess of the pose. **Weight**: how well it fits."
RING = "**Ring**: a group of dots (mode); mode switch: another is heaviest now."
DIP = "**ESS dip**: few dots hold most of the weight."
SIGMA = "**2 sigma**: an oval around most dots"
BEYOND = "; 3 sigma: the truth is far outside it"
MATCH = "**q**: likeness to a reference, 0 to 1. **Fresh**: dots drawn anew (reseeded)."


def words(runs: Sequence[RunView]) -> str:
    """Explain the words of the first screen, and what tells its runs apart."""
    single = len(runs) == 1  # whose rings and whose every event are shown
    parts = [DOT, RING if single else "", f"{SIGMA}{BEYOND if single else ''}."]
    if not runs[0].is_recorded:
        parts += [DIP if single else "", MATCH]
    draws = [DRAWS.get(run.draws_new or "", "") for run in runs]
    if all(draws) and len(set(draws)) > 1:
        does = (f"`{run.label}` {draw}" for run, draw in zip(runs, draws, strict=True))
        parts.insert(0, f"{'; '.join(does)}.")
    return " ".join(part for part in parts if part)


def tour_pages(
    tour: tuple[TourMoment, ...], verdicts: Mapping[str, RunVerdict], scale: Scale, explained: str = ""
) -> list[tuple[int, str]]:
    """Return step and Markdown of each moment, to be shown from its step until the next one's.

    Each ends with the words that are `explained`.
    """
    names = [_name(moment, len(verdicts) > 1) for moment in tour]
    has_truth = next(iter(verdicts.values())).has_truth
    pages = []
    for number, (moment, name) in enumerate(zip(tour, names, strict=True)):
        title = f"**{number + 1} of {len(tour)} · step {moment.step}: {name}.**"
        look = _look(moment, scale, has_truth)
        if number + 1 < len(tour):
            look = f"{look} Next: **step {tour[number + 1].step}**, {names[number + 1]}."
        pages.append((moment.step, "\n\n".join(part for part in (f"{title} {look}", explained) if part)))
    return pages


def _name(moment: TourMoment, several: bool) -> str:
    if isinstance(moment.fact, Incident):
        return moment.fact.about.title
    if isinstance(moment.fact, Failure):
        name = f"the cause, {CAUSES[moment.fact.kind].title}"
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
        where = f"{away} from the white disk (the truth){none}"
        return f"Map: {fact.share:.0%} of the weight is in one place, {where}."
    if isinstance(fact, Episode):
        return _episode(moment, fact)
    if moment.kind == BEGINS:
        truth = " White: the truth, where the robot is." if has_truth else ""
        return f"Map: each dot is a particle, a guess of the pose.{truth} Move the time cursor at the bottom."
    if moment.kind == FOUND:
        return "Map: the dots are together, at the white disk (the truth). The lane below turns green."
    if moment.kind == ENDS:
        return "Errors, at the bottom: how far off the estimate was at each step."
    return "Errors, at the bottom: the largest error of the drive."


def _two_places(fact: Ambiguity, scale: Scale) -> str:
    truth = {0: " at neither", 1: " there", 2: " at the other one"}.get(fact.truth_in or 0, "")
    white = "" if fact.truth_in is None else f"; the white disk (the truth) is{truth}"
    distance = scale.say(fact.apart_m)
    return f"Map: most dots are in two places, {distance} apart. The estimate is at the heavier one{white}."


def _episode(moment: TourMoment, episode: Episode) -> str:
    if moment.kind == LOST:
        account = f"{episode.account[:1].upper()}{episode.account[1:]}"
        return f"{account}. Errors, at the bottom: above the red line is too far off."
    after = f", after {episode.fresh} were drawn anew" if episode.fresh else ""
    return f"Map: the dots are at the white disk (the truth) again{after}. The lane turns green."
