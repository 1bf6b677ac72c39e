"""The few moments of a recording that tell its story, in order, as its verdicts show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..scoring.episodes import SEARCHING, Episode
from .failures.ambiguity import Ambiguity
from .failures.causes import Cause
from .failures.kinds import Failure
from .failures.verdict import RunVerdict, SureAndWrong

BEGINS, FOUND, DIVIDED, BEFELL, CAUSED, LOST, SURE, BACK, WORST, ENDS = (
    "begins",
    "found",
    "divided",
    "befell",
    "caused",
    "lost",
    "sure",
    "back",
    "worst",
    "ends",
)
MOST = 5
IMPORTANT = (BEFELL, BACK, SURE, DIVIDED, CAUSED, LOST, FOUND, BEGINS, ENDS, WORST)  # the first ones are kept


@dataclass(frozen=True, slots=True)
class TourMoment:
    """One moment worth a look: its step, its kind, whose it is, and the fact that it is about."""

    step: int
    kind: str
    label: str = ""  # of the run; empty: of all
    fact: Cause | Failure | Episode | Ambiguity | SureAndWrong | None = None


def tour_of(verdicts: Mapping[str, RunVerdict]) -> tuple[TourMoment, ...]:
    """Return at most five moments, one per step, in order; none before the first update."""
    if not all(verdict.updates for verdict in verdicts.values()):
        return ()
    found = [*_of_all(verdicts)]
    for label, verdict in verdicts.items():
        found += _of_run(label, verdict)
    found.sort(key=lambda one: IMPORTANT.index(one.kind))
    kept: dict[int, TourMoment] = {}
    kinds = set[tuple[str, str]]()
    for one in found:
        if len(kept) < MOST and one.step not in kept and (one.kind, one.label) not in kinds:
            kept[one.step] = one
            if one.kind not in (BEFELL, LOST):
                kinds.add((one.kind, one.label))
    return tuple(kept[step] for step in sorted(kept))


def _of_all(verdicts: Mapping[str, RunVerdict]) -> Iterator[TourMoment]:
    """Yield what all runs share: begin and end, and what befell the robot."""
    first = next(iter(verdicts.values()))
    yield TourMoment(first.first, BEGINS)
    yield TourMoment(first.last, ENDS)
    causes = {(one.kind, one.step): one for verdict in verdicts.values() for one in verdict.telling_causes}
    for cause in causes.values():
        yield TourMoment(cause.shown_at, BEFELL, fact=cause)


def _of_run(label: str, verdict: RunVerdict) -> Iterator[TourMoment]:
    """Yield when a run was found, divided, lost and why, sure of it, and found again."""
    if verdict.telling is not None:
        yield TourMoment(verdict.telling.step, DIVIDED, label, verdict.telling)
    if verdict.found is not None and verdict.found > verdict.first + 1:
        yield TourMoment(verdict.found, FOUND, label)
    for failure in verdict.failures:
        if failure.first > verdict.first:
            yield TourMoment(failure.first, CAUSED, label, failure)
    for episode in verdict.episodes:
        if episode.wrong is not None:
            yield TourMoment(episode.wrong, LOST, label, episode)
        if episode.localized is not None and episode.kind != SEARCHING:
            yield TourMoment(episode.localized, BACK, label, episode)
    sure = verdict.sure_and_wrong
    if sure is not None and any(one.is_sure and one.first <= sure.step for one in verdict.episodes):
        yield TourMoment(sure.step, SURE, label, sure)
    if not verdict.episodes and verdict.has_truth:
        yield TourMoment(verdict.most_at, WORST, label)
