"""The lines of a log as checked records."""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import wrap_angle
from maurice_mcl.values.session import SessionInfo
from maurice_mcl.values.session import is_kidnapping as tells_of_kidnapping

from ..errors import FieldError, InputError, ReadingNotes
from ..files.text import MOST_T_S, expect_regular, flag, mapping, number, numbers, show, text, time_falls
from .header import Kind, header_from_json

# A log's lines as JSON objects: streamed, bounded, strict about numbers.

MAX_LINE_BYTES = 64 * 2**20  # room for a large picture inline; more is no log


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line as it stands in the file."""

    number: int  # from 1
    data: bytes  # without its end; the first MAX_LINE_BYTES of a line that is too long
    ended: bool  # False: the file stops before the line does, somebody may still be writing
    too_long: bool


def read_lines(path: Path) -> Iterator[LogLine]:
    """Read a file line by line. InputError if it cannot be opened or is no regular file."""
    if path.is_dir():
        raise InputError(path, _folder_advice(path))
    expect_regular(path, "a log")
    try:
        with path.open("rb") as file:
            number = 0
            while data := file.readline(MAX_LINE_BYTES + 1):
                number += 1
                yield _line(file, number, data)
    except FileNotFoundError:
        raise InputError(path, "found no such file, expected a log; check the path") from None
    except OSError as problem:
        raise InputError(path, f"cannot be read: {problem.strerror}") from None


def parse_object(line: LogLine) -> dict[str, Any]:
    """Return the JSON object of a line. Raises FieldError for anything else, NaN and Infinity included."""
    if line.too_long:
        raise FieldError(f"found a line of more than {MAX_LINE_BYTES // 2**20} MiB, expected shorter ones")
    try:
        value = json.loads(_text(line), parse_constant=_refuse_constant, parse_float=_finite)
    except json.JSONDecodeError as problem:
        text = f"found broken JSON ({problem.msg} at column {problem.colno}), expected an object"
        raise FieldError(text) from None
    except (RecursionError, ValueError) as problem:
        if isinstance(problem, FieldError):
            raise
        text = "found JSON nested too deeply or with an endless number, expected an object"
        raise FieldError(text) from None
    return mapping(value, "a line")


def _text(line: LogLine) -> str:
    data = line.data.removeprefix(b"\xef\xbb\xbf") if line.number == 1 else line.data
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as problem:
        reason = f"found bytes that are not UTF-8 at column {problem.start + 1}, expected text"
        raise FieldError(reason) from None
    if "\0" in text:
        raise FieldError("found binary data, expected a JSON object")
    return text


def _line(file: BinaryIO, number: int, data: bytes) -> LogLine:
    too_long = len(data) > MAX_LINE_BYTES
    rest = data
    while too_long and rest and not rest.endswith(b"\n"):
        rest = file.readline(MAX_LINE_BYTES)
    return LogLine(number, data.rstrip(b"\r\n"), rest.endswith(b"\n"), too_long)


def _refuse_constant(name: str) -> NoReturn:
    raise FieldError(f"found {name}, expected finite numbers")


def _finite(digits: str) -> float:
    value = float(digits)
    return value if math.isfinite(value) else _refuse_constant(show(digits))


def _folder_advice(path: Path) -> str:
    logs = sorted(file.name for file in path.glob("*.log"))
    hint = f"; did you mean {path / logs[0]}?" if logs else ""
    return f"found a folder, expected a log file{hint}"


# The records of a log, checked: what each line after the header may say.

RECORD_KEYS = ("odometry", "image", "truth", "event", "reading")


@dataclass(frozen=True, slots=True, eq=False)
class OdometryRecord:
    """A movement since the last odometry record, as the robot measured it."""

    line: int
    t_s: float
    motion: F64  # (3,) forward_m, left_m, turn_rad
    encoders_m: F64 | None  # (4,) front left, front right, rear left, rear right


@dataclass(frozen=True, slots=True, eq=False)
class PictureRecord:
    """A picture, not yet read: exactly one of `path` and `base64` is given."""

    line: int
    t_s: float
    path: str | None  # relative to the log
    base64: str | None
    camera: str | None
    covered: bool
    pose: F64 | None  # (3,) as surveyed; None in sessions and for covered pictures


@dataclass(frozen=True, slots=True, eq=False)
class TruthRecord:
    """Where the robot really was."""

    line: int
    t_s: float
    pose: F64  # (3,)


@dataclass(frozen=True, slots=True)
class EventRecord:
    """What happened, in free text."""

    line: int
    t_s: float
    text: str


@dataclass(frozen=True, slots=True)
class ReadingRecord:
    """What sensors other than cameras measured: numbers by name."""

    line: int
    t_s: float
    values: dict[str, float]


Record = OdometryRecord | PictureRecord | TruthRecord | EventRecord | ReadingRecord


def read_header(path: Path) -> tuple[SessionInfo, Kind]:
    """Read a log's first line. Raises InputError if it is not the header of a log."""
    line = next(read_lines(path), None)
    if line is None:
        raise InputError(path, "found an empty file, expected a log; was it ever written?")
    try:
        return header_from_json(parse_object(line), path)
    except FieldError as problem:
        raise InputError(path, str(problem), 1) from None


def read_records(path: Path, kind: Kind, notes: ReadingNotes, per_s: int = 1) -> Iterator[Record]:
    """Read the checked records in order; broken lines go to `notes`. `per_s`: units of time a second."""
    last_t_s = -np.inf
    for line in read_lines(path):
        if line.number == 1 or not line.data.strip():
            continue
        try:
            record = record_of(line, kind, per_s)
            if record.t_s < last_t_s:
                raise FieldError(time_falls(record.t_s, last_t_s))
        except FieldError as problem:
            if not line.ended and not _parses(line):
                notes.warning(
                    f"{path}:{line.number}: the last line is unfinished and was left out; still writing?"
                )
            else:
                notes.problem(InputError(path, str(problem), line.number))
            continue
        last_t_s = record.t_s
        yield record


