"""CARMEN text logs: odometry, and truth where the log has it. Packed with gzip or not.

Format: http://carmen.sourceforge.net/doc/binary__loggerplayback.html.
Truth are the lines TRUEPOS, or else the laser's poses of a corrected log; a log is taken for corrected when
the laser is not always at the same place on the robot, or odometry is set anew after scans.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose, motion_between
from maurice_mcl.values.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..files.text import MOST_T_S, show, show_time
from ..reading.options import ReadingOptions
from ..reading.recording import OdometryPose, Record, TruthPose
from ._tables import Row, begin_lines, number_of, rows
from .registry import Format

WORDS = ("ODOM", "FLASER", "RLASER", "TRUEPOS", "ROBOTLASER1", "PARAM", "SYNC", "NEFF", "GLASER", "SCANMARK")
_WORD = re.compile(r"[A-Z][A-Z0-9_]+$")  # what a line begins with, known here or not
MOST_BACK_S = 10.0  # times that fall by less come of several clocks in one log
NO_TIME_S = 1e-9  # less is none: some writers leave a zero that is not quite one
SAME_M, SAME_RAD = 0.01, 0.01  # a laser whose place on the robot differs by more was moved by a correction


@dataclass(frozen=True, slots=True, eq=False)
class _Pose:
    row: Row
    word: str
    t_s: float
    pose: F64  # (3,) of the robot's odometry, or of TRUEPOS
    laser: F64 | None = None  # (3,) of the laser


@dataclass(frozen=True, eq=False)
class CarmenRecording:
    """A log; there are no pictures in it."""

    path: Path
    info: SessionInfo

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the log's lines in order: times that fall a little are raised, odometry set anew goes on."""
        odometry, last_t_s, fallen, before = _Continuous(), 0.0, 0, None
        source = next((word for word in ("ODOM", "FLASER", "ROBOTLASER1") if word in self._words), None)
        truth = self._truth_word
        for line in self._poses(notes):
            set_anew = _set_anew(before, line, last_t_s)
            before = line
            if line.t_s < last_t_s - MOST_BACK_S and not set_anew:
                times = f"{show_time(line.t_s)} after {show_time(last_t_s)}"
                text = f"found time {times}, expected time not to fall"
                notes.problem(InputError(self.path, text, line.row.number))
                continue
            fallen += line.t_s < last_t_s and not set_anew
            last_t_s = max(last_t_s, line.t_s)
            if line.word == source:
                yield OdometryPose(last_t_s, odometry.take(line.pose, set_anew=set_anew))
            if line.word == truth:
                yield TruthPose(last_t_s, line.pose if line.laser is None else line.laser)
        if fallen:
            notes.warning(f"{self.path}: {fallen} times fall a little and are raised to the ones before")

    @cached_property
    def _words(self) -> frozenset[str]:
        return frozenset(line.word for line in self._poses(ReadingNotes(keep_going=True)))

    @cached_property
    def _truth_word(self) -> str | None:
        if "TRUEPOS" in self._words:
            return "TRUEPOS"
        lasers = (pose for pose in self._poses(ReadingNotes(keep_going=True)) if pose.word != "RLASER")
        mounted: F64 | None = None
        before, last_t_s = None, 0.0
        for line in lasers:
            if _set_anew(before, line, last_t_s):
                return "FLASER"
            before, last_t_s = line, max(last_t_s, line.t_s)
            if line.laser is None:
                continue
            place = motion_between(line.pose, line.laser)
            mounted = place if mounted is None else mounted
            shift = np.abs(place - mounted)
            if math.hypot(shift[0], shift[1]) > SAME_M or min(shift[2], 2 * math.pi - shift[2]) > SAME_RAD:
                return line.word
        return None

    def _poses(self, notes: ReadingNotes) -> Iterator[_Pose]:
        for row in rows(self.path):
            words = row.text.split()
            try:
                line = _parsed(self.path, row, words)
            except InputError as problem:
                notes.problem(problem)
                continue
            if line is not None:
                yield line


