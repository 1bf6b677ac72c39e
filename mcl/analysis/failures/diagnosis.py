"""The diagnosis of one run: one cause, with its evidence, for each time that it was lost."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ...filter.localizer import Localizer
from ...records import StepRecord
from ...session import Moment
from .kinds import Failure


@dataclass(slots=True)
class DiagnosisBuilder:
    """Follows one run update by update; keeps a few numbers an update, and no cloud.

    With the run's `localizer` it also looks at references, motion and map.
    """

    localizer: Localizer | None = None

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""

    def result(self) -> tuple[Failure, ...]:
        """Return the failures up to now, in the order of steps; none for a healthy run."""
        return ()

    def remarks(self) -> tuple[Failure, ...]:
        """Return what befell the run and did no harm."""
        return ()


def diagnose_run(
    steps: Iterable[tuple[Moment, StepRecord]], localizer: Localizer | None = None
) -> tuple[Failure, ...]:
    """Diagnose what `run` yields."""
    builder = DiagnosisBuilder(localizer)
    for moment, record in steps:
        builder.add(moment, record)
    return builder.result()
