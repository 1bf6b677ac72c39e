"""Which events of a run are listed, and which get a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.analysis.events import KINDS, RunEvent

from ..app.tracks import Collected

MOST_PICTURES = 12
OFTEN = 20  # a kind that happens more often in a run is counted, not listed
BY_WEIGHT = (
    "kidnapped",
    "lost",
    "recovered",
    "parted",
    "bookmark",
    "mode-switch",
    "localized",
    "lights-changed",
    "all-weights-zero",
    "beyond-three-sigma",
    "session",
    "expanded",
    "reseeded",
    "ess-dip",
)
WORST, LAST = "worst", "last"
RULE = (
    f"At most {MOST_PICTURES} steps have a picture: the step with the largest position error (without truth: "
    "with the widest cloud), the last step, and then in rounds the next event of each of these kinds: "
    f"{', '.join(BY_WEIGHT)}."
)


@dataclass(frozen=True, slots=True)
class Happening:
    """An event, and the runs in which it happened."""

    event: RunEvent
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Scene:
    """One step with a picture: its number on this page, and why it has one."""

    number: int
    step: int
    reasons: tuple[str, ...]


def happenings(collected: Collected) -> list[Happening]:
    """Give the events of all runs in order of steps; what happened alike in several runs is said once."""
    found: dict[tuple[int, str, str], list[str]] = {}
    events: dict[tuple[int, str, str], RunEvent] = {}
    for track in collected.tracks:
        for event in track.events:
            key = (event.step, event.kind, event.text)
            found.setdefault(key, []).append(track.label)
            events[key] = event
    order = list(KINDS)
    keys = sorted(found, key=lambda key: (key[0], order.index(key[1]) if key[1] in order else len(order)))
    return [Happening(events[key], tuple(found[key])) for key in keys]


def listed(happened: Sequence[Happening]) -> list[Happening]:
    """Leave out what is routine, and the kinds that happen too often to be read."""
    counts = counted([one for one in happened if not one.event.is_routine])
    few = {kind for kind, steps in counts.items() if len(steps) <= OFTEN}
    return [one for one in happened if one.event.kind in few and not one.event.is_routine]


def counted(happened: Sequence[Happening]) -> dict[str, list[int]]:
    """Give the steps at which each kind happened, in the order of KINDS."""
    steps: dict[str, list[int]] = {kind: [] for kind in KINDS}
    for one in happened:
        steps.setdefault(one.event.kind, []).append(one.event.step)
    return {kind: found for kind, found in steps.items() if found}


def choose(collected: Collected, happened: Sequence[Happening], most: int = MOST_PICTURES) -> list[Scene]:
    """Choose the steps that get a picture, by `RULE`, in order of steps."""
    picked: dict[int, list[str]] = {}
    worst = worst_step(collected)
    picked.setdefault(worst, [])
    picked.setdefault(int(collected.tracks[0].rows[-1][0]), [])
    for step in _in_rounds(happened):
        if len(picked) >= most:
            break
        picked.setdefault(step, [])
    for one in happened:
        if one.event.step in picked and not one.event.is_routine:
            picked[one.event.step].append(reason(one, len(collected.tracks)))
    known = np.isfinite(np.concatenate([t.column("position_error_m") for t in collected.tracks])).any()
    picked[worst].append("largest position error" if known else "widest cloud")
    picked[int(collected.tracks[0].rows[-1][0])].append("the last step")
    return [Scene(number, step, tuple(picked[step])) for number, step in enumerate(sorted(picked), start=1)]


def reason(one: Happening, runs: int) -> str:
    """Say an event in a line, with its runs where there are several and it is not of all."""
    who = "" if len(one.labels) == runs else f" ({', '.join(one.labels)})"
    return f"{one.event.kind}{who}: {one.event.text}"


def _in_rounds(happened: Sequence[Happening]) -> list[int]:
    """Give steps: the first event of every kind, then the second of every kind, and so on."""
    known = [one.event for one in happened if not one.event.is_routine]
    by_kind = {kind: [event.step for event in known if event.kind == kind] for kind in BY_WEIGHT}
    longest = max((len(steps) for steps in by_kind.values()), default=0)
    return [steps[k] for k in range(longest) for steps in by_kind.values() if k < len(steps)]


def worst_step(collected: Collected) -> int:
    """Give the step with the largest position error of any run; without truth that of the widest cloud."""
    for name in ("position_error_m", "spread_m"):
        values = np.stack([track.column(name) for track in collected.tracks])
        if np.isfinite(values).any():
            return int(collected.tracks[0].column("step")[np.nanmax(values, axis=0, initial=-1.0).argmax()])
    return int(collected.tracks[0].rows[0][0])


def said_steps(steps: Sequence[int]) -> str:
    """Write steps shortly: "3-7, 9"."""
    numbers = sorted(set(steps))
    parts: list[list[int]] = []
    for step in numbers:
        if parts and parts[-1][-1] == step - 1:
            parts[-1].append(step)
        else:
            parts.append([step])
    return ", ".join(
        f"{part[0]}-{part[-1]}" if len(part) > 2 else ", ".join(map(str, part)) for part in parts
    )
