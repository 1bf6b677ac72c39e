"""Which events of a run are listed, and which steps get a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.scoring.events import KINDS, RunEvent

from ..running.saved_steps import Collected

MAX_PICTURES = 12
MOST_LISTED = 20  # a kind with more events in a run is counted, not listed
RULE = (
    f"At most {MAX_PICTURES} steps have a picture: the step with the largest position error (without truth: "
    "with the widest cloud), the last step, and then in rounds the next event of each of these kinds: "
    f"{', '.join(name for name, kind in KINDS.items() if not kind.is_routine)}."
)


@dataclass(frozen=True, slots=True)
class ReportedEvent:
    """An event, and the runs in which it happened."""

    event: RunEvent
    labels: tuple[str, ...]

    def reason(self, runs: int) -> str:
        """Return the event in a line, with its runs if it is not one of all `runs`."""
        who = "" if len(self.labels) == runs else f" ({', '.join(self.labels)})"
        return f"{self.event.kind}{who}: {self.event.text}"


@dataclass(frozen=True, slots=True)
class PicturedStep:
    """A step with a picture: its number on the page, and why it has one."""

    number: int
    step: int
    reasons: tuple[str, ...]


def events_of(collected: Collected) -> list[ReportedEvent]:
    """Return the events of all runs in order of steps; the same event of several runs is one."""
    same: dict[tuple[int, str, str], list[tuple[RunEvent, str]]] = {}
    for track in collected.tracks:
        for event in track.events:
            same.setdefault((event.step, event.kind, event.text), []).append((event, track.label))
    order = list(KINDS)
    keys = sorted(same, key=lambda key: (key[0], order.index(key[1])))
    return [ReportedEvent(same[key][-1][0], tuple(label for _, label in same[key])) for key in keys]


def listed(events: Sequence[ReportedEvent]) -> list[ReportedEvent]:
    """Leave out what is routine, and the kinds with more than `MOST_LISTED` events."""
    notable = [item for item in events if not item.event.is_routine]
    counts = steps_by_kind(notable)
    return [item for item in notable if len(counts[item.event.kind]) <= MOST_LISTED]


def steps_by_kind(events: Sequence[ReportedEvent]) -> dict[str, list[int]]:
    """Return the steps at which each kind happened, in the order of KINDS."""
    steps: dict[str, list[int]] = {kind: [] for kind in KINDS}
    for item in events:
        steps[item.event.kind].append(item.event.step)
    return {kind: of_kind for kind, of_kind in steps.items() if of_kind}


def choose(collected: Collected, events: Sequence[ReportedEvent]) -> list[PicturedStep]:
    """Choose the steps that get a picture, by `RULE`, in order of steps."""
    notable = [item for item in events if not item.event.is_routine]
    worst, last = worst_step(collected), int(collected.tracks[0].rows[-1][0])
    picked: dict[int, list[str]] = {worst: [], last: []}
    for step in _in_rounds(notable):
        if len(picked) >= MAX_PICTURES:
            break
        picked.setdefault(step, [])
    for item in notable:
        if item.event.step in picked:
            picked[item.event.step].append(item.reason(len(collected.tracks)))
    has_truth = np.isfinite(np.concatenate([t.column("position_error_m") for t in collected.tracks])).any()
    picked[worst].append("largest position error" if has_truth else "widest cloud")
    picked[last].append("last step")
    return [PicturedStep(k, step, tuple(picked[step])) for k, step in enumerate(sorted(picked), start=1)]


def _in_rounds(notable: Sequence[ReportedEvent]) -> list[int]:
    """Return steps: the first event of every kind, then the second of every kind, and so on."""
    by_kind = list(steps_by_kind(notable).values())
    longest = max(map(len, by_kind), default=0)
    return [steps[k] for k in range(longest) for steps in by_kind if k < len(steps)]


def worst_step(collected: Collected) -> int:
    """Return the step with the largest position error of any run; without truth that of the widest cloud."""
    for name in ("position_error_m", "spread_m"):
        values = np.stack([track.column(name) for track in collected.tracks])
        if np.isfinite(values).any():
            return int(collected.tracks[0].column("step")[np.nanmax(values, axis=0, initial=-1.0).argmax()])
    return int(collected.tracks[0].rows[0][0])


def step_ranges(steps: Sequence[int]) -> str:
    """Return steps as short text: "3-7, 9"."""
    numbers = np.unique(np.array(steps, int))
    parts = [part.tolist() for part in np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)]
    return ", ".join(
        f"{part[0]}-{part[-1]}" if len(part) > 2 else ", ".join(map(str, part)) for part in parts
    )
