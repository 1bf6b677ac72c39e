"""What a recording holds, what is wrong with it and what fixes it; what happened in a saved run; formats."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from maurice_loaders.doctor.examination import Examination, examine
from maurice_loaders.doctor.findings import Evidence, Finding
from maurice_loaders.doctor.inspection import Inspection, inspect_file
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent
from maurice_loaders.formats.registry import chosen
from maurice_loaders.formats.registry import formats as all_formats
from maurice_loaders.formats.registry import open_session as open_any
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import Reading, write_reading
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.scoring.comparison import parting
from maurice_mcl.scoring.episodes import RunSoFar
from maurice_mcl.scoring.events import KINDS, EventDetector, RunEvent
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.values import Library, Moment, StepRecord, expected_one_of, plain

from ..errors import SILENT, Listener, OptionError, progress_of
from ..running.open import library_at, library_of
from ..running.saved_steps import Pictures, Restored, restored_together
from ..style import Scale, units_named
from ..text.causes import with_failures
from ..text.findings import brief
from .library_check import say_default


@dataclass(frozen=True, slots=True)
class FormatInfo:
    """A format of recordings."""

    name: str
    what: str  # in a few words
    extra: str | None  # of this package, that reading it needs
    installed: bool  # whether it can be read here


def formats(path: str | Path | None = None) -> list[FormatInfo]:
    """Return the formats that can be read, or the one that a file or folder is detected as.

    Raises InputError if there is no such file, or it has no known format.

        >>> import maurice_viz as mv
        >>> [found] = mv.formats("session.log")
        >>> found.name
        'session-log'
    """
    forms = list(all_formats().values()) if path is None else [chosen(Path(path), Reading())]
    return [FormatInfo(form.name, form.what, form.extra, form.installed) for form in forms]


@dataclass(frozen=True, slots=True)
class InspectedRecording:
    """What is in a recording."""

    format: str  # its name
    contents: Inspection

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        contents = plain(self.contents)
        del contents["implausible"]  # told among the warnings
        return {"format": self.format} | contents


def inspect(session: str | Path, *, reading: Reading | None = None) -> InspectedRecording:
    """Return a recording's format and what it holds: counts, rates, distances, problems.

    Distances are in meters, rates in Hz; broken records are counted, not raised. Raises InputError if the
    recording cannot be read at all.

        >>> import maurice_viz as mv
        >>> inspected = mv.inspect("session.log")
        >>> inspected.contents.records["image"]
        14
    """
    path, options = Path(session), replace(reading or Reading(), keep_going=True)
    form, contents = chosen(path, options), inspect_file(path, options)
    doubts = [brief(finding) for finding in contents.implausible]
    warnings, has_map = (*doubts, *_about_places(path, contents), *contents.warnings), contents.has_map
    if contents.scans and not has_map:
        try:
            has_map = library_of(open_any(path, options), None) == path
        except InputError as problem:
            warnings = (problem.message, *warnings)
    return InspectedRecording(form.name, replace(contents, warnings=warnings, has_map=has_map))


def _about_places(path: Path, inspection: Inspection) -> list[str]:
    """Return what there is to say of the recording's library: whether its places can be told apart."""
    named = inspection.survey if inspection.survey_found else None
    library = path if inspection.kind == "survey" else None if named is None else Path(named)
    if library is None:
        return []
    try:
        return list(say_default(open_library(library, list(FEATURES["blended"]), keep_going=True)))
    except (InputError, ValueError):  # another command says what is wrong with it
        return []


