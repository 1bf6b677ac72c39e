"""What other tools are given of a saved run, update by update (docs/export.md)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from maurice_mcl.metrics import FIRST_SCORED
from maurice_mcl.typing import F64, U8

from .errors import LogError
from .recording import moved
from .run_store import SavedRun
from .run_store_rows import StepRows
from .whole_files import expect_absent

PATHS = ("estimate", "truth", "odometry")  # in the order in which files and tables have them


@dataclass(frozen=True, slots=True, eq=False)
class ExportStep:
    """One update: three poses (3,) x_m, y_m, heading_rad, and the saved rows they came from."""

    rows: StepRows
    time_s: float  # since the session's first record, and what was asked to be added
    estimate: F64  # the scored one, in the map's frame
    truth: F64 | None  # in the map's frame; None where it is not known
    odometry: F64  # as measured, uncorrected, in a frame of its own that begins at 0, 0, 0

    @property
    def scored(self) -> bool:
        """Tell whether this project's tables count it: all but the first three are."""
        return int(self.rows.step["step"]) >= FIRST_SCORED

    def pose(self, path: str) -> F64 | None:
        """Give the pose of one of `PATHS`."""
        return {"estimate": self.estimate, "truth": self.truth, "odometry": self.odometry}[path]


class Sink(Protocol):
    """A file that is being written."""

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Take in the next update, and its picture (H, W, 3) RGB where that is at hand."""
        ...


def export_steps(run: SavedRun, *, t_offset_s: float = 0.0) -> Iterator[ExportStep]:
    """Go through a saved run from its first update, holding one at a time. LogError where it is damaged."""
    odometry = np.zeros(3)
    for rows in run.steps():
        for motion in rows.step["motions"]:
            odometry = moved(odometry, np.array(motion, np.float64))
        truth = None if rows.step["truth_x_m"] is None else _pose(rows, "truth")
        time_s = rows.step["time_s"] + t_offset_s
        yield ExportStep(rows, time_s, _pose(rows, "estimate"), truth, odometry)


def _pose(rows: StepRows, kind: str) -> F64:
    return np.array([rows.step[f"{kind}_{name}"] for name in ("x_m", "y_m", "heading_rad")])


@contextmanager
def filling(target: Path, *, force: bool) -> Iterator[Path]:
    """Give a name to fill beside the target; it becomes the target when all went well.

    Where nothing was written nothing appears, and what `force` replaces is gone. LogError when the target
    exists and `force` is not given, or when it cannot be written.
    """
    expect_absent(target, force=force)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield part
        if part.exists():
            part.replace(target)
        else:
            target.unlink(missing_ok=True)
    except OSError as problem:
        reason = problem.strerror or problem
        raise LogError(target, f"cannot be written: {reason}; choose another place") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
