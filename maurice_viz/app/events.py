"""Events of saved runs, found again without pictures, library or filtering; bookmarks; jumping to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from shlex import quote
from typing import TypeAlias

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import (
    Bookmark,
    Bookmarks,
    SavedRun,
    add_bookmark,
    bookmarks_file,
    open_runs,
    read_bookmarks,
    remove_bookmarks,
)
from maurice_mcl.analysis.events import BOOKMARK, FAILURE, KINDS, SESSION, EventDetector, RunEvent
from maurice_mcl.analysis.failures.kinds import Failure
from maurice_mcl.analysis.run_comparison import RunComparison
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..entities import PHASE, STEP, Phase, phase_number
from ..errors import OptionError
from ..listener import SILENT, Listener
from ..style import Scale, units_named
from ..text.failure import with_failures
from .saved_steps import Pictures, Restored, restored_together

UNKNOWN = "was saved without its failures, by an earlier version; maurice-replay diagnose {} finds them"
Update: TypeAlias = tuple[Moment, StepRecord]


@dataclass(frozen=True, slots=True)
class RunEvents:
    """One run, and all that happened in it, in order."""

    label: str
    events: tuple[RunEvent, ...]


@dataclass(frozen=True, slots=True)
class FoundEvents:
    """The events of a saved run, or of each run of a comparison."""

    runs: tuple[RunEvents, ...]
    session: str  # its name, which is also that of its recordings
    problems: tuple[str, ...]  # what cannot be read of bookmarks, or was not saved; a line per file or run

    def to_json(self) -> dict[str, object]:
        """Return `{"runs": [{"label": ..., "events": [...]}]}`."""
        runs = [(run.label, [asdict(one) for one in run.events]) for run in self.runs]
        return {"runs": [{"label": label, "events": found} for label, found in runs]}


def events(
    run: str | Path, *, kinds: Sequence[str] = (), routine: bool = False, listener: Listener = SILENT
) -> FoundEvents:
    """Return the events of a saved run or a comparison, with the bookmarks kept beside it.

    Only events of these `kinds`; without any, all but the routine ones (resampling, a new floor), or all with
    `routine`. Needs neither the session nor the library. Raises OptionError for an unknown kind and
    InputError for a folder that is no saved run or is damaged.

        >>> import maurice_viz as mv
        >>> found = mv.events("my-run", kinds=["lost"])
        >>> [event.step for event in found.runs[0].events]
        []
    """
    for kind in kinds:
        if kind not in KINDS:
            raise OptionError(f"no kind called {kind!r}; there are {', '.join(KINDS)}")
    found = find_events(Path(run))
    for problem in found.problems:
        listener.warning(problem)
    return replace(
        found,
        runs=tuple(
            RunEvents(
                one.label,
                tuple(e for e in one.events if (e.kind in kinds if kinds else routine or not e.is_routine)),
            )
            for one in found.runs
        ),
    )


def find_events(folder: Path) -> FoundEvents:
    """Find every event of a saved run or a comparison, routine ones included. Raises InputError."""
    runs = open_runs(folder)
    notes, problems = find_notes(folder, runs)
    watched = [_Watched.of(run, runs[0], notes[run.manifest.label]) for run in runs]
    for updates in zip_longest(*(_updates(run) for run in runs)):
        for one, update in zip(watched, updates, strict=True):
            if update is not None:
                one.see(updates[0], update)
    old = [run.folder for run in runs if run.manifest.failures is None and run.manifest.steps]
    unknown = tuple(f"{one}: {UNKNOWN.format(quote(str(one)))}" for one in old)
    done = tuple(RunEvents(one.label, one.result()) for one in watched)
    return FoundEvents(done, runs[0].manifest.name, (*problems, *unknown))


@dataclass(slots=True)
class _Watched:
    """One run while its events are found; the first run of a comparison has no pairing."""

    label: str
    detector: EventDetector
    pairing: RunComparison | None
    events: list[RunEvent]
    failures: Sequence[Failure]  # as they were found when the run ended
    scale: Scale
    times_s: dict[int, float] = field(default_factory=dict)  # of each step

    @classmethod
    def of(cls, run: SavedRun, first: SavedRun, notes: Mapping[int, Sequence[str]]) -> _Watched:
        own, other = run.manifest, first.manifest
        scale = Scale(units_named(own.display_units))
        say = scale.say
        same = own.session.sha256 == other.session.sha256
        pairing = None if run is first else RunComparison(other.label, own.label, say, same)
        return cls(own.label, EventDetector(say, bookmarks=notes), pairing, [], own.failures or (), scale)

    def see(self, first: Update | None, update: Update) -> None:
        self.events += self.detector.see(*update)
        if self.pairing is not None and first is not None:
            parted = self.pairing.see(first, update).event
            self.events += [parted] if parted else []
        moment, _ = update
        self.times_s[moment.frame.step] = moment.frame.time_s

    def result(self) -> tuple[RunEvent, ...]:
        """Return the events of all its updates, and its failures among them."""
        return tuple(with_failures(self.events, self.failures, self.times_s, self.scale))


def _updates(run: SavedRun) -> Iterator[Update]:
    """Go through one run as far as it got, without its pictures."""
    for moment, records in restored_together([Restored(run, None)], Pictures()):
        yield moment, records[run.manifest.label]


def find_notes(
    folder: Path, runs: Sequence[SavedRun]
) -> tuple[Mapping[str, Mapping[int, Sequence[str]]], tuple[str, ...]]:
    """Return the notes of each run by its label and by step, and what cannot be read, a line a file.

    The bookmarks of a comparison are for all its runs.
    """
    own = {run.manifest.label: read_bookmarks(run.folder) for run in runs}
    alone = [run.folder for run in runs] == [folder]
    shared = Bookmarks(()) if alone else read_bookmarks(folder)
    notes: dict[str, dict[int, list[str]]] = {}
    for label, some in own.items():
        notes[label] = {}
        for one in (*shared.kept, *some.kept):
            notes[label].setdefault(one.step, []).append(one.note)
    return notes, tuple(one.problem for one in (shared, *own.values()) if one.problem)


def keep_bookmark(run: str | Path, step: int, note: str) -> Path:
    """Keep a bookmark beside a saved run and return the file that holds it.

    Raises OptionError for an empty note, and InputError for a step that no run has.

        >>> import maurice_viz as mv
        >>> mv.keep_bookmark("my-run", 4, "odd turn").name
        'bookmarks.jsonl'
    """
    folder, line = Path(run), " ".join(note.split())
    if not line:
        raise OptionError('a bookmark has a text: --add 40 "odd turn"')
    _check_step(open_runs(folder), folder, step)
    add_bookmark(folder, Bookmark(step, line))
    return bookmarks_file(folder)


def drop_bookmarks(run: str | Path, which: str) -> int:
    """Remove the bookmarks of a step, or those with exactly this note, and return how many there were.

    Raises InputError if there is none.

        >>> import maurice_viz as mv
        >>> file = mv.keep_bookmark("my-run", 4, "odd turn")
        >>> mv.drop_bookmarks("my-run", "odd turn")
        1
    """
    folder = Path(run)
    open_runs(folder)  # raises where this is no saved run
    kept = read_bookmarks(folder).kept
    unwanted = [one for one in kept if which in (str(one.step), one.note)]
    if not unwanted:
        there = ", ".join(str(one.step) for one in kept) or "none"
        raise InputError(bookmarks_file(folder), f"found no bookmark {which!r}; there are at steps: {there}")
    return remove_bookmarks(folder, unwanted)


# Jumping: moving an open viewer to an event.

PHASES = tuple(phase.name.lower() for phase in Phase)


@dataclass(frozen=True, slots=True)
class Destination:
    """A step of a saved run, and why one jumps to it."""

    step: int
    text: str


def jump(
    run: str | Path,
    to: str | None = None,
    *,
    nth: int = 1,
    step: int | None = None,
    phase: str | None = None,
    run_label: str | None = None,
    port: int | None = None,
    listener: Listener = SILENT,
) -> Destination:
    """Move the open viewer to an event or a step of a saved run, and return where it is now.

    `to` is the kind of an event, the cause of a failure, the text of a bookmark, or the first word of an
    event in the session log; the `nth` of them, counted from 1, in any run or the one of `run_label`. `phase`
    is one of PHASES. The viewer is the one opened last that shows this session, or the one that listens on
    `port`.

    Raises OptionError for contradicting arguments and InputError if event, step or viewer is missing.

        >>> import maurice_viz as mv
        >>> mv.jump("my-run", step=4)  # doctest: +SKIP
        Destination(step=4, text='small')
    """
    from ..viewer.open_viewers import move_viewer  # loads Rerun, which the other functions here do without

    folder = Path(run)
    if (to is None) == (step is None):
        raise OptionError("say where to: --to KIND, or --step N")
    if phase is not None and phase not in PHASES:
        raise OptionError(f"no phase called {phase!r}; there are {', '.join(PHASES)}")
    runs = open_runs(folder)
    name = runs[0].manifest.name
    if to is not None:
        place = find_event(folder, to, nth=nth, run_label=run_label, listener=listener)
    else:
        _check_step(runs, folder, step or 0)
        place = Destination(step or 0, name)
    timeline, value = STEP, place.step
    if phase is not None:
        timeline, value = PHASE, phase_number(place.step, Phase[phase.upper()])
    move_viewer(folder, name, port, timeline, value)
    return place


def find_event(
    folder: Path, to: str, *, nth: int = 1, run_label: str | None = None, listener: Listener = SILENT
) -> Destination:
    """Find the nth event that `to` names, as `jump` does. Raises InputError that lists what there is."""
    found = find_events(folder)
    for problem in found.problems:
        listener.warning(problem)
    labels = [run.label for run in found.runs]
    if run_label is not None and run_label not in labels:
        raise InputError(folder, f"found no run {run_label!r}, expected one of {', '.join(labels)}")
    own = {event: None for run in found.runs if run_label in (None, run.label) for event in run.events}
    matching = sorted((one for one in own if is_named(one, to)), key=lambda one: one.step)
    if len(matching) >= nth:
        return Destination(matching[nth - 1].step, f"{matching[nth - 1].kind}: {matching[nth - 1].text}")
    if matching:
        raise InputError(folder, f"found {to!r} {len(matching)} times, so there is no --nth {nth}")
    there = ", ".join(names_in(list(own))) or "nothing"
    raise InputError(folder, f"found no event or bookmark {to!r}; what happened in it: {there}")


def is_named(event: RunEvent, name: str) -> bool:
    """Return whether its kind, cause, bookmark's text or the first word of the log's text is this name."""
    if event.kind == BOOKMARK and event.text == name:
        return True
    if event.kind == FAILURE and event.text.split(":")[0] == name:
        return True
    return event.kind == name or (event.kind == SESSION and event.text.split()[:1] == [name])


def names_in(found: Sequence[RunEvent]) -> list[str]:
    """Return every name by which one of these events can be found, in the order of kinds."""
    kinds = [kind for kind in KINDS if any(one.kind == kind for one in found)]
    causes = [one.text.split(":")[0] for one in found if one.kind == FAILURE]
    words = [one.text.split()[0] for one in found if one.kind == SESSION and one.text.split()]
    return list(dict.fromkeys([*kinds, *causes, *words]))


def _check_step(runs: Sequence[SavedRun], folder: Path, step: int) -> None:
    last = max(run.manifest.steps or run.manifest.pictures for run in runs)
    if not 1 <= step <= last:
        raise InputError(folder, f"found step {step}, expected one from 1 to {last}")
