"""CARMEN text logs: odometry, scans of a laser, and truth where the log has it. Packed with gzip or not.

Format: http://carmen.sourceforge.net/doc/binary__loggerplayback.html.
Truth are the lines TRUEPOS, or else the laser's poses of a corrected log; a log is taken for corrected when
the laser is not always at the same place on the robot, or odometry is set anew after scans.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maurice_mcl.values import F32, F64, LaserScan, SessionInfo, compose, motion_between

from ..errors import InputError, ReadingNotes
from ..files.text import MOST_T_S, number_in, show, show_time
from ..reading.options import Reading
from ..reading.recording import OdometryPose, Record, Scan, TruthPose, scan_fault
from ._tables import Row, begin_lines, number_of, rows
from .registry import Format

LASERS = ("FLASER", "ROBOTLASER1", "RLASER", "ROBOTLASER2")  # front before rear: one laser is read
REAR = ("RLASER", "ROBOTLASER2")
WORDS = ("ODOM", *LASERS, "TRUEPOS", "PARAM", "SYNC", "NEFF", "GLASER", "SCANMARK")
_WORD = re.compile(r"[A-Z][A-Z0-9_]+$")  # what a line begins with, known here or not
MOST_KEPT_BYTES = 2_000_000
MOST_BACK_S = 10.0  # times that fall by less come of several clocks in one log
NO_TIME_S = 1e-9  # less is none: some writers leave a zero that is not quite one
WRAPPED_S = 2.0**32  # a time just below zero, written as if it had no sign
MOST_AT_ONE = 3  # scans a time, on average: with more, times have too few digits
SAME_M, SAME_RAD = 0.01, 0.01  # a laser whose place on the robot differs by more was moved by a correction
ESTIMATED = "the truth is the log's corrected poses: an estimate, made from the same scans"
REPEATED = (
    "the log's odometry repeats its corrected poses: it was made from the truth and has no error of its own; "
    "--reading odometry_from_truth=true makes some with noise"
)
UNTIMED = "the scans have no times and are taken to be a second apart, in the order of the lines"
COARSE = "the scans share {times} times, which have too few digits: they are taken to be a second apart"


class _Line(NamedTuple):
    row: Row
    word: str
    t_s: float
    pose: F64  # (3,) of the robot's odometry, or of TRUEPOS
    laser: F64 | None = None  # (3,) of the laser
    scan: LaserScan | None = None  # without the laser's place on the robot, and for (F,R)LASER its reach


@dataclass(frozen=True, slots=True, eq=False)
class _Facts:
    """What has to be known of a log before its records are."""

    laser: str | None  # word of the scans that are read
    truth: str | None
    odometry: frozenset[str]  # words
    mount: F64  # (3,) the laser's pose on the robot
    ahead_m: float  # of it, found in corrected poses: where the laser turned about
    max_m: float  # the reach of a laser that does not state it
    untimed: str  # why the times of scans are of no use; "" where they are
    repeats: bool  # whether the odometry is that of the corrected poses
    others: int  # scans of other lasers


@dataclass(frozen=True, eq=False)
class CarmenRecording:
    """A log; there are no pictures in it."""

    path: Path
    options: Reading = field(default_factory=Reading)
    pictureless = True

    @cached_property
    def info(self) -> SessionInfo:
        """What is known before the first record; notes say what truth and odometry are worth."""
        facts = self._facts
        remarks = {
            ESTIMATED: facts.truth in LASERS,
            REPEATED: facts.repeats and not self.options.odometry_from_truth,
            facts.untimed: bool(facts.untimed),
            f"the laser is taken to sit {facts.ahead_m:.2f} m ahead of the wheels, by how its poses turn": (
                facts.ahead_m != 0
            ),
        }
        notes = tuple(note for note, holds in remarks.items() if holds)
        return SessionInfo(self.path.name.removesuffix(".gz").removesuffix(".log"), notes=notes)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the log's lines in order: times that fall a little are raised, odometry set anew goes on."""
        facts, odometry = self._facts, _Continuous()
        kinds = frozenset[str]() if facts.repeats and self.options.odometry_from_truth else facts.odometry
        last_t_s, fallen, scans, before = 0.0, 0, 0, None
        for line in self._lines(notes):
            set_anew = _set_anew(before, line, last_t_s)
            before = line
            t_s = float(scans) if facts.untimed else line.t_s
            if t_s < last_t_s - MOST_BACK_S and not set_anew:
                times = f"{show_time(t_s)} after {show_time(last_t_s)}"
                text = f"found time {times}, expected time not to fall"
                notes.problem(InputError(self.path, text, line.row.number))
                continue
            fallen += t_s < last_t_s and not set_anew
            last_t_s = max(last_t_s, t_s)
            if line.word in kinds:
                yield OdometryPose(last_t_s, odometry.take(line.pose, set_anew=set_anew))
            if line.word == facts.truth:
                pose = line.pose if line.laser is None else line.laser
                yield TruthPose(last_t_s, compose(pose, np.array([-facts.ahead_m, 0.0, 0.0])))
            if line.word == facts.laser and line.scan is not None:
                scans += 1
                reach_m = line.scan.max_m or facts.max_m
                yield Scan(last_t_s, replace(line.scan, max_m=reach_m, mount=facts.mount))
        if fallen:
            notes.warning(f"{self.path}: {fallen} times fall a little and are raised to the ones before")
        if facts.others:
            notes.warning(
                f"{self.path}: {facts.others} scans of other lasers are left out: {facts.laser} is read"
            )

    @cached_property
    def _facts(self) -> _Facts:
        """Go through the log once."""
        counts, times = Counter[str](), defaultdict[str, set[float]](set)  # of scans by their words
        reach, lever, mounts = _Reach(), _Lever(), dict[str, F64]()
        corrected: str | None = None
        own = unchanged = 0  # scans with odometry of their own before them, and where laser and robot are one
        moved = False
        before, last_t_s = None, 0.0
        last_laser: F64 | None = None
        for line in self._lines(ReadingNotes(keep_going=True)):
            counts[line.word] += 1
            if line.scan is not None and line.t_s > NO_TIME_S:
                times[line.word].add(line.t_s)
            set_anew = _set_anew(before, line, last_t_s)
            if before is not None and set_anew:
                corrected = corrected or before.word
            if line.word == "ODOM":
                lever.turned(line.pose, set_anew=set_anew)
            before, last_t_s = line, max(last_t_s, line.t_s)
            if line.word == "ODOM":
                moved = moved or last_laser is None or not np.array_equal(line.pose, last_laser)
            if line.laser is None or line.scan is None:
                continue
            reach.add(line.scan.ranges_m)
            place = motion_between(line.pose, line.laser)
            mounted = mounts.setdefault(line.word, place)
            if line.word not in REAR:
                corrected = corrected or (None if _same_place(place, mounted) else line.word)
                lever.seen(line.laser)
                unchanged += bool(np.array_equal(line.pose, line.laser))
                own, moved, last_laser = own + moved, False, line.laser
        laser = next((word for word in LASERS if counts[word]), None)
        truth = "TRUEPOS" if counts["TRUEPOS"] else corrected
        scans = counts[laser or ""]
        repeats = truth in LASERS and unchanged == scans > 2 * own
        in_scans = repeats or truth not in LASERS or not counts["ODOM"]
        in_rows = not repeats
        odometry = frozenset(
            word for word, holds in (("ODOM", in_rows), (laser or "", in_scans)) if holds and counts[word]
        )
        # a corrected log has lost where the laser sat: its truth is the laser's pose
        mount = np.array([self.options.truth_ahead_m, self.options.truth_left_m, 0.0])
        ahead_m = 0.0 if truth not in LASERS or repeats or mount.any() else lever.ahead_m
        mount[0] += ahead_m
        if laser is not None and truth not in LASERS:
            mount = mounts[laser]
        if laser in REAR and abs(float(mount[2])) < SAME_RAD:
            mount = np.array([*mount[:2], math.pi])
        others = sum(counts[word] for word in LASERS if word != laser)
        untimed, distinct = "", len(times[laser or ""])
        if scans > 1 and scans >= MOST_AT_ONE * distinct:
            untimed = COARSE.format(times=distinct) if distinct else UNTIMED
        return _Facts(laser, truth, odometry, mount, ahead_m, reach.max_m, untimed, repeats, others)

    def _lines(self, notes: ReadingNotes) -> Iterator[_Line]:
        for line in self._kept or self._parsed():
            if isinstance(line, InputError):
                notes.problem(line)
            else:
                yield line

    @cached_property
    def _kept(self) -> list[_Line | InputError]:
        """The lines of a short log, which is gone through more than once; none of a longer one."""
        return list(self._parsed()) if self.path.stat().st_size <= MOST_KEPT_BYTES else []

    def _parsed(self) -> Iterator[_Line | InputError]:
        for row in rows(self.path):
            try:
                line = _parsed(self.path, row, row.text.split())
            except InputError as problem:
                yield problem
            else:
                if line is not None:
                    yield line


