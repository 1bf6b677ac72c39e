"""The events of saved runs: found again from what was saved, without pictures, library or filtering."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TypeAlias

from rich.table import Table
from rich.text import Text

from maurice_loaders.errors import InputError
from maurice_loaders.runs.bookmarks import Bookmark, Bookmarks, read_bookmarks
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.analysis.events import KINDS, EventDetector, RunEvent
from maurice_mcl.analysis.run_comparison import RunComparison
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..style import Scale, units_named
from .restoring import Pictures, Restored, restored_together

Update: TypeAlias = tuple[Moment, StepRecord]

ALL_RUNS = "all"  # in a table: what is the same for every run of a comparison


@dataclass(frozen=True, slots=True)
class RunEvents:
    """One run, and all that happened in it, in order."""

    label: str
    events: tuple[RunEvent, ...]


@dataclass(frozen=True, slots=True)
class FoundEvents:
    """What a folder of a run or of a comparison holds."""

    runs: tuple[RunEvents, ...]
    session: str  # its name, which is also that of its recordings
    problems: tuple[str, ...]  # lines of bookmarks that cannot be read, a line a file


def find_events(folder: Path) -> FoundEvents:
    """Find the events of a saved run or of a comparison, with the bookmarks beside them.

    InputError when it is none, or is damaged.
    """
    runs = open_runs(folder)
    notes = find_notes(folder, runs)
    watched = [_Watched.of(run, runs[0], notes.by_label[run.manifest.label]) for run in runs]
    for updates in zip_longest(*(_updates(run) for run in runs)):
        for one, update in zip(watched, updates, strict=True):
            if update is not None:
                one.see(updates[0], update)
    done = tuple(RunEvents(one.label, tuple(one.events)) for one in watched)
    return FoundEvents(done, runs[0].manifest.name, notes.problems)


@dataclass(slots=True)
class _Watched:
    """One run while its events are found; the first run of a comparison has no pairing."""

    label: str
    detector: EventDetector
    pairing: RunComparison | None
    events: list[RunEvent]

    @classmethod
    def of(cls, run: SavedRun, first: SavedRun, notes: Mapping[int, Sequence[str]]) -> _Watched:
        own, other = run.manifest, first.manifest
        say = Scale(units_named(own.display_units)).say
        same = own.session.sha256 == other.session.sha256
        pairing = None if run is first else RunComparison(other.label, own.label, say, same)
        return cls(own.label, EventDetector(say, bookmarks=notes), pairing, [])

    def see(self, first: Update | None, update: Update) -> None:
        self.events += self.detector.see(*update)
        if self.pairing is not None and first is not None:
            parted = self.pairing.see(first, update).event
            self.events += [parted] if parted else []


def _updates(run: SavedRun) -> Iterator[Update]:
    """Go through one run as far as it got, without its pictures."""
    for moment, records in restored_together([Restored(run, None)], Pictures(None, _silent)):
        yield moment, records[run.manifest.label]


@dataclass(frozen=True, slots=True)
class Notes:
    """The bookmarks of the runs in a folder, as `EventDetector` takes them."""

    by_label: Mapping[str, Mapping[int, Sequence[str]]]  # a run's label to notes by step
    problems: tuple[str, ...]  # lines that cannot be read, a line a file


def find_notes(folder: Path, runs: Sequence[SavedRun]) -> Notes:
    """Read each run's own bookmarks, and those of the comparison that they are in, which are for all."""
    own = {run.manifest.label: read_bookmarks(run.folder) for run in runs}
    alone = [run.folder for run in runs] == [folder]
    shared = Bookmarks(()) if alone else read_bookmarks(folder)
    notes = {label: _by_step([*shared.kept, *some.kept]) for label, some in own.items()}
    return Notes(notes, tuple(one.problem for one in (shared, *own.values()) if one.problem))


def _by_step(bookmarks: Sequence[Bookmark]) -> dict[int, list[str]]:
    notes: dict[int, list[str]] = {}
    for one in bookmarks:
        notes.setdefault(one.step, []).append(one.note)
    return notes


def wanted(run: RunEvents, kinds: Sequence[str], *, routine: bool = False) -> tuple[RunEvent, ...]:
    """Give the events of some kinds; without kinds all but the routine ones."""
    if kinds:
        return tuple(event for event in run.events if event.kind in kinds)
    return tuple(event for event in run.events if routine or not event.is_routine)


def check_step(runs: Sequence[SavedRun], folder: Path, step: int) -> None:
    """Refuse a step that no run has. InputError."""
    last = max(run.manifest.steps or run.manifest.pictures for run in runs)
    if not 1 <= step <= last:
        raise InputError(folder, f"found step {step}, expected one from 1 to {last}")


def to_json(events: Mapping[str, Sequence[RunEvent]]) -> dict[str, object]:
    """Give `{"runs": [{"label": ..., "events": [...]}]}`."""
    return {
        "runs": [
            {
                "label": label,
                "events": [
                    {"step": one.step, "time_s": one.time_s, "kind": one.kind, "text": one.text}
                    for one in some
                ],
            }
            for label, some in events.items()
        ]
    }


def to_table(events: Mapping[str, Sequence[RunEvent]], title: str) -> Table:
    """Give a table with a row an event, by step; a column for the run where there are several."""
    table = Table(title=Text(title, no_wrap=True, overflow="ignore"), title_justify="left")
    several = len(events) > 1
    for name in ("step", "time (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("run", "event") if several else ("event",):
        table.add_column(name, no_wrap=True)
    table.add_column("what")
    for event, labels in _by_event(events):
        who = ALL_RUNS if len(labels) == len(events) else ", ".join(labels)
        row = [str(event.step), f"{event.time_s:.1f}", *([who] if several else []), event.kind, event.text]
        table.add_row(*map(Text, row))
    return table


def _by_event(events: Mapping[str, Sequence[RunEvent]]) -> list[tuple[RunEvent, list[str]]]:
    """Put what is the same in several runs together, in the order of steps and kinds."""
    labels: dict[RunEvent, list[str]] = {}
    for label, some in events.items():
        for event in dict.fromkeys(some):
            labels.setdefault(event, []).append(label)
    order = list(KINDS)
    return sorted(labels.items(), key=lambda item: (item[0].step, order.index(item[0].kind)))


def _silent(text: str) -> None:
    """Pictures are not asked for, so that nothing is said about them."""
