"""Verifying a saved run: filtering its session again and comparing every step to the last bit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.runs.manifest import versions_now
from maurice_loaders.runs.rows import StepRows, rows_of
from maurice_loaders.runs.store import RunDifference, SavedRun, first_difference, open_runs
from maurice_mcl.filter.localizer import run as run_filter

from .listener import SILENT, Listener
from .saved import library_of, localizer_of, session_of


@dataclass(frozen=True, slots=True)
class Verdict:
    """The outcome of filtering one saved run again."""

    label: str
    steps: int  # equal ones, from the first
    pictures: int  # of the session; a run that was stopped early has fewer steps
    difference: RunDifference | None  # the first one; None: the runs are identical
    changed: tuple[str, ...]  # packages whose version differs from then

    @property
    def same(self) -> bool:
        """Whether the run is identical to the last bit."""
        return self.difference is None

    def __str__(self) -> str:
        versions = f" ({'; '.join(self.changed)})" if self.changed else ""
        if self.difference is None:
            short = f"; it ended before the last of {self.pictures}" if self.steps < self.pictures else ""
            return f"{self.label}: the same, all {self.steps} steps to the last bit{short}{versions}"
        return f"{self.label}: differs first at {self.difference}{versions or ' (with the same versions)'}"

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
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


def verify(run: str | Path, *, listener: Listener = SILENT) -> list[Verdict]:
    """Filter a saved run, or each run of a comparison, again from its manifest and compare step by step.

    Only one step is held in memory. Raises InputError when a session or library is gone or changed, or when
    the saved run is damaged or has no step.

        >>> [verdict] = mv.verify("my-run")
        >>> verdict.same
        True
    """
    return [_verified(saved, listener) for saved in open_runs(Path(run))]


def _verified(run: SavedRun, listener: Listener) -> Verdict:
    manifest, steps = run.manifest, 0
    session, library = session_of(run), library_of(run, listener)
    localizer = localizer_of(run, session, library)
    start = None if manifest.start is None else np.array(manifest.start)
    again = run_filter(localizer, session, start)
    changed = changed_versions(run)
    for stored in run.steps():
        update = next(again, None)
        found = ended(stored) if update is None else first_difference(stored, rows_of(*update))
        if found is not None:
            return Verdict(manifest.label, steps, manifest.pictures, found, changed)
        steps += 1
        listener.progress(steps, manifest.pictures, f"verify {manifest.label}")
    if not steps:
        raise InputError(run.folder, "holds no step, so there is nothing to verify; replay its session again")
    return Verdict(manifest.label, steps, manifest.pictures, None, changed)


def ended(stored: StepRows) -> RunDifference:
    """Return the difference of a step that the session no longer has."""
    return RunDifference(stored.step["step"], "picture", str(stored.step["picture"]), "no more pictures")


def changed_versions(run: SavedRun) -> tuple[str, ...]:
    """Name the packages whose version differs from the one that the run was made with."""
    then, now = run.manifest.versions, versions_now()
    names = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    return tuple(f"{name} was {then.get(name, 'unknown')}, is {now.get(name, 'not there')}" for name in names)
