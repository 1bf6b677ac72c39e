"""Paths as text that evo, rpg_trajectory_evaluation and others read: TUM and KITTI.

TUM has a line `t x y z qx qy qz qw` a pose, KITTI the twelve numbers of the upper three rows of a
transformation, without a time. Numbers are written so that reading them gives the same float64.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TextIO

from maurice_mcl.typing import F64, U8

from .export_steps import PATHS, ExportStep, filling

Line = Callable[[float, F64], str]


def tum_line(time_s: float, pose: F64) -> str:
    """Write one pose (3,) as TUM has it: seconds, metres, and a quaternion with w last."""
    x, y, heading = (float(v) for v in pose)
    return _joined(time_s, x, y, 0.0, 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))


def kitti_line(time_s: float, pose: F64) -> str:
    """Write one pose (3,) as KITTI has it, in our axes: x and y in the plane, z up."""
    x, y, heading = (float(v) for v in pose)
    cos, sin = math.cos(heading), math.sin(heading)
    return _joined(cos, -sin, 0.0, x, sin, cos, 0.0, y, 0.0, 0.0, 1.0, 0.0)


def _joined(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values) + "\n"


def path_files(file: Path, paths: Sequence[str]) -> dict[str, Path]:
    """Name a file for each path: the estimate has the name that was asked for, `-truth` is the truth's.

    A single path always has the name that was asked for.
    """
    if len(paths) == 1:
        return {paths[0]: file}
    beside = {name: file.with_name(f"{file.stem}-{name}{file.suffix}") for name in paths}
    return {name: file if name == PATHS[0] else path for name, path in beside.items()}


class PathSink:
    """Writes one line an update into the file of each path; a file is made by its first line."""

    def __init__(self, files: Mapping[str, Path], line: Line, *, together: bool, stack: ExitStack) -> None:
        self._files, self._line, self._together, self._stack = files, line, together, stack
        self._open: dict[str, TextIO] = {}
        self.left_out = 0  # updates of which no path has a line

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write one update. With `together` one whose truth is not known has no line in any file."""
        if self._together and step.truth is None:
            self.left_out += 1
            return
        for name in self._files:
            pose = step.pose(name)
            if pose is not None:
                self._file(name).write(self._line(step.time_s, pose))

    def _file(self, name: str) -> TextIO:
        if name not in self._open:
            file = self._files[name].open("w", encoding="ascii", newline="\n")
            self._open[name] = self._stack.enter_context(file)
        return self._open[name]


@contextmanager
def path_sink(
    files: Mapping[str, Path], line: Line, *, together: bool = False, force: bool = False
) -> Iterator[PathSink]:
    """Open the files of some paths; all appear when all went well. LogError as for `filling`."""
    with ExitStack() as whole:
        parts = {name: whole.enter_context(filling(file, force=force)) for name, file in files.items()}
        with ExitStack() as opened:
            yield PathSink(parts, line, together=together, stack=opened)