def _set_anew(before: _Line | None, line: _Line, last_t_s: float) -> bool:
    """Return whether odometry was set to the pose of a scan, without a time of its own."""
    untimed = line.t_s < last_t_s - MOST_BACK_S or line.t_s < NO_TIME_S < last_t_s
    after_scan = before is not None and before.word == "FLASER" and line.word == "ODOM"
    return untimed and after_scan and before is not None and np.array_equal(before.pose, line.pose)


def _same_place(place: F64, other: F64) -> bool:
    """Return whether two places (3,) of a laser on the robot are one."""
    shift = np.abs(place - other)
    turned = min(float(shift[2]), 2 * math.pi - float(shift[2]))
    return math.hypot(shift[0], shift[1]) <= SAME_M and turned <= SAME_RAD


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


class _Lever:
    """How far ahead of the point that the odometry turns about a laser sits, by its corrected poses."""

    LEAST_RAD, MOST_M = 0.2, 0.3  # turns that tell it, and ways that do not blur it
    FEWEST, LEAST_M, FARTHEST_M = 20, 0.02, 1.0  # turns; offsets that are none, and those that are too large

    def __init__(self) -> None:
        self._continuous = _Continuous()
        self._wheels: F64 | None = None
        self._last: tuple[F64, F64] | None = None
        self._offsets: list[float] = []

    def turned(self, pose: F64, *, set_anew: bool) -> None:
        """Take the next pose (3,) of the odometry."""
        self._wheels = self._continuous.take(pose, set_anew=set_anew)

    def seen(self, laser: F64) -> None:
        """Take the next corrected pose (3,) of the laser."""
        if self._wheels is None:
            return
        last, self._last = self._last, (self._wheels, laser)
        if last is None:
            return
        wheels, way = motion_between(last[0], self._wheels), motion_between(last[1], laser)
        turn = math.sin(wheels[2])
        if abs(turn) > self.LEAST_RAD and math.hypot(wheels[0], wheels[1]) < self.MOST_M:
            self._offsets.append(float(way[1] - wheels[1]) / turn)

    @property
    def ahead_m(self) -> float:
        """0 where too few turns tell it."""
        if len(self._offsets) < self.FEWEST:
            return 0.0
        middle = float(np.median(self._offsets))
        return middle if self.LEAST_M < abs(middle) < self.FARTHEST_M else 0.0


