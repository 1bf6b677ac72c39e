"""The few moments of a recording that tell its story, in order, as its verdicts show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..scoring.episodes import Episode
from ..scoring.table import SEARCHING
from .causes import Failure, Incident
from .verdict import Ambiguity, RunVerdict, SureAndWrong

BEGINS, FOUND, DIVIDED, BEFELL, CAUSED = "begins", "found", "divided", "befell", "caused"
LOST, SURE, BACK, WORST, ENDS = "lost", "sure", "back", "worst", "ends"
MOST_MOMENTS, MOST_BEFELL = 5, 2  # of these what befell the robot: a long drive has many slips
IMPORTANT = (BEFELL, BACK, SURE, DIVIDED, CAUSED, LOST, FOUND, BEGINS, ENDS, WORST)  # the first ones are kept


@dataclass(frozen=True, slots=True)
class TourMoment:
    """One moment worth a look: its step, its kind, whose it is, and the fact that it is about."""

    step: int
    kind: str
    label: str = ""  # of the run; empty: of all
    fact: Incident | Failure | Episode | Ambiguity | SureAndWrong | None = None


def tour_of(verdicts: Mapping[str, RunVerdict]) -> tuple[TourMoment, ...]:
    """Return at most five moments, one per step, in order; none before the first update."""
    if not all(verdict.updates for verdict in verdicts.values()):
        return ()
    moments = [*_of_all(verdicts)]
    for label, verdict in verdicts.items():
        moments += _of_run(label, verdict)
    moments.sort(key=lambda moment: IMPORTANT.index(moment.kind))
    tour: dict[int, TourMoment] = {}
    kinds = set[tuple[str, str]]()
    for moment in moments:
        if len(tour) < MOST_MOMENTS and moment.step not in tour and (moment.kind, moment.label) not in kinds:
            tour[moment.step] = moment
            if moment.kind not in (BEFELL, LOST):
                kinds.add((moment.kind, moment.label))
    return tuple(tour[step] for step in sorted(tour))


def _of_all(verdicts: Mapping[str, RunVerdict]) -> Iterator[TourMoment]:
    """Yield what all runs share: begin and end, and what befell the robot."""
    first = next(iter(verdicts.values()))
    yield TourMoment(first.first, BEGINS)
    yield TourMoment(first.last, ENDS)
    incidents = {(i.kind, i.step): i for verdict in verdicts.values() for i in verdict.telling_incidents}
    for incident in list(incidents.values())[:MOST_BEFELL]:
        yield TourMoment(incident.shown_at, BEFELL, fact=incident)


def _of_run(label: str, verdict: RunVerdict) -> Iterator[TourMoment]:
    """Yield when a run was found, divided, lost and why, sure of it, and found again."""
    if verdict.telling is not None:
        yield TourMoment(verdict.telling.step, DIVIDED, label, verdict.telling)
    if verdict.localized is not None and verdict.localized > verdict.first + 1:
        yield TourMoment(verdict.localized, FOUND, label)
    for failure in verdict.failures:
        if failure.first > verdict.first:
            yield TourMoment(failure.first, CAUSED, label, failure)
    for episode in verdict.episodes:
        if episode.wrong is not None:
            yield TourMoment(episode.wrong, LOST, label, episode)
        if episode.localized is not None and episode.kind != SEARCHING:
            yield TourMoment(episode.localized, BACK, label, episode)
    sure = verdict.sure_and_wrong
    if sure is not None and any(e.is_sure and e.first <= sure.step for e in verdict.episodes):
        yield TourMoment(sure.step, SURE, label, sure)
    if not verdict.episodes and verdict.has_truth:
        yield TourMoment(verdict.most_at, WORST, label)
