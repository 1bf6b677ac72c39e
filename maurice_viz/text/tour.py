"""A tour of the first screen: at each moment where to look, what is seen there, and what comes next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from maurice_mcl.filter.recovery import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.causes import (
    CARRIED,
    DARK,
    JUMPED,
    LEAPT,
    SLIPPED,
    UNKNOWN,
    Failure,
    Incident,
)
from maurice_mcl.reasons.tour import BACK, BEGINS, DIVIDED, ENDS, FOUND, LOST, SURE, TourMoment
from maurice_mcl.reasons.verdict import Ambiguity, RunVerdict, SureAndWrong
from maurice_mcl.scoring.episodes import Episode

from ..entities import Phase, Place, open_command
from ..scene import RunView
from ..style import Scale, capital
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
    CARRIED: "The white disk jumps; odometry did not feel it.",
    JUMPED: "The white disk jumps; odometry did not feel it.",
    SLIPPED: WENT_ON,
    LEAPT: "The dots jump with odometry; the white disk does not.",
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
    previous = -1  # number of the last moment
    for step, lesson in lessons.items():
        while previous + 1 < len(tour) and tour[previous + 1].step <= step:
            previous += 1
        title, look = f"**Step {step}.**", ""
        if previous >= 0 and tour[previous].step == step:
            title = f"**{previous + 1} of {len(tour)} · step {step}: {names[previous]}.**"
            look = _look(tour[previous], scale, has_truth)
        elif previous >= 0 and tour[previous].kind != BEGINS:
            title = f"**Step {step}**, after step {tour[previous].step} ({names[previous]})."
        parts = [title, look, f"**{lesson}**" if lesson else ""]
        if previous + 1 < len(tour):
            parts.append(f"Next: **step {tour[previous + 1].step}**, {names[previous + 1]}.")
        command = open_command(opens, Place(step, Phase.WEIGHT))
        walk = f" Phase by phase: `{command}`" if opens and explained.endswith(GO_THERE) else ""
        whole, short = (" ".join(filter(None, sentences)) for sentences in (parts, [title, *parts[2:]]))
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
