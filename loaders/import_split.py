"""Dividing one pass of labelled pictures honestly into a library and a drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.typing import F64

from .pose_table import PoseRow

Run = Sequence[PoseRow]  # consecutive rows of equal pose


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """Which rows go where; rows keep the table's order."""

    session: tuple[PoseRow, ...]
    library: tuple[PoseRow, ...]
    session_runs: int
    guarded_runs: int  # left out of the library because of the guard

    def nearest_reference_m(self) -> F64:
        """Give the distance (S,) of every session picture to the nearest library pose."""
        return nearest_m(xy_of(self.session), xy_of(self.library))


def split_runs(
    runs: Sequence[Run], every: int, guard_m: float, session_pictures: int, library_pictures: int
) -> Split:
    """Give every so many-th run to the session, beginning with the first, and the rest to the library.

    A library run within `guard_m` of any session pose is dropped, wherever it looks: in one pass the
    neighboring frames are almost the same picture, and a filter that finds them proves nothing.
    """
    session = [run for number, run in enumerate(runs) if number % every == 0]
    others = [run for number, run in enumerate(runs) if number % every != 0]
    driven = xy_of([run[0] for run in session])
    library = [run for run in others if nearest_m(xy_of(run[:1]), driven)[0] >= guard_m]
    return Split(
        session=tuple(row for run in session for row in spread(run, session_pictures)),
        library=tuple(row for run in library for row in spread(run, library_pictures)),
        session_runs=len(session),
        guarded_runs=len(others) - len(library),
    )


def spread(run: Run, most: int) -> list[PoseRow]:
    """Choose at most so many rows of a run, evenly spread: one is the middle one."""
    count = min(most, len(run))
    return [run[(2 * k + 1) * len(run) // (2 * count)] for k in range(count)]


def nearest_m(from_xy: F64, to_xy: F64) -> F64:
    """Give the distance (A,) of each point (A, 2) to the nearest of (B, 2); infinite when there is none."""
    apart = [float(np.hypot(*(to_xy - point).T).min(initial=np.inf)) for point in from_xy]
    return np.array(apart)


def xy_of(rows: Sequence[PoseRow]) -> F64:
    """Give the positions (K, 2) of rows."""
    return np.array([row.pose[:2] for row in rows], np.float64).reshape(-1, 2)
