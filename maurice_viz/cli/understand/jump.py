"""`maurice-replay jump RUN --to lost`: move the viewer that is open to where something happened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from maurice_mcl.analysis.events import BOOKMARK, KINDS, SESSION, RunEvent

from ...entities import PHASE, STEP, Phase, phase_number
from ..console import note, results
from ..errors import one_line_errors
from .events import FolderArgument

PHASES = [slot.name.lower() for slot in Phase]


def _check_phase(value: str | None) -> str | None:
    if value is not None and value not in PHASES:
        raise typer.BadParameter(f"no phase called {value!r}; there are {', '.join(PHASES)}")
    return value


ToOption = Annotated[
    str | None,
    typer.Option("--to", metavar="KIND|NOTE", help="An event by its kind, or a bookmark by its text."),
]
NthOption = Annotated[int, typer.Option("--nth", min=1, help="The second, third ... of them.")]
StepOption = Annotated[int | None, typer.Option("--step", help="A step by its number.")]
PhaseOption = Annotated[
    str | None,
    typer.Option("--phase", help=f"Inside the step: {' | '.join(PHASES)}.", callback=_check_phase),
]
LabelOption = Annotated[
    str | None, typer.Option("--run-label", help="Of a comparison, only events of this run.")
]
PortOption = Annotated[
    int | None,
    typer.Option(
        "--port", min=1, max=65535, help="Of a viewer that you opened yourself. [default: the one we opened]"
    ),
]


@dataclass(frozen=True, slots=True)
class _Place:
    """Where to go, and why."""

    step: int
    text: str


def jump(
    run: FolderArgument,
    to: ToOption = None,
    nth: NthOption = 1,
    step: StepOption = None,
    phase: PhaseOption = None,
    run_label: LabelOption = None,
    port: PortOption = None,
) -> None:
    """Move the open viewer to an event, a bookmark or a step of a saved run."""
    if (to is None) == (step is None):
        raise typer.BadParameter("say where to: --to KIND, or --step N")
    with one_line_errors():
        place = _place(run, to, nth, run_label) if to is not None else _typed(run, step or 0)
        timeline, value = STEP, place.step
        if phase is not None:
            timeline, value = PHASE, phase_number(place.step, Phase[phase.upper()])
        _move(run, port, timeline, value)
    results.print(f"step {place.step}{f', {phase}' if phase else ''}: {place.text}")


def _typed(folder: Path, step: int) -> _Place:
    from maurice_loaders.runs.store import open_runs

    from ...app.run_events import check_step

    runs = open_runs(folder)
    check_step(runs, folder, step)
    return _Place(step, runs[0].manifest.name)


def _place(folder: Path, to: str, nth: int, label: str | None) -> _Place:
    """Find the event. InputError that says what there is where it is not there."""
    from maurice_loaders.errors import InputError

    from ...app.run_events import find_events

    found = find_events(folder)
    for problem in found.problems:
        note(problem)
    labels = [run.label for run in found.runs]
    if label is not None and label not in labels:
        raise InputError(folder, f"found no run {label!r}, expected one of {', '.join(labels)}")
    events = {event: None for run in found.runs if label in (None, run.label) for event in run.events}
    matching = sorted(
        (one for one in events if _is(one, to)),
        key=lambda one: one.step,
    )
    if len(matching) >= nth:
        return _Place(matching[nth - 1].step, f"{matching[nth - 1].kind}: {matching[nth - 1].text}")
    if matching:
        raise InputError(folder, f"found {to!r} {len(matching)} times, so there is no --nth {nth}")
    there = ", ".join(_there(list(events))) or "nothing"
    raise InputError(folder, f"found no event or bookmark {to!r}; what happened in it: {there}")


def _move(folder: Path, port: int | None, timeline: str, value: int) -> None:
    from maurice_loaders.runs.store import open_runs

    from ...viewer.cursor import move_viewer

    move_viewer(folder, open_runs(folder)[0].manifest.name, port, timeline, value)


def _is(event: RunEvent, to: str) -> bool:
    """Tell whether a kind, a bookmark's text or the first word of what the log says names this event."""
    if event.kind == BOOKMARK and event.text == to:
        return True
    return event.kind == to or (event.kind == SESSION and event.text.split()[:1] == [to])


def _there(events: Sequence[RunEvent]) -> list[str]:
    """Name what one could jump to."""
    kinds = [kind for kind in KINDS if any(one.kind == kind for one in events)]
    told = [one.text.split()[0] for one in events if one.kind == SESSION and one.text.split()]
    return [*kinds, *dict.fromkeys(told)]
