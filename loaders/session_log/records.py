"""The lines of a log as checked records of a drive."""

from __future__ import annotations

import base64
import binascii
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np

from maurice_mcl.values import F64, U8, LaserScan, SessionInfo

from ..errors import FieldError, InputError, PictureError, ReadingNotes
from ..files.pictures import decode_picture, picture_in
from ..files.text import (
    MOST,
    MOST_T_S,
    flag,
    items,
    mapping,
    number,
    numbers,
    reading,
    show,
    text,
    time_falls,
)
from ..reading.recording import (
    MOST_BEAMS,
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Scan,
    TruthPose,
    scan_fault,
)
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
    with reading(path, "a log"), path.open("rb") as file:
        number = 0
        while data := file.readline(MAX_LINE_BYTES + 1):
            number += 1
            yield _line(file, number, data)


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


def line_of(value: Mapping[str, Any]) -> bytes:
    """Return an object as a line of a log, with its end."""
    return (json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n").encode()


def ascii_line(value: Mapping[str, Any]) -> bytes:
    """Return a line of a log in ASCII: what a live source says may hold half a character."""
    return (json.dumps(value) + "\n").encode()


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


# What each line after the header may say.

RECORD_KEYS = ("odometry", "odometry_pose", "image", "truth", "event", "reading", "scan")
NOTHING_HIT = "inf"  # in place of a range
MOST_UNCHECKED = 1e25  # nanoseconds since 1970 are 2e18, and squares can be added up
INLINE = "inline picture"


def read_header(path: Path) -> tuple[SessionInfo, Kind]:
    """Read a log's first line. Raises InputError if it is not the header of a log."""
    line = next(read_lines(path), None)
    if line is None:
        raise InputError(path, "found an empty file, expected a log; was it ever written?")
    try:
        return header_from_json(parse_object(line), path)
    except FieldError as problem:
        raise InputError(path, str(problem), 1) from None


@dataclass(frozen=True, slots=True)
class LineReader:
    """Turns the lines of a log into records."""

    log: Path  # whose folder the paths of pictures start from
    kind: Kind = "session"
    per_s: int = 1  # units of time a second
    outside: bool = False  # whether pictures may lie outside that folder
    unchecked: bool = False  # whether times may fall, and numbers be of nearly any size

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the records in order; broken lines go to `notes`."""
        last_t_s = -np.inf
        for line in read_lines(self.log):
            if line.number == 1 or not line.data.strip():
                continue
            try:
                record = self.record(line)
                if record.t_s < last_t_s and not self.unchecked:
                    raise FieldError(time_falls(record.t_s, last_t_s))
            except FieldError as problem:
                if not line.ended and not _parses(line):
                    unfinished = "the last line is unfinished and was left out; still writing?"
                    notes.warning(f"{self.log}:{line.number}: {unfinished}")
                else:
                    notes.problem(InputError(self.log, str(problem), line.number))
                continue
            last_t_s = record.t_s
            yield record

    def record(self, line: LogLine) -> Record:
        """Read the record that a line is. FieldError for anything else."""
        fields = parse_object(line)
        t_s = number(fields.get("t"), "t", self._most(MOST_T_S * self.per_s)) / self.per_s
        keys = [key for key in RECORD_KEYS if key in fields]
        if len(keys) != 1:
            reason = f"found {' and '.join(keys) or 'none'}, expected exactly one of {', '.join(RECORD_KEYS)}"
            raise FieldError(reason)
        value = fields[keys[0]]
        if keys[0] == "odometry":
            encoders = fields.get("encoders_m")
            wheels = None if encoders is None else self._vector(encoders, 4, "encoders_m")
            return Motion(t_s, self._vector(value, 3, "odometry"), wheels)
        if keys[0] == "odometry_pose":
            return OdometryPose(t_s, self._vector(value, 3, "odometry_pose"))
        if keys[0] == "scan":
            return Scan(t_s, scan_from_json(value))
        if keys[0] == "truth":
            return TruthPose(t_s, self._vector(value, 3, "truth"))
        if keys[0] == "event":
            return Note(t_s, text(value, "event"))
        if keys[0] == "reading":
            return Readings(t_s, readings_of(value))
        return self._picture(line.number, t_s, fields)

    def _picture(self, line: int, t_s: float, fields: dict[str, Any]) -> Picture:
        path, inline = _source(fields["image"])
        camera = None if fields.get("camera") is None else text(fields["camera"], "camera")
        covered = flag(fields.get("covered", False), "covered")
        pose = None
        if self.kind == "survey" and not covered:
            if fields.get("pose") is None:
                advice = "expected one in a survey unless it is covered"
                raise FieldError(f"found a picture without its pose, {advice}")
            pose = self._vector(fields["pose"], 3, "pose")
        encoded = partial(_encoded, path, inline, self.log, self.outside)
        read = partial(_decoded, encoded)
        return Picture(t_s, read, path or INLINE, line, path, camera, covered, pose, encoded)

    def _vector(self, value: Any, count: int, what: str) -> F64:
        return np.array(numbers(value, count, what, self._most(MOST)))

    def _most(self, usual: float) -> float:
        return MOST_UNCHECKED if self.unchecked else usual


def _parses(line: LogLine) -> bool:
    try:
        parse_object(line)
    except FieldError:
        return False
    return True


def scan_to_json(scan: LaserScan) -> dict[str, Any]:
    """Return the object of a scan, its ranges with as few digits as tell them apart."""
    ranges: list[Any] = scan.ranges_m.astype(np.float32).astype("U").astype(np.float64).tolist()
    for beam in np.flatnonzero(~np.isfinite(scan.ranges_m)):
        ranges[beam] = None if np.isnan(scan.ranges_m[beam]) else NOTHING_HIT
    angles = {"start_rad": float(scan.start_rad), "step_rad": float(scan.step_rad)}
    reach = {"min_m": float(scan.min_m), "max_m": float(scan.max_m)}
    return {"ranges_m": ranges} | angles | reach | {"mount": [float(v) for v in scan.mount]}


def scan_from_json(value: Any) -> LaserScan:
    """Read the object of a scan. FieldError for anything else."""
    fields = mapping(value, "scan")
    ranges = items(fields.get("ranges_m"), "scan.ranges_m")
    if len(ranges) > MOST_BEAMS:
        raise FieldError(f"found {len(ranges)} beams, expected 1 to {MOST_BEAMS}")
    unusual = {None: math.nan, NOTHING_HIT: math.inf}
    ranges_m = [unusual[r] if r is None or r == NOTHING_HIT else number(r, "scan.ranges_m") for r in ranges]
    names = ("start_rad", "step_rad", "min_m", "max_m")
    start_rad, step_rad, min_m, max_m = (number(fields.get(name), f"scan.{name}") for name in names)
    mount = np.array(numbers(fields.get("mount", [0, 0, 0]), 3, "scan.mount"))
    scan = LaserScan(np.array(ranges_m, np.float32), start_rad, step_rad, min_m, max_m, mount)
    fault = scan_fault(scan)
    if fault:
        raise FieldError(fault)
    return scan


def readings_of(value: Any) -> dict[str, float]:
    """Read the object of a reading: names to finite numbers. FieldError for anything else."""
    return {name: number(size, f"reading.{name}") for name, size in mapping(value, "reading").items()}


def _source(value: Any) -> tuple[str | None, str | None]:
    """Return the path of a picture, or its inline data."""
    if isinstance(value, str):
        path = text(value, "image")
        if Path(path).is_absolute():
            raise FieldError(f"found image {show(path)}, expected a path relative to the log")
        return path, None
    if isinstance(value, dict):
        return None, text(mapping(value, "image").get("base64"), "image.base64")
    raise FieldError(f'found image {show(value)}, expected a path or {{"base64": ...}}')


def _encoded(path: str | None, inline: str | None, log: Path, outside: bool) -> bytes:
    if inline is None:
        return picture_in(log.parent, str(path), outside=outside)
    try:
        return base64.b64decode(inline, validate=True)
    except (binascii.Error, ValueError):
        raise PictureError("found broken base64, expected a picture") from None


def _decoded(encoded: partial[bytes]) -> U8:
    return decode_picture(encoded())
