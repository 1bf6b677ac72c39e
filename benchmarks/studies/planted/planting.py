"""From a kind of cause and a number to a planted run: searched, checked for harm, and remembered."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np

from maurice_datasets.trials.drives import RenderedSession
from maurice_loaders.files.writing import cache_root
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.values.records import Comparison, StepRecord
from maurice_mcl.values.session import Moment

from .drives import VERSION, anywhere, plain_drive
from .harm import Outcome, compared_with, is_harm, localizer_of, outcome_of, steps_of
from .places import SETS, Ground, ground_of
from .ways import HEALTHY, SEARCHING, WAYS, Planting

DRIVES = 5  # tried for one planted run, each with a few seeds of the filter
FILTERS = 3
MANY = 40  # seeds of the filter, where harm is a matter of chance
PLACES = 4  # in each set
BETWEEN = 40  # between the seeds of drives that are tried one after another


@dataclass(frozen=True, slots=True, eq=False)
class Planted:
    """One run with one cause in it."""

    kind: str
    number: int
    planting: Planting
    localizer: Localizer  # with its seed
    comparisons: tuple[Comparison, ...]
    outcome: Outcome
    discarded: int  # runs tried before it in which the cause did no such harm

    def steps(self) -> Iterator[tuple[Moment, StepRecord]]:
        """Run it again."""
        return steps_of(self.localizer, self.planting, self.comparisons, self.localizer.seed)


@dataclass(frozen=True, slots=True)
class _Choice:
    """What a search chose: enough to make the run again."""

    drive_seed: int | None  # None: nothing that was tried did harm
    filter_seed: int = 0
    discarded: int = 0


def planted(kind: str, number: int, which: str = "develop") -> Planted | None:
    """Return planted run `number` of a kind, from one of the two sets; None where no drive tried did harm.

    The seeds that a search chose are remembered in the user's cache. Raises KeyError for an unknown kind.
    """
    ground = ground_of(*SETS[which].place_of(number))
    file = cache_root() / "planted" / f"{VERSION}-{which}-{kind}-{number}.json"
    if file.is_file():
        choice = _Choice(**json.loads(file.read_text(encoding="utf-8")))
        again = _again(kind, number, ground, choice)
        if again is None or is_harm(kind, again.planting, again.outcome):
            return again  # else the filter is another one since
    choice, planting_made = _searched(kind, number, ground, SETS[which].first + number)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(asdict(choice)), encoding="utf-8")
    return planting_made


def _searched(kind: str, number: int, ground: Ground, first: int) -> tuple[_Choice, Planted | None]:
    """Try drives and seeds of the filter until the cause does harm, and only the cause."""
    discarded = 0
    for drive_seed in range(first, first + DRIVES * BETWEEN, BETWEEN):
        planting = planting_of(kind, number, ground, drive_seed)
        localizer = localizer_of(planting)
        compared = _compared(ground, drive_seed, localizer, planting)
        for filter_seed in range(MANY if kind == "resampling" else FILTERS):
            outcome = _outcome(localizer, planting, compared, filter_seed)
            if is_harm(kind, planting, outcome) and _is_fine_without(kind, planting, ground, drive_seed):
                choice = _Choice(drive_seed, filter_seed, discarded)
                return choice, _made(kind, number, planting, localizer, compared, outcome, choice)
            discarded += 1
    return _Choice(None, discarded=discarded), None


def _again(kind: str, number: int, ground: Ground, choice: _Choice) -> Planted | None:
    """Make a run again that a search chose before."""
    if choice.drive_seed is None:
        return None
    planting = planting_of(kind, number, ground, choice.drive_seed)
    localizer = localizer_of(planting)
    compared = _compared(ground, choice.drive_seed, localizer, planting)
    outcome = _outcome(localizer, planting, compared, choice.filter_seed)
    return _made(kind, number, planting, localizer, compared, outcome, choice)


def _made(
    kind: str,
    number: int,
    planting: Planting,
    localizer: Localizer,
    compared: tuple[Comparison, ...],
    outcome: Outcome,
    choice: _Choice,
) -> Planted:
    seeded = replace(localizer, seed=choice.filter_seed)
    return Planted(kind, number, planting, seeded, compared, outcome, choice.discarded)


def planting_of(kind: str, number: int, ground: Ground, drive_seed: int) -> Planting:
    """Plant a cause in a drive; number after number in another of its ways, each in every world."""
    ways = WAYS[kind]
    rng = np.random.default_rng([drive_seed, list(WAYS).index(kind)])
    return ways[(number + number // PLACES) % len(ways)](ground, drive_seed, rng)


def _compared(
    ground: Ground, drive_seed: int, localizer: Localizer, planting: Planting
) -> tuple[Comparison, ...]:
    """Compare the pictures of a planted drive; most kinds share theirs."""
    if planting.library is not ground.library:
        return compared_with(plain_drive(ground, drive_seed), localizer, planting, {})
    known = _known(ground, drive_seed, repr(localizer.sensor.parameters))
    return compared_with(known[0], localizer, planting, known[1])


@lru_cache(4)
def _known(ground: Ground, drive_seed: int, sensor: str) -> tuple[RenderedSession, dict[int, Comparison]]:
    return plain_drive(ground, drive_seed), {}


def _outcome(localizer: Localizer, planting: Planting, compared: Sequence[Comparison], seed: int) -> Outcome:
    known = planting.session.info.start is not None
    return outcome_of(steps_of(localizer, planting, compared, seed), start_known=known)


def _is_fine_without(kind: str, planting: Planting, ground: Ground, drive_seed: int) -> bool:
    """Return whether a usual filter is not lost on the drive without the cause."""
    usual = SEARCHING if planting.session.info.start is None else planting.usual
    return kind == HEALTHY or not _without(ground, drive_seed, repr(usual)).failed


@lru_cache(16)
def _without(ground: Ground, drive_seed: int, usual: str) -> Outcome:
    plain, settings = plain_drive(ground, drive_seed), ast.literal_eval(usual)
    session = anywhere(plain) if settings == SEARCHING else plain
    planting = Planting("nothing", 1, session, ground.library, settings)
    localizer = localizer_of(planting)
    compared = _compared(ground, drive_seed, localizer, planting)
    return _outcome(localizer, planting, compared, 0)
