"""`maurice-replay verify DIR`: run a saved run again, and say whether it is the same to the last bit."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from maurice_loaders.errors import LogError
from maurice_loaders.runs.manifest import versions_now
from maurice_loaders.runs.rows import StepRows, rows_of
from maurice_loaders.runs.store import Difference, SavedRun, first_difference, open_runs
from maurice_mcl.filter.localizer import run as run_filter

from ...app.saved import library_of, localizer_of, session_of
from ..console import progress, results
from ..errors import one_line_errors
from ..options import JsonOption

FolderArgument = Annotated[
    Path, typer.Argument(help="A folder that --run wrote.", show_default=False, metavar="DIR")
]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What running one run again came to."""

    label: str
    steps: int  # that are the same
    pictures: int  # of the session: a run that was stopped has fewer steps
    difference: Difference | None
    changed: tuple[str, ...]  # versions that are others now

    def say(self) -> str:
        """Put it into a line."""
        versions = f" ({'; '.join(self.changed)})" if self.changed else ""
        if self.difference is None:
            short = f"; it ended before the last of {self.pictures}" if self.steps < self.pictures else ""
            return f"{self.label}: the same, all {self.steps} steps to the last bit{short}{versions}"
        return f"{self.label}: differs first at {self.difference}{versions or ' (with the same versions)'}"

    def to_json(self) -> dict[str, Any]:
        """Give it for programs."""
        first = self.difference
        place = None if first is None else {"step": first.step, "field": first.field}
        values = {} if first is None else {"stored": first.stored, "now": first.now}
        return {
            "label": self.label,
            "same": first is None,
            "steps": self.steps,
            "difference": place and place | values,
            "changed_versions": list(self.changed),
        }


def verify(folder: FolderArgument, json_output: JsonOption = False) -> None:
    """Run a saved run again from its manifest; exit status 0 when every step is the same, else 1."""
    with one_line_errors():
        verdicts = [verified(run) for run in open_runs(folder)]
    if json_output:
        results.print_json(json.dumps({"runs": [verdict.to_json() for verdict in verdicts]}))
    else:
        for verdict in verdicts:
            results.print(verdict.say(), soft_wrap=True)
    if any(verdict.difference is not None for verdict in verdicts):
        raise typer.Exit(1)


def verified(run: SavedRun) -> Verdict:
    """Run it again and compare step by step; only one step of each is held.

    LogError when session or library are gone or were changed, or when the saved run is damaged.
    """
    manifest, steps = run.manifest, 0
    session, library = session_of(run), library_of(run)
    localizer = localizer_of(run, session, library)
    start = None if manifest.start is None else np.array(manifest.start)
    again = run_filter(localizer, session, start)
    changed = changed_versions(run)
    with progress(f"verify {manifest.label}") as advance:
        for stored in run.steps():
            update = next(again, None)
            found = ended(stored) if update is None else first_difference(stored, rows_of(*update))
            if found is not None:
                return Verdict(manifest.label, steps, manifest.pictures, found, changed)
            steps += 1
            advance(steps, manifest.pictures)
    if not steps:
        raise LogError(run.folder, "holds no step, so there is nothing to verify; replay its session anew")
    return Verdict(manifest.label, steps, manifest.pictures, None, changed)


def ended(stored: StepRows) -> Difference:
    """Say that the session has no such step any more."""
    return Difference(stored.step["step"], "picture", str(stored.step["picture"]), "no more pictures")


def changed_versions(run: SavedRun) -> tuple[str, ...]:
    """Name what has another version now than when the run was made."""
    then, now = run.manifest.versions, versions_now()
    names = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    return tuple(f"{name} was {then.get(name, 'unknown')}, is {now.get(name, 'not there')}" for name in names)