class _Reach:
    """The reach of a laser by its longest ranges: what it says where nothing was hit repeats at the top."""

    USUAL_M = 81.92  # of the lasers that such logs are of, where no range tells it
    MOST_M = 1000.0  # of a planar laser
    NEAR, SAME = 0.95, 0.999  # of the longest range: what is compared, and what is one value
    FEWEST = 3  # ranges of that value
    MOST_VALUES = 20_000  # a laser that repeats no value has no maximum

    def __init__(self) -> None:
        self._longest_m = 0.0
        self._counts = Counter[float]()

    def add(self, ranges_m: F32) -> None:
        ranges_m = ranges_m[(ranges_m > 0) & (ranges_m < self.MOST_M)]
        self._longest_m = max(self._longest_m, float(ranges_m.max(initial=0.0)))
        if len(self._counts) < self.MOST_VALUES:
            self._counts.update(ranges_m[ranges_m >= self.NEAR * self._longest_m].tolist())
        if len(self._counts) >= self.MOST_VALUES:
            near_m = self.NEAR * self._longest_m
            self._counts = Counter({v: n for v, n in self._counts.items() if v >= near_m})

    @property
    def max_m(self) -> float:
        """The least range that means that nothing was hit."""
        near = {v: n for v, n in self._counts.items() if v >= self.NEAR * self._longest_m}
        top = {v: n for v, n in near.items() if v >= self.SAME * self._longest_m}
        if not top:
            return self.USUAL_M
        at_top = sum(top.values())
        repeated = at_top >= self.FEWEST and 2 * at_top > sum(near.values())
        return min(top) if repeated else max(self._longest_m + 0.01, self.USUAL_M)


