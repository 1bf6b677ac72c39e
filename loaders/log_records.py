"""The records of a log, checked: what each line after the header may say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import F64

from .errors import LogError
from .fields import MOST_T_S, FieldError, flag, mapping, number, numbers, show, text
from .findings import Findings
from .header import Kind, header_from_json
from .log_lines import Line, parse_object, read_lines

RECORD_KEYS = ("odometry", "image", "truth", "event")


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
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
class Truth:
    """Where the robot really was."""

    line: int
    t_s: float
    pose: F64  # (3,)


@dataclass(frozen=True, slots=True)
class Event:
    """What happened, in free text."""

    line: int
    t_s: float
    text: str


Record = Odometry | PictureRecord | Truth | Event


def read_header(path: Path) -> tuple[SessionInfo, Kind]:
    """Read a log's first line. LogError when it is not the header of a log."""
    line = next(read_lines(path), None)
    if line is None:
        raise LogError(path, "found an empty file, expected a log; was it ever written?")
    try:
        return header_from_json(parse_object(line), path)
    except FieldError as problem:
        raise LogError(path, str(problem), 1) from None


def read_records(path: Path, kind: Kind, findings: Findings, per_s: int = 1) -> Iterator[Record]:
    """Read the checked records of a log in order, times never falling; broken lines go to `findings`.

    `per_s` is how many units of the log's times make a second.
    """
    last_t_s = -np.inf
    for line in read_lines(path):
        if line.number == 1 or not line.data.strip():
            continue
        try:
            record = record_of(line, kind, per_s)
            if record.t_s < last_t_s:
                raise FieldError(
                    f"found t {record.t_s:.15g} after t {last_t_s:.15g}, expected time not to fall"
                )
        except FieldError as problem:
            if not line.ended and not _parses(line):
                findings.warning(
                    f"{path}:{line.number}: the last line is unfinished and was left out; still writing?"
                )
            else:
                findings.problem(LogError(path, str(problem), line.number))
            continue
        last_t_s = record.t_s
        yield record


def _parses(line: Line) -> bool:
    try:
        parse_object(line)
    except FieldError:
        return False
    return True


def record_of(line: Line, kind: Kind, per_s: int = 1) -> Record:
    """Read the record that a line is. FieldError for anything else."""
    found = parse_object(line)
    t_s = number(found.get("t"), "t", MOST_T_S * per_s) / per_s
    keys = [key for key in RECORD_KEYS if key in found]
    if len(keys) != 1:
        raise FieldError(
            f"found {' and '.join(keys) or 'none'}, expected exactly one of {', '.join(RECORD_KEYS)}"
        )
    value = found[keys[0]]
    if keys[0] == "odometry":
        return Odometry(line.number, t_s, _vector(value, 3, "odometry"), _encoders(found))
    if keys[0] == "truth":
        return Truth(line.number, t_s, _vector(value, 3, "truth"))
    if keys[0] == "event":
        return Event(line.number, t_s, text(value, "event"))
    return _picture(line.number, t_s, found, kind)


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