def _set_anew(before: _Pose | None, pose: _Pose, last_t_s: float) -> bool:
    """Return whether odometry was set to the pose of a scan, without a time of its own."""
    untimed = pose.t_s < last_t_s - MOST_BACK_S or pose.t_s < NO_TIME_S < last_t_s
    after_scan = before is not None and before.word == "FLASER" and pose.word == "ODOM"
    return untimed and after_scan and before is not None and np.array_equal(before.pose, pose.pose)


class _Continuous:
    """Odometry without the jumps where it was set anew."""

    def __init__(self) -> None:
        self._raw: F64 | None = None
        self._pose: F64 | None = None

    def take(self, raw: F64, *, set_anew: bool) -> F64:
        if self._raw is None or self._pose is None:
            self._pose = raw
        elif not set_anew:
            self._pose = compose(self._pose, motion_between(self._raw, raw))
        self._raw = raw
        return self._pose


def _parsed(file: Path, row: Row, words: list[str]) -> _Pose | None:
    """Read a line that has a pose; None for every other. InputError for one that is cut or no number."""
    word = words[
        0
    ]  # ODOM: x y theta tv rv accel, then times; TRUEPOS: true x y theta, odometry's, then times
    if word in ("ODOM", "TRUEPOS"):
        return _Pose(row, word, _time(file, row, words), _vector(file, row, words, 1))
    # FLASER: n, n ranges, laser's x y theta, odometry's x y theta, then times
    # ROBOTLASER1: type and 6 numbers, n, ranges, m, remissions, laser's and robot's pose ...
    if word in ("FLASER", "ROBOTLASER1"):
        first = 1 if word == "FLASER" else 8
        at = first + 1 + _count(file, row, words, first)
        at += 1 + _count(file, row, words, at) if word == "ROBOTLASER1" else 0
        laser, pose = (_vector(file, row, words, at + skip) for skip in (0, 3))
        return _Pose(row, word, _time(file, row, words), pose, laser)
    return None


def _time(file: Path, row: Row, words: list[str]) -> float:
    if len(words) < 4:
        raise InputError(file, f"found {show(row.text)}, expected pose, times and host", row.number)
    return number_of(file, row, words[-1], "time", MOST_T_S)


def _vector(file: Path, row: Row, words: list[str], at: int) -> F64:
    if len(words) < at + 6:  # three more at least follow every pose
        text = f"found {len(words)} values, expected at least {at + 6}; was it cut?"
        raise InputError(file, text, row.number)
    return np.array([number_of(file, row, word, "value") for word in words[at : at + 3]])


def _count(file: Path, row: Row, words: list[str], at: int) -> int:
    word = words[at] if at < len(words) else ""
    if not word.isdecimal() or len(word) > 6:
        raise InputError(file, f"found {show(word)} for a count of readings, expected a number", row.number)
    return int(word)


def open_carmen(path: Path, options: ReadingOptions) -> CarmenRecording:
    """Open a log. Raises InputError if no line of it has a pose."""
    recording = CarmenRecording(path, SessionInfo(path.name.removesuffix(".gz").removesuffix(".log")))
    if next(recording._poses(ReadingNotes(keep_going=True)), None) is None:
        raise InputError(path, "found no ODOM, FLASER or TRUEPOS, expected a CARMEN log")
    return recording


def looks_carmen(path: Path) -> bool:
    """Recognize a log by the words that its lines begin with."""
    lines = [line for line in begin_lines(path, 16384) if line.strip()]
    if any(line.startswith("# message formats defined") for line in lines[:3]):
        return True
    words = [line.split()[0] for line in lines if not line.startswith("#")][:50]
    return any(word in WORDS for word in words) and all(_WORD.match(word) for word in words)


FORMATS = (Format("carmen", "a CARMEN log: odometry, and truth where it has it", looks_carmen, open_carmen),)
