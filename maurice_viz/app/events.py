"""Events of saved runs, found again without pictures, library or filtering."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TypeAlias

from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.reasons.causes import Failure
from maurice_mcl.scoring.comparison import RunComparison
from maurice_mcl.scoring.events import KINDS, EventDetector, RunEvent
from maurice_mcl.values import Moment, StepRecord

from ..errors import OptionError
from ..running.saved_steps import Pictures, Restored, restored_together
from ..style import Scale, units_named
from ..text.causes import with_failures

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
        return {"runs": [{"label": label, "events": found} for label, found in runs]}


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
            raise OptionError(f"no kind called {kind!r}; there are {', '.join(KINDS)}")

    def is_wanted(event: RunEvent) -> bool:
        return event.kind in kinds if kinds else routine or not event.is_routine

    runs = open_runs(Path(run))
    watched = [_Watched.of(saved, runs[0]) for saved in runs]
    for updates in zip_longest(*(_updates(saved) for saved in runs)):
        for each, update in zip(watched, updates, strict=True):
            if update is not None:
                each.see(updates[0], update)
    by_run = (RunEvents(each.label, tuple(filter(is_wanted, each.result()))) for each in watched)
    return FoundEvents(tuple(by_run), runs[0].manifest.name)


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
    def of(cls, run: SavedRun, first: SavedRun) -> _Watched:
        own, other = run.manifest, first.manifest
        scale = Scale(units_named(own.display_units))
        say = scale.say
        same = own.session.sha256 == other.session.sha256
        pairing = None if run is first else RunComparison(other.label, own.label, say, same)
        return cls(own.label, EventDetector(say), pairing, [], own.failures or (), scale)

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
