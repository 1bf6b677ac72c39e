"""Whether saved runs believe what is true: how often the regions of their clouds hold the true pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.fitting.belief import BeliefCalibration, BeliefJudge
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.values import plain

from ..errors import SILENT, Listener, OptionError
from ..running.saved_steps import Pictures, Restored, restored_together


@dataclass(frozen=True, slots=True)
class CalibratedBelief:
    """What was found for all runs of one label."""

    label: str
    calibration: BeliefCalibration
    left_out: int  # runs that were lost or kidnapped: their regions cannot hold the truth
    sharpness: float  # of the likelihood, as these runs had it

    @property
    def better_sharpness(self) -> float:
        """The value of `sensor.sharpness` under which the 90 % region would hold the truth in 90 %."""
        return self.sharpness * self.calibration.coverage_exponent.value

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        own = plain(self, "better_sharpness")
        del own["calibration"]
        return own | plain(self.calibration, "likelihood")


def calibrate_belief(
    *runs: str | Path, lost: bool = False, listener: Listener = SILENT
) -> list[CalibratedBelief]:
    """Judge the belief of saved runs with truth: one result per label, over all runs of that label.

    A run that was lost or kidnapped is left out, unless `lost`: its regions cannot hold the truth. Raises
    InputError for what is no saved run, and where no run is left; OptionError without any run.

        >>> import maurice_viz as mv
        >>> [belief] = mv.calibrate_belief("my-run")
        >>> [region.level for region in belief.calibration.regions]
        [0.5, 0.9, 0.99]
    """
    if not runs:
        raise OptionError("found no saved run, expected one or more")
    labelled: dict[str, list[SavedRun]] = {}
    for path in runs:
        for saved in open_runs(Path(path)):
            labelled.setdefault(saved.manifest.label, []).append(saved)
    return [_calibrated(label, alike, lost=lost, listener=listener) for label, alike in labelled.items()]


def _calibrated(label: str, runs: Sequence[SavedRun], *, lost: bool, listener: Listener) -> CalibratedBelief:
    judge, left_out = BeliefJudge(), 0
    for number, run in enumerate(runs, 1):
        listener.progress(number, len(runs), f"belief of {label}")
        judge.begin(run.manifest.session.sha256)
        if not _add(judge, run) and not lost:
            judge.drop()
            left_out += 1
    if left_out == len(runs):
        what = "each of these runs was" if left_out > 1 else "the run was"
        raise InputError(runs[0].folder, f"{what} lost or kidnapped, which is left out; --lost counts it too")
    try:
        calibration = judge.result()
    except ValueError as problem:
        raise InputError(runs[0].folder, str(problem)) from None
    if left_out:
        listener.warning(
            f"note: {label}: {left_out} of {len(runs)} runs were lost or kidnapped and are left out"
        )
    return CalibratedBelief(label, calibration, left_out, runs[0].configuration.parameters.sensor.sharpness)


def _add(judge: BeliefJudge, run: SavedRun) -> bool:
    """Add the updates of a run; return whether it was healthy."""
    rows = TableRows()
    for moment, records in restored_together([Restored(run, None)], Pictures()):
        [record] = records.values()
        judge.add(record, moment.truth)
        rows.add(moment, record)
    table = rows.table()
    return not table.kidnapped.any() and score_table(table).lost is not True