def _parses(line: LogLine) -> bool:
    try:
        parse_object(line)
    except FieldError:
        return False
    return True


def record_of(line: LogLine, kind: Kind, per_s: int = 1) -> Record:
    """Read the record that a line is. FieldError for anything else."""
    found = parse_object(line)
    t_s = number(found.get("t"), "t", MOST_T_S * per_s) / per_s
    keys = [key for key in RECORD_KEYS if key in found]
    if len(keys) != 1:
        reason = f"found {' and '.join(keys) or 'none'}, expected exactly one of {', '.join(RECORD_KEYS)}"
        raise FieldError(reason)
    value = found[keys[0]]
    if keys[0] == "odometry":
        return OdometryRecord(line.number, t_s, _vector(value, 3, "odometry"), _encoders(found))
    if keys[0] == "truth":
        return TruthRecord(line.number, t_s, _vector(value, 3, "truth"))
    if keys[0] == "event":
        return EventRecord(line.number, t_s, text(value, "event"))
    if keys[0] == "reading":
        return ReadingRecord(line.number, t_s, readings_of(value))
    return _picture(line.number, t_s, found, kind)


def readings_of(value: Any) -> dict[str, float]:
    """Read the object of a reading: names to finite numbers. FieldError for anything else."""
    return {name: number(one, f"reading.{name}") for name, one in mapping(value, "reading").items()}


def _encoders(found: dict[str, Any]) -> F64 | None:
    value = found.get("encoders_m")
    return None if value is None else _vector(value, 4, "encoders_m")


def _picture(line: int, t_s: float, found: dict[str, Any], kind: Kind) -> PictureRecord:
    path, inline = _source(found["image"])
    camera = None if found.get("camera") is None else text(found["camera"], "camera")
    covered = flag(found.get("covered", False), "covered")
    surveyed = kind == "survey" and not covered
    if surveyed and found.get("pose") is None:
        raise FieldError("found a picture without its pose, expected one in a survey unless it is covered")
    pose = _vector(found["pose"], 3, "pose") if surveyed else None
    return PictureRecord(line, t_s, path, inline, camera, covered, pose)


def _source(value: Any) -> tuple[str | None, str | None]:
    if isinstance(value, str):
        path = text(value, "image")
        if Path(path).is_absolute():
            raise FieldError(f"found image {show(path)}, expected a path relative to the log")
        return path, None
    if isinstance(value, dict):
        return None, text(mapping(value, "image").get("base64"), "image.base64")
    raise FieldError(f'found image {show(value)}, expected a path or {{"base64": ...}}')


def _vector(value: Any, count: int, what: str) -> F64:
    return np.array(numbers(value, count, what))


# The truth at each picture's time, from truth records before and after it, looking ahead at most 1 s.

MAX_GAP_S = 1.0  # truth records further apart say nothing about the time between them
MAX_WAITING = 10_000  # records held back while the next truth is awaited, whatever the clock does

Answered = tuple[Record, F64 | None]


def with_truth(records: Iterable[Record]) -> Iterator[Answered]:
    """Yield every record in order, and beside each picture the truth at its time, (3,) or None.

    Interpolated between two truth records at most 1 s apart, never across a kidnapping.
    """
    before: TruthRecord | None = None
    waiting: deque[Record] = deque()  # begins with a picture, when there is anything in it
    for record in records:
        if isinstance(record, TruthRecord):
            yield from _answer(waiting, before, record)
            before = record
        elif waiting and (_in_vain(waiting, before, record) or is_kidnapping(record)):
            yield from _answer(waiting, before, None)
        if is_kidnapping(record):
            before = None
        if isinstance(record, PictureRecord) and before is not None and before.t_s == record.t_s:
            yield record, before.pose
        elif waiting or isinstance(record, PictureRecord):
            waiting.append(record)
        else:
            yield record, None
    yield from _answer(waiting, before, None)


def truth_between(before: TruthRecord | None, after: TruthRecord, t_s: float) -> F64 | None:
    """Return the pose (3,) at a time between two truth records, or None when they are over 1 s apart."""
    if after.t_s == t_s:
        return after.pose
    if before is None or after.t_s - before.t_s > MAX_GAP_S + 1e-9:  # decimal seconds are not exact
        return None
    step = after.pose - before.pose
    step[2] = wrap_angle(float(step[2]))
    pose = before.pose + step * ((t_s - before.t_s) / (after.t_s - before.t_s))
    pose[2] = wrap_angle(float(pose[2]))
    return pose


def is_kidnapping(record: Record) -> bool:
    """Return whether a record tells that the robot was carried away."""
    return isinstance(record, EventRecord) and tells_of_kidnapping(record.text)


def _answer(
    waiting: deque[Record], before: TruthRecord | None, after: TruthRecord | None
) -> Iterator[Answered]:
    while waiting:
        record = waiting.popleft()
        known = after is not None and isinstance(record, PictureRecord)
        yield record, truth_between(before, after, record.t_s) if known and after is not None else None


def _in_vain(waiting: deque[Record], before: TruthRecord | None, record: Record) -> bool:
    """Return whether no truth from this record on can tell anything about the pictures that wait."""
    first_s = waiting[0].t_s
    until_s = first_s if before is None else max(first_s, before.t_s + MAX_GAP_S + 1e-9)
    return record.t_s > until_s or len(waiting) >= MAX_WAITING
