"""Filtering a saved run again: is every step the same, to the last bit?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import RunDifference, SavedRun, first_difference, open_runs
from maurice_loaders.runs.writer import rows_of
from maurice_mcl.filter.localizer import run as run_filter
from maurice_mcl.reasons.second_opinion import SecondOpinion
from maurice_mcl.values import plain

from ..errors import SILENT, Listener
from .saved import changed_versions, library_of, localizer_of, session_of
from .saved_steps import Restored


@dataclass(frozen=True, slots=True)
class Verification:
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
        values = plain(self, "same")
        del values["pictures"]
        return values | {"changed_versions": values.pop("changed")}


def verify(run: str | Path, *, listener: Listener = SILENT) -> list[Verification]:
    """Filter a saved run, or each run of a comparison, again from its manifest and compare step by step.

    Only one step is held in memory. Raises InputError when a session or library is gone or changed, or when
    the saved run is damaged or has no step.

        >>> import maurice_viz as mv
        >>> [verification] = mv.verify("my-run")
        >>> verification.same
        True
    """
    return [_verified(saved, listener) for saved in open_runs(Path(run))]


def _verified(run: SavedRun, listener: Listener) -> Verification:
    manifest, steps = run.manifest, 0
    session, library = session_of(run), library_of(run, listener)
    localizer = localizer_of(run, session, library)
    updates = run_filter(localizer, session, Restored(run, None).start)
    second, changed = SecondOpinion.beside(localizer), changed_versions(run)
    for stored in run.steps():
        update = next(updates, None)
        if update is None:
            step, picture = stored.step["step"], str(stored.step["picture"])
            difference: RunDifference | None = RunDifference(step, "picture", picture, "no more pictures")
        else:
            moment, record = update
            record = record if second is None else second.added_to(record)
            difference = first_difference(stored, rows_of(moment, record))
        if difference is not None:
            return Verification(manifest.label, steps, manifest.pictures, difference, changed)
        steps += 1
        listener.progress(steps, manifest.pictures, f"verify {manifest.label}")
    if not steps:
        raise InputError(run.folder, "holds no step, so there is nothing to verify; replay its session again")
    return Verification(manifest.label, steps, manifest.pictures, None, changed)
