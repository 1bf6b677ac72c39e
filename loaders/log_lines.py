"""A log's lines as JSON objects: streamed, bounded, strict about numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from .errors import LogError
from .fields import FieldError, mapping, show
from .regular import expect_regular

MAX_LINE_BYTES = 64 * 2**20  # room for a large picture inline; more is no log


@dataclass(frozen=True, slots=True)
class Line:
    """One line as it stands in the file."""

    number: int  # from 1
    data: bytes  # without its end; the first MAX_LINE_BYTES of a line that is too long
    ended: bool  # False: the file stops before the line does, somebody may still be writing
    too_long: bool


def read_lines(path: Path) -> Iterator[Line]:
    """Read a file line by line, never holding more than one.

    LogError when it cannot be opened or is no regular file, which might never end.
    """
    if path.is_dir():
        raise LogError(path, _folder_advice(path))
    expect_regular(path, "a log")
    try:
        with path.open("rb") as file:
            number = 0
            while data := file.readline(MAX_LINE_BYTES + 1):
                number += 1
                yield _line(file, number, data)
    except FileNotFoundError:
        raise LogError(path, "found no such file, expected a log; check the path") from None
    except OSError as problem:
        raise LogError(path, f"cannot be read: {problem.strerror}") from None


def parse_object(line: Line) -> dict[str, Any]:
    """Give the JSON object of a line. Raises FieldError for anything else, NaN and Infinity included."""
    if line.too_long:
        raise FieldError(f"found a line of more than {MAX_LINE_BYTES // 2**20} MiB, expected shorter ones")
    try:
        value = json.loads(_text(line), parse_constant=_refuse_constant, parse_float=_finite)
    except json.JSONDecodeError as problem:
        raise FieldError(
            f"found broken JSON ({problem.msg} at column {problem.colno}), expected an object"
        ) from None
    except (RecursionError, ValueError) as problem:
        if isinstance(problem, FieldError):
            raise
        raise FieldError(
            "found JSON nested too deeply or with an endless number, expected an object"
        ) from None
    return mapping(value, "a line")


def _text(line: Line) -> str:
    data = line.data.removeprefix(b"\xef\xbb\xbf") if line.number == 1 else line.data
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise FieldError(
            f"found bytes that are not UTF-8 at column {problem.start + 1}, expected text"
        ) from None
    if "\0" in text:
        raise FieldError("found binary data, expected a JSON object")
    return text


def _line(file: BinaryIO, number: int, data: bytes) -> Line:
    too_long = len(data) > MAX_LINE_BYTES
    rest = data
    while too_long and rest and not rest.endswith(b"\n"):
        rest = file.readline(MAX_LINE_BYTES)
    return Line(number, data.rstrip(b"\r\n"), rest.endswith(b"\n"), too_long)


def _refuse_constant(name: str) -> NoReturn:
    raise FieldError(f"found {name}, expected finite numbers")


def _finite(digits: str) -> float:
    value = float(digits)
    return value if math.isfinite(value) else _refuse_constant(show(digits))


def _folder_advice(path: Path) -> str:
    logs = sorted(file.name for file in path.glob("*.log"))
    hint = f"; did you mean {path / logs[0]}?" if logs else ""
    return f"found a folder, expected a log file{hint}"
