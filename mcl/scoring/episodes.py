"""When a run was wrong: its episodes, each with one set of step numbers that all texts and drawings use.

An episode begins when the estimate gets lost, when the log says that the robot was carried away, or with a
run that does not know where it is; it ends when the run is localized (again). The definitions are those of
`metrics` (docs/evaluation.md): lost is too far off at four steps in a row and is declared at the fourth.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..values import Moment, StepRecord
from .lost_signal import LostSignal
from .metrics import LOCALIZED_OF, LOST_FOR, StepScore, first_mostly, score_step
from .modes import has_near
from .table import RunTable, TableRows

KIDNAPPED, LOST, SEARCHING, PROBABLY_LOST = "kidnapped", "lost", "searching", "probably-lost"
LOCALIZED, WRONG, CONVERGED, SPREAD = "localized", "wrong and confident", "converged", "spread"

STATES: Mapping[str, str] = {
    LOCALIZED: "converged and correct",
    SEARCHING: "not converged, or not correct and not converged",
    WRONG: "converged and not correct: nothing in the cloud warns of it",
    LOST: "too far off at four steps in a row, and still so",
    CONVERGED: "truth not known: at least 90 % of the weight near the estimate",
    SPREAD: "truth not known: less than that",
    PROBABLY_LOST: "truth not known: what it sees fits elsewhere, whatever the cloud says",
}

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
        began = f"kidnapped at step {self.first}" if self.wrong is None else f"wrong from step {self.wrong}"
        later = []
        if self.noticed is not None:
            early = self.noticed < self.onset
            text = f"{'doubted' if early else 'noticed'} without truth at step {self.noticed}"
            later.append((self.noticed, text))
        if self.lost is not None:
            later.append((self.lost, f"declared lost at step {self.lost}"))
        return ", ".join([began, *(text for _, text in sorted(later))])

    @property
    def ending(self) -> str:
        """How it ended, in words: "localized again from step 47"; empty where the account says it."""
        if self.kind in (SEARCHING, PROBABLY_LOST):
            return ""
        if self.localized is None:
            return "not localized again"
        given = "" if self.given is None else f", given a pose at step {self.given}"
        return f"localized again from step {self.localized}{given}"

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
class _Update:
    step: int
    score: StepScore
    fresh: int
    bereft: bool


@dataclass(slots=True)
class EpisodeFinder:
    """Follows one run update by update; keeps its episodes and six updates in numbers."""

    episodes: tuple[Episode, ...] = ()  # in order; the last one can be going on
    doubts: tuple[tuple[int, int], ...] = ()  # first and last step of each doubt of the lost signal
    localized: int | None = None  # first step at which it was localized; None: never
    score: StepScore = field(default=StepScore(None, None, False, None, None))  # of the last update
    signal: LostSignal = field(default_factory=LostSignal)
    _step: int = 0  # the last one
    _recent: tuple[_Update, ...] = ()  # the last six whose truth is known
    _since: int = 0  # of them, how many a kidnapping does not part from now
    _off: int = 0  # updates in a row that were too far off
    _knew: bool = False  # whether it knew where it is: right from the start, or once localized
    _given: int = 0  # the last step at which somebody gave the localizer a pose
    _open: bool = False  # whether the last episode is going on
    _doubts: bool = False  # whether the signal doubted the last update

    def add(self, moment: Moment, record: StepRecord) -> tuple[Episode, ...]:
        """Process the next update; return an episode in which the run is now declared lost or localized."""
        score, truth = score_step(record.estimate, moment.truth), moment.truth
        self.signal.add(record)
        reach_m = record.estimate.radii.cluster_m
        bereft = truth is not None and not score.localized and not has_near(record.weighted, truth, reach_m)
        return self.see(
            moment.frame.step,
            score,
            kidnapped=moment.kidnapped,
            given=bool(moment.told("given")),
            doubted=self.signal.probably_lost,
            fresh=0 if record.injected is None else int(record.injected.sum()),
            bereft=bereft,
        )

    def see(
        self,
        step: int,
        score: StepScore,
        *,
        kidnapped: bool = False,
        given: bool = False,
        doubted: bool = False,
        fresh: int = 0,
        bereft: bool = False,
    ) -> tuple[Episode, ...]:
        """Process the next update from its score; see `add`."""
        update = _Update(step, score, fresh, bereft)
        self._doubt(step, doubted)
        self._step, self.score, self._given = step, score, step if given else self._given
        if score.correct is None and not kidnapped:  # without truth nothing begins or ends
            if self._open:
                self._change(replace(self.episodes[-1], last=step))
            return ()
        self._recent = (*self._recent, update)[-LOCALIZED_OF[1] - 1 :]
        self._since = 1 if kidnapped else self._since + 1
        self._off = self._off + 1 if score.lost else 0
        if not self.episodes and self.localized is None and score.correct is not None:
            self._knew = score.localized is True
            self._begin(SEARCHING, (update,))
        elif kidnapped and self._knew:
            self._drop_search()
            self._begin(KIDNAPPED, (update,))
        elif self._open:
            self._change(_with(self.episodes[-1], (update,), 1))
            self._knew |= self._was_right_from_the_start()
        return self._changed()

    def _was_right_from_the_start(self) -> bool:
        """Return whether a search began with an estimate that was right, however wide its cloud was.

        As with LOCALIZED, at four of its first five updates: a single one may be chance in a small room.
        """
        window = self._recent[-LOCALIZED_OF[1] :]
        right = first_mostly(np.array([update.score.correct is True for update in window], bool)) == 1
        return right and window[0].step == self.episodes[-1].first

    def _doubt(self, step: int, doubted: bool) -> None:
        if doubted:
            first = self.doubts[-1][0] if self._doubts else step
            self.doubts = (*self.doubts[: len(self.doubts) - self._doubts], (first, step))
        self._doubts = doubted

    def _begin(self, kind: str, updates: tuple[_Update, ...]) -> None:
        """Begin an episode with some updates, the last of which is now; one that goes on ends before."""
        first = updates[0].step
        noticed = self.doubts[-1][0] if self.doubts and self.doubts[-1][1] >= first else None
        self.episodes = (*self.episodes, _with(Episode(kind, first, first, noticed=noticed), updates, 1))
        self._open = True

    def _change(self, episode: Episode) -> None:
        if self._doubts and episode.noticed is None:
            episode = replace(episode, noticed=self.doubts[-1][0])
        self.episodes = (*self.episodes[:-1], episode)

    def _changed(self) -> tuple[Episode, ...]:
        """Return the last episode if the run is declared lost in it, or localized, by the last update."""
        window = self._recent[-LOCALIZED_OF[1] :]
        if self.localized is None and _is_localized(window):
            self.localized = window[0].step
        was_lost = self._open and self.episodes[-1].lost is not None
        if self._off >= LOST_FOR and not was_lost:
            self._declare(self._recent[-LOST_FOR:])
            return self.episodes[-1:]
        if self._open and _is_localized(window[-self._since :]):
            return self._end(window[0].step)
        return ()

    def _drop_search(self) -> None:
        """Forget the search of a run that knew where it is from the start."""
        if self._open and self.episodes[-1].kind == SEARCHING and self._knew:
            self.episodes, self._open = self.episodes[:-1], False

    def _declare(self, off: tuple[_Update, ...]) -> None:
        """Declare it lost after these updates, in the episode that is going on or in one that they begin."""
        self._drop_search()
        if not self._open:
            self._begin(LOST, off)
        self._change(replace(self.episodes[-1], lost=off[-1].step))

    def _end(self, step: int) -> tuple[Episode, ...]:
        """End the last episode at the step from which on the run is localized, some updates ago."""
        episode = self.episodes[-1]
        after = [update for update in self._recent if update.step >= max(step, episode.first)]
        before = [update.step for update in self._recent if episode.first <= update.step < step]
        wrong, noticed = (
            None if at is not None and at >= step else at for at in (episode.wrong, episode.noticed)
        )
        episode = replace(
            _with(episode, after, -1),
            localized=step,
            given=self._given if episode.first < self._given <= step else None,
            last=before[-1] if before else step,
            wrong=wrong,
            noticed=noticed,
        )
        self._open, self._knew = False, True
        at_once = episode.kind == SEARCHING and not episode.steps
        self.episodes = (*self.episodes[:-1], *(() if at_once else (episode,)))
        return (episode,)

    @property
    def open_episode(self) -> Episode | None:
        """The episode that is going on."""
        return self.episodes[-1] if self._open else None

    @property
    def is_bereft(self) -> bool:
        """Whether no particle was near the truth at the last update."""
        return bool(self._recent) and self._recent[-1].bereft

    @property
    def doubt_begins(self) -> bool:
        """Whether the lost signal began to doubt the run at the last update."""
        return self._doubts and self.doubts[-1][0] == self._step

    @property
    def state(self) -> str:
        """The localization status at the last update: a key of STATES."""
        score = self.score
        if score.correct is None:
            doubted = PROBABLY_LOST if self.signal.probably_lost else ""
            return doubted or (CONVERGED if score.converged else SPREAD)
        if score.localized:
            return LOCALIZED
        if self.is_lost:
            return LOST
        return WRONG if score.wrong_and_confident else SEARCHING

    @property
    def is_lost(self) -> bool:
        """Whether the run is lost at the last update: too far off at four in a row, and still so."""
        return self._off >= LOST_FOR and self._open and self.episodes[-1].kind != SEARCHING


def table(steps: Iterable[tuple[Moment, StepRecord]]) -> RunTable:
    """Return what `run` yields as a table, one row per update; the clouds are not kept.

    >>> import maurice_mcl as mcl
    >>> made = mcl.table(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> made.updates, bool(made.is_localized[-1]), made.states[-1]
    (6, True, 'localized')
    """
    rows, finder = TableRows(), EpisodeFinder()
    for moment, record in steps:
        finder.add(moment, record)
        rows.add(moment, record, finder.signal.knows, finder.state)
    return rows.table()


def _is_localized(window: tuple[_Update, ...]) -> bool:
    """Return whether a run is localized from the first of five updates on: in at least four of them."""
    return first_mostly(np.array([update.score.localized is True for update in window], bool)) == 1


def _with(episode: Episode, updates: Iterable[_Update], sign: int) -> Episode:
    """Return an episode with some updates counted (`sign` 1), the last of which is its last, or not (-1)."""
    for update in updates:
        wrong = episode.wrong
        if sign > 0 and wrong is None and update.score.lost and episode.kind != SEARCHING:
            wrong = update.step
        episode = replace(
            episode,
            last=update.step,
            wrong=wrong,
            steps=episode.steps + sign,
            fresh=episode.fresh + sign * update.fresh,
            sure=episode.sure + sign * (update.score.wrong_and_confident is True),
            bereft=episode.bereft + sign * update.bereft,
        )
    return episode
