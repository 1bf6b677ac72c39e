"""Text files of stamped poses in space: position and quaternion, in any order of columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.typing import F64

from .errors import LogError
from .fields import MOST_T_S, show, up_to
from .findings import Findings
from .planar import LEANING_RAD, forward_axis, leaning, planar, rotation
from .recording import OdometryPose, TruthPose
from .text_rows import Row, number_of, rows
from .time_bases import PER_SECOND, Span, detect_unit, seconds

LOOKED_AT = 200  # rows from which unit and forward axis are told


@dataclass(frozen=True, slots=True)
class Layout:
    """Where what stands in a row."""

    separator: str | None = None  # None: any blanks
    position: tuple[int, int, int] = (1, 2, 3)
    quaternion: tuple[int, int, int, int] = (7, 4, 5, 6)  # of w, x, y, z
    header: int = 0  # lines at the beginning that are no rows; those that begin with # never are


@dataclass(frozen=True, eq=False)
class PoseFile:
    """A file of poses; nothing is read before it is asked for."""

    file: Path
    kind: type[OdometryPose] | type[TruthPose]
    layout: Layout = Layout()
    unit: str | None = None  # of the times; None: told from them
    offset_s: float = 0.0  # added to the times

    def poses(self, findings: Findings) -> Iterator[OdometryPose | TruthPose]:
        """Give the poses in the plane, in the file's order; broken rows and times that fall are problems."""
        last_t_s, steepest = -np.inf, 0.0
        for row in self._rows():
            try:
                t_s = self._time(row)
                position, turned = self._pose(row)
                if t_s < last_t_s:
                    found = f"found t {t_s:.15g} after t {last_t_s:.15g}, expected time not to fall"
                    raise LogError(self.file, found, row.number)
            except LogError as problem:
                findings.problem(problem)
                continue
            last_t_s, steepest = t_s, max(steepest, leaning(turned, self._axis))
            yield self.kind(t_s, planar(position, turned, self._axis))
        if steepest > LEANING_RAD:
            tilt = f"{np.degrees(steepest):.0f} degrees out of the plane"
            findings.warning(f"{self.file}: poses point up to {tilt}; only x, y and the heading are used")

    @cached_property
    def span(self) -> Span:
        """First and last time of the rows that can be read; reads the whole file once."""
        span = Span()
        for pose in self.poses(Findings(keep_going=True)):
            span.add(pose.t_s)
        return span

    def check(self) -> None:
        """Read the first row. LogError where it is broken, or there is none."""
        first = next(self._rows(), None)
        if first is None:
            raise LogError(self.file, "found no poses, expected one a line")
        self._pose(first)

    @cached_property
    def _unit(self) -> str:
        words = [self._words(row)[0] for row in islice(self._rows(), LOOKED_AT)]
        return self.unit or detect_unit([word for word in words if _is_number(word)] or ["0"])

    @cached_property
    def _axis(self) -> str:
        turned = []
        for row in islice(self._rows(), LOOKED_AT):
            try:
                turned.append(self._pose(row)[1])
            except LogError:
                continue
        return forward_axis(turned) if turned else "x"

    def _rows(self) -> Iterator[Row]:
        for number, row in enumerate(rows(self.file)):
            if number >= self.layout.header and not row.text.startswith("#"):
                yield row

    def _words(self, row: Row) -> list[str]:
        return [word.strip() for word in row.text.split(self.layout.separator)]

    def _time(self, row: Row) -> float:
        word, per_s = self._words(row)[0], PER_SECOND[self._unit]
        number_of(self.file, row, word, "time", MOST_T_S * per_s)
        t_s = seconds(word, self._unit) + self.offset_s
        if abs(t_s) > MOST_T_S:
            raise LogError(self.file, f"found time {show(word)}, expected {up_to(MOST_T_S)}", row.number)
        return t_s

    def _pose(self, row: Row) -> tuple[F64, F64]:
        words = self._words(row)
        wanted = (*self.layout.position, *self.layout.quaternion)
        if len(words) <= max(wanted):
            found = f"found {len(words)} values ({show(row.text)}), expected at least {max(wanted) + 1}"
            raise LogError(self.file, found, row.number)
        values = np.array([number_of(self.file, row, words[at], "value") for at in wanted])
        try:
            return values[:3], rotation(values[3:])
        except ValueError as problem:
            raise LogError(self.file, str(problem), row.number) from None


def pose_file(
    file: Path | None,
    kind: type[OdometryPose] | type[TruthPose],
    unit: str | None,
    offset_s: float,
    layout: Layout | None = None,
) -> PoseFile | None:
    """Give a file of poses; None where there is none."""
    if file is None or not file.is_file():
        return None
    return PoseFile(file, kind, layout or Layout(), unit, offset_s)


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
