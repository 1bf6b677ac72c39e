"""Running one or several localizers over a session while others watch.

The command line, a notebook and the tests call the same functions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice

from maurice_loaders.libraries.measured import known_descriptors
from maurice_mcl.filter.localizer import ALL_ZERO, NO_NUMBER, Localizer
from maurice_mcl.reasons.rivals import with_rivals
from maurice_mcl.reasons.second_opinion import SecondOpinion
from maurice_mcl.reasons.verdict import RunVerdict, VerdictBuilder
from maurice_mcl.scoring.comparison import ComparisonResult, Step, compare, parting
from maurice_mcl.scoring.episodes import RunSoFar
from maurice_mcl.scoring.events import RunEvent, Say, in_meters
from maurice_mcl.scoring.lost_signal import SignalSummary
from maurice_mcl.scoring.metrics import RunScore, score_table
from maurice_mcl.scoring.table import RunTable, Standing
from maurice_mcl.sensor.ahead import Compared, compared, compared_ahead
from maurice_mcl.values import F64, NO_PICTURE, USUAL, Arena, Moment, Radii, StepRecord


@dataclass(frozen=True, slots=True)
class FilterRun:
    """One localizer under one name, from one start."""

    label: str  # unique among the runs of a recording
    localizer: Localizer
    start: F64 | None  # (3,) in the map's frame; None: anywhere
    configuration: str = ""  # effective configuration, as TOML


@dataclass(frozen=True, slots=True)
class RunResult:
    """The scores of one run."""

    label: str
    score: RunScore
    steps_per_s: float | None  # filter steps per second, without decoding and drawing; None before the first
    verdict: RunVerdict = field(default_factory=RunVerdict)  # what happened
    radii: Radii = USUAL  # by which it was judged
    against: str | None = None  # label of the run that it is compared with; None: the first or only one
    paired: ComparisonResult | None = None  # how it compares
    signal: SignalSummary | None = None  # whether it knew where it is, without truth; None: not known
    table: RunTable | None = field(default=None, repr=False, compare=False)  # the run, update by update


def run_together(
    runs: Sequence[FilterRun], moments: Iterable[Moment], *, live: bool = False
) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
    """Step all runs through the moments of one session side by side; every picture is decoded once.

    Each run owns its state and its randomness, so that its records are those of a run by itself, with a
    second opinion of each. Pictures are read and compared ahead of the filters, unless they come `live`.
    """
    states = {run.label: run.localizer.initialize(run.start) for run in runs}
    opinions = {run.label: SecondOpinion.beside(run.localizer) for run in runs}
    for moment, pictures in _compared(runs, moments, live):
        records = {}
        for run, picture in zip(runs, pictures, strict=True):
            states[run.label], record = run.localizer.step(states[run.label], moment.frame, picture)
            second = opinions[run.label]
            records[run.label] = record if second is None else second.added_to(record)
        yield moment, records


def _compared(
    runs: Sequence[FilterRun], moments: Iterable[Moment], live: bool
) -> Iterator[tuple[Moment, tuple[Compared, ...]]]:
    sensors, source = [run.localizer.sensor for run in runs], iter(moments)
    first = list(islice(source, 1))
    moments = chain(first, source)
    # to compare a scan takes less than to hand it to another thread
    if not live and not all(moment.frame.image is NO_PICTURE for moment in first):
        return compared_ahead(sensors, moments, known_descriptors())
    return ((moment, compared(sensors, moment.frame)) for moment in moments)


def shared(
    updates: Iterable[tuple[Moment, Mapping[str, StepRecord]]],
) -> Iterator[Mapping[str, Step]]:
    """Yield the updates of runs that share one drive, each run with its moment."""
    for moment, records in updates:
        yield {label: (moment, record) for label, record in records.items()}


def aligned(drives: Sequence[Iterable[Mapping[str, Step]]]) -> Iterator[Mapping[str, Step]]:
    """Yield updates of several drives together, by their number, until the shortest drive ends."""
    for parts in zip(*drives, strict=False):
        yield {label: step for part in parts for label, step in part.items()}


class ResultCollector:
    """Scores runs update by update; results are available at any time, also after an interruption."""

    def __init__(
        self,
        labels: Sequence[str],
        arena: Arena,
        say: Say = in_meters,
        other_drives: Collection[str] = (),
        localizers: Mapping[str, Localizer | None] | None = None,
        starts: Mapping[str, F64 | None] | None = None,
    ) -> None:
        """Score runs of these labels in an arena; all after the first against it.

        `other_drives` are the labels of those that replay another drive than the first one; with
        `localizers`, the runs' filters, failures are diagnosed by references, motion and map, too; with
        `starts`, poses (3,), runs are compared with their odometry alone. Scans of a run without a filter are
        laid on the arena's occupancy map.
        """
        self._arena_m = arena.size_m
        filters, starts = localizers or {}, starts or {}
        self._verdicts = {
            label: VerdictBuilder(filters.get(label), arena.occupancy, starts.get(label)) for label in labels
        }
        self._first, self._say, self._other_drives = labels[0], say, frozenset(other_drives)
        self._took_s = dict.fromkeys(labels, 0.0)
        self.updates = 0  # added so far
        self.all_zero = dict.fromkeys(labels, 0)  # updates at which all weights were zero, per run
        self.no_number = dict.fromkeys(labels, 0)  # of them those with likelihoods that are no numbers

    def add(self, moment: Moment, records: Mapping[str, StepRecord]) -> None:
        """Add one update of every run of one drive."""
        self.add_steps({label: (moment, record) for label, record in records.items()})

    def add_steps(self, steps: Mapping[str, Step]) -> None:
        """Add one update of every run, each with its own moment."""
        self.updates += 1
        for label, (moment, record) in steps.items():
            self.all_zero[label] += ALL_ZERO in record.events
            self.no_number[label] += NO_NUMBER in record.events
            self._verdicts[label].add(moment, record)
            self._took_s[label] += sum(record.took_s.values())

    def standings(self) -> dict[str, Standing | None]:
        """Return how each run stands now; None: not known."""
        return {label: builder.now for label, builder in self._verdicts.items()}

    def verdicts(self) -> dict[str, RunVerdict]:
        """Return what happened to each run, up to now."""
        verdicts = {label: builder.result() for label, builder in self._verdicts.items()}
        return with_rivals(verdicts, {label: self.table(label) for label in self._of_first_drive})

    def partings(self) -> dict[str, RunEvent]:
        """Return the event by which each run parts from the first, of those that do."""
        first, others = self.table(self._first), self._of_first_drive[1:]
        events = {
            label: parting(first, self.table(label), (self._first, label), self._say) for label in others
        }
        return {label: event for label, event in events.items() if event is not None}

    @property
    def _of_first_drive(self) -> list[str]:
        return [label for label in self._verdicts if label not in self._other_drives]

    def run(self, label: str) -> RunSoFar:
        """Return a run up to now, for those who draw it or tell its events."""
        return self._verdicts[label].run

    def table(self, label: str) -> RunTable:
        """Return a run as a table, up to now."""
        return self._verdicts[label].table

    def results(self) -> list[RunResult]:
        """Return a result for each run, in order, up to now."""
        verdicts = self.verdicts()
        return [self._result(label, verdicts[label]) for label in self._verdicts]

    def _result(self, label: str, verdict: RunVerdict) -> RunResult:
        took_s, table = self._took_s[label], self.table(label)
        score = score_table(table, self._arena_m)
        per_s = score.updates / took_s if took_s > 0 else None
        signal = self.run(label).signal.summary()
        result = RunResult(label, score, per_s, verdict, table.radii, signal=signal, table=table)
        if label == self._first:
            return result
        paired = compare(self.table(self._first), table, same_drive=label not in self._other_drives)
        return replace(result, against=self._first, paired=paired)