def _parsed(file: Path, row: Row, words: list[str]) -> _Line | None:
    """Read a line that has a pose; None for every other. InputError for one that is cut or no number."""
    word = words[0]
    # ODOM: x y theta tv rv accel, then times; TRUEPOS: true x y theta, odometry's, then times
    if word in ("ODOM", "TRUEPOS"):
        return _Line(row, word, _time(file, row, words), _vector(file, row, words, 1))
    # FLASER, RLASER: n, n ranges, laser's x y theta, odometry's x y theta, then times
    # ROBOTLASER: type, start, fov, resolution, reach and 2 more, n, ranges, m, remissions, then the poses
    if word not in LASERS:
        return None
    states = word.startswith("ROBOT")
    first = 8 if states else 1
    at = first + 1 + _count(file, row, words, first)
    scan = _scan(file, row, words, first + 1, at)
    at += 1 + _count(file, row, words, at) if states else 0
    laser, pose = (_vector(file, row, words, at + skip) for skip in (0, 3))
    return _Line(row, word, _time(file, row, words), pose, laser, scan)


def _scan(file: Path, row: Row, words: list[str], begin: int, end: int) -> LaserScan:
    """Read ranges, which CARMEN spreads over half a turn unless the line says otherwise."""
    if len(words) < end:
        text = f"found {len(words) - begin} of {end - begin} ranges; was the line cut?"
        raise InputError(file, text, row.number)
    try:
        with np.errstate(over="ignore"):
            ranges_m = np.array(list(map(float, words[begin:end])), np.float64).astype(np.float32)
    except ValueError as problem:
        raise InputError(file, f"found a range that is no number: {problem}", row.number) from None
    start_rad, span_rad, step_rad, max_m = -math.pi / 2, math.pi, 0.0, 0.0
    if words[0].startswith("ROBOT"):
        start_rad, span_rad, step_rad, max_m = (number_of(file, row, w, "value") for w in words[2:6])
    steps = end - begin - 1
    if not math.isclose(step_rad * max(steps, 1), span_rad, rel_tol=0.05):  # not stated, or wrong
        step_rad = span_rad / (steps + 1 if steps in (179, 359) else max(steps, 1))
    scan = LaserScan(ranges_m, start_rad, step_rad, 0.0, max_m)
    fault = scan_fault(replace(scan, max_m=max_m or _Reach.USUAL_M))
    if fault:
        raise InputError(file, fault, row.number)
    return scan


def _time(file: Path, row: Row, words: list[str]) -> float:
    if len(words) < 4:
        raise InputError(file, f"found {show(row.text)}, expected pose, times and host", row.number)
    with suppress(ValueError):
        if math.isclose(float(words[-1]), WRAPPED_S, rel_tol=1e-5):
            return 0.0
    return number_in(file, row.number, words[-1], "time", MOST_T_S)


def _vector(file: Path, row: Row, words: list[str], at: int) -> F64:
    if len(words) < at + 6:  # three more at least follow every pose
        text = f"found {len(words)} values, expected at least {at + 6}; was it cut?"
        raise InputError(file, text, row.number)
    return np.array([number_in(file, row.number, word, "value") for word in words[at : at + 3]])


def _count(file: Path, row: Row, words: list[str], at: int) -> int:
    word = words[at] if at < len(words) else ""
    if not word.isdecimal() or len(word) > 6:
        raise InputError(file, f"found {show(word)} for a count of readings, expected a number", row.number)
    return int(word)


def open_carmen(path: Path, options: Reading) -> CarmenRecording:
    """Open a log. Raises InputError if no line of it has a pose."""
    recording = CarmenRecording(path, options)
    if next(recording._lines(ReadingNotes(keep_going=True)), None) is None:
        raise InputError(path, "found no ODOM, FLASER or TRUEPOS, expected a CARMEN log")
    return recording


def looks_carmen(path: Path) -> bool:
    """Recognize a log by the words that its lines begin with."""
    lines = [line for line in begin_lines(path, 16384) if line.strip()]
    if any(line.startswith("# message formats defined") for line in lines[:3]):
        return True
    words = [line.split()[0] for line in lines if not line.startswith("#")][:50]
    return any(word in WORDS for word in words) and all(_WORD.match(word) for word in words)


FORMATS = (
    Format("carmen", "a CARMEN log: odometry, scans, and truth where it has it", looks_carmen, open_carmen),
)