def doctor(
    session: str | Path,
    library: str | Path | None = None,
    *,
    pictures: bool = True,
    reading: Reading | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> Examination:
    """Find wrong signs, units, frames, clocks and cameras in a recording, and the options that fix them.

    Pictures are compared with the `library`, or the one that the recording names if there is one, unless
    `pictures` is False. `Examination.fixed` are the options that fix everything; `to` writes them to a
    reading file (.toml), if there is anything to fix. Raises InputError if the recording or the library
    cannot be read, or the file exists (unless `force`).

        >>> import maurice_viz as mv
        >>> examination = mv.doctor("session.log")
        >>> len(examination.findings)
        0
    """
    path, options = Path(session), reading or Reading()
    if to is not None:
        expect_absent(Path(to), force=force)
    references, unusable = _library(path, library, options, listener) if pictures else (None, [])
    examination = examine(path, options, references, progress_of(listener, "pictures"))
    examination = replace(examination, findings=(*unusable, *examination.findings))
    if to is not None and examination.fixed != options:
        write_reading(to, examination.fixed, force=force)
    return examination


def _library(
    session: Path, library: str | Path | None, options: Reading, listener: Listener
) -> tuple[Library | None, list[Finding]]:
    """Open the library that was asked for; else the header's or the bag's map, if it is there and of use."""
    opened = None if library else open_any(session, options)
    try:
        path = Path(library) if library else None if opened is None else library_of(opened, None)
    except InputError as problem:  # its own map is of no use, but all else can be looked at
        seen = Evidence("map-problem", {"problem": problem.message})
        return None, [Finding("map-unusable", (seen,))]
    if not isinstance(path, Path) or (library is None and not path.exists()):
        return None, []
    if not path.exists():
        raise InputError(path, "found no such library or survey; name it with --library")
    return library_at(path, listener), []


# Events of saved runs, found again without pictures, library or filtering.

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

    def to_json(self) -> dict[str, object]:
        """Return `{"runs": [{"label": ..., "events": [...]}]}`."""
        runs = [(run.label, [_event_json(event) for event in run.events]) for run in self.runs]
        return {"runs": [{"label": label, "events": events_of_run} for label, events_of_run in runs]}


def _event_json(event: RunEvent) -> dict[str, object]:
    last = event.step if event.last is None else event.last
    return {"step": event.step, "last": last, "time_s": event.time_s, "kind": event.kind, "text": event.text}


def events(run: str | Path, *, kinds: Sequence[str] = (), routine: bool = False) -> FoundEvents:
    """Return the events of a saved run or a comparison.

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
            raise OptionError(f"no kind called {kind!r}; {expected_one_of(kind, KINDS)}")

    def is_wanted(event: RunEvent) -> bool:
        return event.kind in kinds if kinds else routine or not event.is_routine

    runs = open_runs(Path(run))
    watched = [_Watched.of(saved) for saved in runs]
    by_run = [RunEvents(each.label, tuple(filter(is_wanted, each.beside(watched[0])))) for each in watched]
    return FoundEvents(tuple(by_run), runs[0].manifest.name)


@dataclass(frozen=True, slots=True)
class _Watched:
    """One run and its own events."""

    run: SavedRun
    table: RunTable
    events: Sequence[RunEvent]

    @classmethod
    def of(cls, run: SavedRun) -> _Watched:
        detector, so_far, events = EventDetector(_scale(run).say), RunSoFar(), list[RunEvent]()
        for moment, record in _updates(run):
            so_far.add(moment, record)
            events += detector.see(moment, record, so_far)
        return cls(run, so_far.rows.table(), events)

    @property
    def label(self) -> str:
        return self.run.manifest.label

    def beside(self, first: _Watched) -> list[RunEvent]:
        """Return the events of all its updates, with its failures, and where it parts from the first run."""
        own, other, table, scale = self.run.manifest, first.run.manifest, self.table, _scale(self.run)
        same = self is not first and own.session.sha256 == other.session.sha256
        labels = (other.label, own.label)
        parted = parting(first.table, table, labels, scale.say) if same else None
        times_s = dict(zip(table.steps.tolist(), table.times_s.tolist(), strict=True))
        events = [*self.events, *([] if parted is None else [parted])]
        return with_failures(events, own.failures or (), times_s, scale)


def _scale(run: SavedRun) -> Scale:
    return Scale(units_named(run.manifest.display_units))


def _updates(run: SavedRun) -> Iterator[Update]:
    """Go through one run as far as it got, without its pictures."""
    for moment, records in restored_together([Restored(run, None)], Pictures()):
        yield moment, records[run.manifest.label]
