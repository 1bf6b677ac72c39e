"""When a run was wrong: its episodes, each with one set of step numbers that all texts and drawings use.

An episode begins when the estimate gets lost, when the log says that the robot was carried away, or with a
run that does not know where it is; it ends when the run is localized (again). The definitions are those of
`metrics` (docs/evaluation.md): lost is too far off at four steps in a row and is declared at the fourth.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..values import Bool, Moment, StepRecord
from .lost_signal import KNOWS_ABOVE, LostSignal
from .metrics import score_step
from .modes import has_near
from .table import (
    KIDNAPPED,
    LOCALIZED,
    LOCALIZED_OF,
    LOST,
    LOST_FOR,
    PROBABLY_LOCALIZED,
    PROBABLY_LOST,
    SEARCHING,
    RunTable,
    Standing,
    TableRows,
    endings,
    in_a_row,
    knew_at,
    mostly,
)

MOST_SHARE = 0.5  # share of the steps of an episode from which on it counts as sure, or as bereft
SURE_STEPS = 10  # steps confident of a wrong place, from which on also a search that ends well has failed


@dataclass(frozen=True, slots=True)
class Episode:
    """One time that a run was wrong. Steps are numbers of pictures; None: that did not happen.

    `kind` is LOST, KIDNAPPED (the log says so), SEARCHING (it had not been localized before) or, of a run
    whose truth is not known, PROBABLY_LOST.
    """

    kind: str
    first: int  # step at which it began
    last: int  # and its last one: before it was localized, before the next kidnapping, or the last so far
    wrong: int | None = None  # first step at which the estimate was too far off; None of a search
    noticed: int | None = None  # step at which the lost signal, which knows no truth, began to doubt the run
    lost: int | None = None  # step at which it was declared lost: the fourth too far off in a row
    localized: int | None = None  # first step at which it was localized (again)
    given: int | None = None  # step of it, or at its end, at which somebody gave the localizer a pose
    steps: int = 0  # how many steps it lasted
    fresh: int = 0  # particles that recovery drew in these
    sure: int = 0  # steps of them wrong and confident
    bereft: int = 0  # steps of them without a particle near the truth

    @property
    def onset(self) -> int:
        """The first step at which the run was wrong, as far as that is known."""
        return self.first if self.wrong is None else self.wrong

    @property
    def account(self) -> str:
        """In words: "wrong from step 41, noticed without truth at step 43, declared lost at step 44"."""
        if self.kind == SEARCHING:
            return f"not localized from step {self.first} to {self.last}"
        if self.kind == PROBABLY_LOST:
            return f"probably lost from step {self.first} to {self.last}"
        beginning = (
            f"kidnapped at step {self.first}" if self.wrong is None else f"wrong from step {self.wrong}"
        )
        later = []
        if self.noticed is not None:
            early = self.noticed < self.onset
            text = f"{'doubted' if early else 'noticed'} without truth at step {self.noticed}"
            later.append((self.noticed, text))
        if self.lost is not None:
            later.append((self.lost, f"declared lost at step {self.lost}"))
        return ", ".join([beginning, *(text for _, text in sorted(later))])

    @property
    def ending(self) -> str:
        """How it ended, in words: "localized again from step 47"; empty where the account says it."""
        if self.kind in (SEARCHING, PROBABLY_LOST):
            return ""
        if self.localized is None:
            return "not localized again"
        remark = "" if self.given is None else f", given a pose at step {self.given}"
        return f"localized again from step {self.localized}{remark}"

    @property
    def is_sure(self) -> bool:
        """Whether the filter was confident of a wrong place: in most of these steps, or long in a search."""
        return self.sure >= SURE_STEPS if self.kind == SEARCHING else self.sure > MOST_SHARE * self.steps

    @property
    def is_bereft(self) -> bool:
        """Whether in most of these steps no particle was near the truth: weighting alone cannot find it."""
        return self.bereft > MOST_SHARE * self.steps

    @property
    def is_failure(self) -> bool:
        """Whether the filter failed: was lost, was never localized, or was sure of a wrong place for long."""
        if self.kind != SEARCHING:
            return self.lost is not None or self.kind == PROBABLY_LOST
        return self.is_sure or (self.localized is None and self.steps >= LOST_FOR)


@dataclass(frozen=True, slots=True)
class Episodes:
    """When a run was wrong; updates are counted from 0."""

    episodes: tuple[Episode, ...]  # in order
    is_open: bool  # whether the last of them is going on
    localized: int | None  # first step at which it was localized; None: never
    changes: tuple[tuple[int, Episode], ...]  # updates at which it is known to be lost, or localized (again)


def episodes(run: RunTable) -> Episodes:
    """Return when a run was wrong: without truth nothing begins or ends.

    >>> import maurice_mcl as mcl
    >>> made = mcl.table(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> episodes(made).episodes, episodes(made).localized
    ((), 1)
    """
    if run.knew_before and run.is_calm.all():
        return Episodes((), False, None, ())
    marks = _Marks.of(run)
    wrong, changes, is_open = list[Episode](), list[tuple[int, Episode]](), False
    for span in _spans(marks):
        until = run.updates if span.carried is None else int(marks.updates[span.carried])
        whole = _episode(run, marks, span, until)
        if span.lost is not None:
            row = int(marks.updates[span.lost])
            so_far = replace(span, localized=None, carried=span.lost + 1)
            changes.append((row, _episode(run, marks, so_far, row + 1)))
        if span.localized is not None:
            changes.append((int(marks.updates[span.localized + LOCALIZED_OF[1] - 1]), whole))
        is_open = span.localized is None and span.carried is None
        if span.kind != SEARCHING or whole.steps:  # one that was localized at once never searched
            wrong.append(whole)
    settled = marks.updates[mostly(run.is_localized[marks.updates])]
    localized = int(run.steps[settled[0]]) if len(settled) else None
    return Episodes(tuple(wrong), is_open, localized, tuple(changes))


def doubts(run: RunTable) -> tuple[tuple[int, int], ...]:
    """Return the first and last step of each time that the lost signal doubted a run."""
    edges = np.flatnonzero(np.diff(run.doubted, prepend=False, append=False)).reshape(-1, 2).tolist()
    return tuple((int(run.steps[first]), int(run.steps[stop - 1])) for first, stop in edges)


@dataclass(frozen=True, slots=True, eq=False)
class _Marks:
    """What begins and ends episodes; all numbers are of the J judged updates."""

    updates: NDArray[np.intp]  # (J,) their rows in the table
    off: Bool  # (J,)
    sure: Bool  # (J,) of a wrong place
    lost: NDArray[np.intp]  # at which it is too far off for the fourth time in a row, or longer
    kidnapped: NDArray[np.intp]
    ends: NDArray[np.intp]  # from which on it is localized
    search: int | None  # with which it begins: the first with a true pose
    knew: int | None  # from which on it knew where it was

    @classmethod
    def of(cls, run: RunTable) -> _Marks:
        judged = run.judged
        known, off = run.known[judged], run.is_off[judged]
        return cls(
            judged,
            off,
            known & run.is_converged[judged] & ~run.is_correct[judged],
            np.flatnonzero(in_a_row(off) >= LOST_FOR),
            np.flatnonzero(run.kidnapped[judged]),
            np.flatnonzero(endings(run)),
            None if run.knew_before or not known.any() else int(known.argmax()),
            knew_at(run),
        )


@dataclass(frozen=True, slots=True)
class _Span:
    """An episode by numbers of judged updates."""

    kind: str
    first: int
    known: int  # at which it is known that it began
    lost: int | None = None  # at which it is declared lost
    localized: int | None = None  # from which on it is localized
    carried: int | None = None  # at which the robot was carried away while it went on


def _spans(marks: _Marks) -> Iterator[_Span]:
    """Yield the episodes of a run, in order."""
    span = _search(marks)
    while span is not None:
        localized = _first(marks.ends, span.first)
        carried = None if span.kind == SEARCHING else _first(marks.kidnapped, span.known + 1)
        if carried is not None and (localized is None or carried <= localized):
            localized = None
        else:
            carried = None
        lost = _first(marks.lost, span.known)
        if lost is not None and lost >= _stop(marks, localized, carried):
            lost = None
        yield replace(span, lost=lost, localized=localized, carried=carried)
        if carried is not None:
            span = _Span(KIDNAPPED, carried, carried)
        else:
            span = None if localized is None else _begun(marks, localized + LOCALIZED_OF[1] - 1)


def _search(marks: _Marks) -> _Span | None:
    """Return the search that a run begins with, or what follows, if it knew where it was before its end."""
    onset = None if marks.knew is None else _begun(marks, marks.knew)
    if marks.search is None:
        return onset
    localized = _first(marks.ends, marks.search)
    if onset is not None and (localized is None or onset.known < localized + LOCALIZED_OF[1]):
        return onset
    return _Span(SEARCHING, marks.search, marks.search)


def _begun(marks: _Marks, after: int) -> _Span | None:
    """Return what begins next, after an update at which a run knew where it was: carried away, or lost."""
    carried, lost = _first(marks.kidnapped, after + 1), _first(marks.lost, after + 1)
    if carried is not None and (lost is None or carried <= lost):
        return _Span(KIDNAPPED, carried, carried)
    return None if lost is None else _Span(LOST, lost - LOST_FOR + 1, lost)


def _first(updates: NDArray[np.intp], least: int) -> int | None:
    """Return the first of some updates, in order, from one on."""
    place = int(np.searchsorted(updates, least))
    return int(updates[place]) if place < len(updates) else None


def _stop(marks: _Marks, localized: int | None, carried: int | None) -> int:
    """Return the first judged update after an episode."""
    ends = [update for update in (localized, carried) if update is not None]
    return min(ends, default=len(marks.updates))


def _episode(run: RunTable, marks: _Marks, span: _Span, until: int) -> Episode:
    """Return an episode as the updates of the table before `until` tell it."""
    judged = slice(span.first, _stop(marks, span.localized, span.carried))
    during, steps = marks.updates[judged], run.steps
    off = during[marks.off[judged]]
    noticed = _noticed(run, int(marks.updates[span.first]), int(marks.updates[span.known]), until)
    last, localized, step_given = int(steps[until - 1]), None, None
    first = int(steps[marks.updates[span.first]])
    if span.localized is not None:
        localized = int(steps[marks.updates[span.localized]])
        last = int(steps[during[-1]]) if len(during) else localized
        noticed = None if noticed is not None and noticed >= localized else noticed
        given_at = steps[np.flatnonzero(run.given[: marks.updates[span.localized + LOCALIZED_OF[1] - 1] + 1])]
        step_given = int(given_at[-1]) if len(given_at) and first < given_at[-1] <= localized else None
    return Episode(
        span.kind,
        first,
        last,
        wrong=int(steps[off[0]]) if len(off) and span.kind != SEARCHING else None,
        noticed=noticed,
        lost=None if span.lost is None else int(steps[marks.updates[span.lost]]),
        localized=localized,
        given=step_given,
        steps=len(during),
        fresh=int(run.fresh[during].sum()),
        sure=int(marks.sure[judged].sum()),
        bereft=int(run.bereft[during].sum()),
    )


def _noticed(run: RunTable, first: int, known: int, until: int) -> int | None:
    """Return the step at which the doubt began that was there when an episode began, or came first in it."""
    doubted = np.flatnonzero(run.doubted[first:until]) + first
    if not len(doubted):
        return None
    early = doubted[doubted <= known]
    sure = np.flatnonzero(~run.doubted[: early[-1] if len(early) else doubted[0]])
    if not len(sure) and run.before is not None and run.before.state == PROBABLY_LOST:
        return run.before.since
    return int(run.steps[sure[-1] + 1 if len(sure) else 0])


def standing(run: RunTable, told: Episodes | None = None) -> Standing | None:
    """Return how a run stands at its last update; None: not known yet, or nothing can tell.

    By its episodes, `told` where they are known, or while no truth was seen by the lost signal.
    """
    if run.knew_before and run.is_calm.all():  # as it did: most updates of a live run
        return run.before
    return _by_truth(run, told or episodes(run)) if run.known.any() else _by_signal(run)


def _by_truth(run: RunTable, told: Episodes) -> Standing:
    if told.is_open:
        episode = told.episodes[-1]
        declared = LOST if episode.lost is not None and episode.kind != SEARCHING else episode.kind
        return Standing(declared, episode.onset)
    if told.episodes:
        localized = told.episodes[-1].localized
    else:
        localized = run.before.since if run.before is not None and run.knew_before else told.localized
    assert localized is not None, "what ended was localized"
    return Standing(LOCALIZED, localized)


def _by_signal(run: RunTable) -> Standing | None:
    known = np.flatnonzero(~np.isnan(run.knows))
    if not len(known):
        return run.before
    rows = slice(int(known[0]), None)
    steps, doubted, unclear = run.steps[rows], run.doubted[rows], run.places[rows] > 1
    knows = run.knows[rows] > KNOWS_ABOVE
    # it doubts no run that knew where it was before the alarm, unless another place is as likely
    knew = run.before is not None and run.before.state == PROBABLY_LOCALIZED
    localized = latched(knows, doubted | (unclear & ~knows), begun=knew)
    states = np.select([doubted, localized], [PROBABLY_LOST, PROBABLY_LOCALIZED], SEARCHING)
    state = str(states[-1])
    others = np.flatnonzero(states != state)
    since = int(steps[others[-1] + 1 if len(others) else 0])
    if not len(others) and run.before is not None and run.before.state == state:
        since = run.before.since
    return Standing(state, since, int(run.places[-1]))


def latched(sets: Bool, resets: Bool, *, begun: bool = False) -> Bool:
    """Return where (U,) something is on: since it was set last, and not reset at that update or since."""
    updates = np.arange(2, len(sets) + 2)
    last_set = np.maximum.accumulate(np.where(sets, updates, int(begun)))
    return last_set > np.maximum.accumulate(np.where(resets, updates, 0))


@dataclass(slots=True)
class Recent:
    """The last rows of a run that goes on: what comes next needs no others, so that no step costs more."""

    rows: TableRows
    before: Standing | None = None  # how it stood at the first of them
    _first: int = 0
    _table: RunTable | None = None  # what was asked for last, of so many updates
    _updates: int = 0
    _told: Episodes | None = None  # of this table, once it was asked for
    _now: Standing | None = None
    _is_judged: bool = False  # whether `_now` is of this table

    def table(self) -> RunTable:
        """Return them, for all who ask at one update the same."""
        if self._table is None or self._updates != self.rows.updates:
            self._table = self.rows.table(first=self._first, before=self.before)
            self._updates, self._told, self._is_judged = self.rows.updates, None, False
        return self._table

    def episodes(self) -> Episodes:
        """Return when the run was wrong, as far as these rows tell."""
        run = self.table()
        if self._told is None:
            self._told = episodes(run)
        return self._told

    def standing(self) -> Standing | None:
        """Return how the run stands at its last update; rows that are needed no longer are let go of then."""
        run = self.table()
        if not self._is_judged:
            self._now, self._is_judged = standing(run, self.episodes()), True
            if run.updates and _is_at_rest(run, self._now):
                self._first, self.before = self.rows.updates - 1, self._now
        return self._now


@dataclass(slots=True)
class RunSoFar:
    """A run that goes on: its table and its lost signal, followed once for all that read them."""

    rows: TableRows = field(default_factory=TableRows)
    signal: LostSignal = field(default_factory=LostSignal)
    recent: Recent = field(init=False)

    def __post_init__(self) -> None:
        self.recent = Recent(self.rows)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        self.signal.add(record)
        self.rows.add(moment, record, self.signal, bereft=is_bereft(moment, record))


def _is_at_rest(run: RunTable, now: Standing | None) -> bool:
    """Return whether nothing goes on at the last update that earlier ones belong to."""
    if not run.known.any():
        return True
    return now is not None and now.state == LOCALIZED and bool(run.is_calm[-LOCALIZED_OF[1] :].all())


def is_bereft(moment: Moment, record: StepRecord) -> bool:
    """Return whether no particle is near the truth, of an estimate that is not localized."""
    truth = moment.truth
    if truth is None or score_step(record.estimate, truth).localized:
        return False
    return not has_near(record.weighted, truth, record.estimate.radii.cluster_m)


def table(steps: Iterable[tuple[Moment, StepRecord]]) -> RunTable:
    """Return what `run` yields as a table, one row per update; the clouds are not kept.

    >>> import maurice_mcl as mcl
    >>> made = mcl.table(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> made.updates, bool(made.is_localized[-1]), made.states[-1]
    (6, True, 'localized')
    """
    run = RunSoFar()
    for moment, record in steps:
        run.add(moment, record)
    return run.rows.table()
