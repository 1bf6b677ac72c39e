"""Errors of a saved run as evo keeps them: the zip of `evo_ape --save_results`, for `evo_res`.

Written without evo: `info.json`, `stats.json`, one `.npy` an array, and both paths as TUM. Only updates
whose truth is known are in it. Nothing is aligned: an estimate is in the map's frame, as the truth is.
"""

from __future__ import annotations

import io
import json
import zipfile
from array import array
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64, U8

from ..errors import InputError
from .tables import ExportStep, filling, tum_line

TITLE = "APE w.r.t. translation part (m)\n(not aligned)"


def error_statistics(errors_m: F64) -> dict[str, float]:
    """Return evo's seven statistics of some errors (N,), N > 0, by its names."""
    squared = np.square(errors_m)
    return {
        "rmse": float(np.sqrt(squared.mean())),
        "mean": float(errors_m.mean()),
        "median": float(np.median(errors_m)),
        "std": float(errors_m.std()),
        "min": float(errors_m.min()),
        "max": float(errors_m.max()),
        "sse": float(squared.sum()),
    }


class EvoSink:
    """Collects seven numbers an update, never the clouds."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._numbers = array("d")  # time, truth's pose, estimate's pose, running

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Take in one update, if its truth is known."""
        if step.truth is not None:
            self._numbers.extend([step.time_s, *step.truth.tolist(), *step.estimate.tolist()])

    @property
    def rows(self) -> F64:
        """What was collected, (N, 7): time_s, the truth's pose, the estimate's."""
        return np.array(self._numbers, np.float64).reshape(-1, 7)

    def statistics(self) -> dict[str, float]:
        """Return the statistics of the position errors so far; nothing where no truth was known."""
        return error_statistics(self._errors()) if self._numbers else {}

    def save(self, file: Path) -> None:
        """Write the zip."""
        rows = self.rows
        arrays = {
            "error_array": self._errors(),
            "seconds_from_start": rows[:, 0] - rows[0, 0],
            "timestamps": rows[:, 0],
            "distances_from_start": _way(rows[:, 1:4]),
            "distances": _way(rows[:, 4:7]),
        }
        names = {"title": TITLE, "label": "APE (m)", "ref_name": "truth", "est_name": self._label}
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("info.json", json.dumps(names))
            archive.writestr("stats.json", json.dumps(self.statistics()))
            _write_arrays(archive, arrays)
            for name, columns in (("truth", slice(1, 4)), (self._label, slice(4, 7))):
                archive.writestr(f"{name}.tum", "".join(tum_line(row[0], row[columns]) for row in rows))

    def _errors(self) -> F64:
        rows = self.rows
        errors: F64 = np.hypot(rows[:, 4] - rows[:, 1], rows[:, 5] - rows[:, 2])
        return errors


def _way(poses: F64) -> F64:
    """Return the way driven up to each pose (N,), from poses (N, 3)."""
    steps = np.diff(poses[:, :2], axis=0)
    return np.concatenate([[0.0], np.hypot(steps[:, 0], steps[:, 1]).cumsum()])


def _write_arrays(archive: zipfile.ZipFile, arrays: Mapping[str, F64]) -> None:
    for name, values in arrays.items():
        held = io.BytesIO()
        np.save(held, values)
        archive.writestr(f"{name}.npy", held.getvalue())


@contextmanager
def evo_sink(file: Path, label: str, *, force: bool = False) -> Iterator[EvoSink]:
    """Open evo's result file. InputError as for `filling`, and when no truth was known at any update."""
    with filling(file, force=force) as part:
        sink = EvoSink(label)
        yield sink
        if not len(sink.rows):
            raise InputError(
                file, "the run knows no truth, and an error needs one; export --tum or --csv instead"
            )
        sink.save(part)
