"""Rows, columns and headers that text formats share."""

from __future__ import annotations

import csv
import gzip
import math
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from maurice_mcl.values import expected_one_of

from ..errors import InputError
from ..files.text import METERS, MOST, number_in, reading
from ..reading.time_alignment import PER_SECOND

MAX_ROW_BYTES = 2**20  # a laser scan has ten thousand
GZIP = b"\x1f\x8b"


class Row(NamedTuple):
    """One line of a table."""

    number: int  # from 1, as it stands in the file
    text: str  # without its end


def open_bytes(file: Path) -> BinaryIO:
    """Open a file for reading, unpacked when it is gzip's. OSError as `open` has it."""
    with file.open("rb") as plain:
        packed = plain.read(2) == GZIP
    return gzip.open(file, "rb") if packed else file.open("rb")  # type: ignore[return-value]  # gzip's is one


def begin_of(file: Path, size: int = 4096) -> bytes:
    """Return a file's first bytes, unpacked; nothing where it cannot be read."""
    try:
        if not file.is_file():
            return b""
        with open_bytes(file) as data:
            return data.read(size)
    except (OSError, EOFError, zlib.error):
        return b""


def begin_lines(file: Path, size: int = 4096) -> list[str]:
    """Return the first complete lines of a text file; none where it is no text."""
    data = begin_of(file, size)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        if problem.start < len(data) - 4:  # not just a character that is cut at the end
            return []
        text = data[: problem.start].decode("utf-8-sig")
    lines = text.splitlines()
    return [] if "\0" in text else lines[:-1] if len(data) == size else lines


def rows(file: Path) -> Iterator[Row]:
    """Yield all lines that are not empty. Raises InputError for what is no text, cut (gzip) or not there."""
    number = 0
    with reading(file, "a table"), open_bytes(file) as data:
        try:
            while line := data.readline(MAX_ROW_BYTES + 1):
                number += 1
                if len(line) > MAX_ROW_BYTES:
                    raise InputError(file, "found a line of more than 1 MiB, expected a table", number)
                text = line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
                if "\0" in text:
                    raise InputError(file, "found binary data, expected text", number)
                if text:
                    yield Row(number, text)
        except UnicodeDecodeError:
            raise InputError(file, "found bytes that are not UTF-8, expected text", number) from None
        except (EOFError, zlib.error, gzip.BadGzipFile) as problem:
            raise InputError(file, f"cannot be unpacked after line {number}: {problem}") from None


_COMMA = re.compile(r"([-+]?\d*),(\d+(?:e[-+]?\d+)?)", re.IGNORECASE)  # a number with a decimal comma


def words_of(text: str, most: int = -1) -> list[str]:
    """Split a row at semicolons, else commas, else blanks and tabs; after `most` cuts the rest is whole.

    A comma in a number that semicolons or blanks separate from others becomes a point.
    """
    separator = next((mark for mark in (";", ",") if mark in text), None)
    if separator == "," and all(is_number(_pointed(word)) for word in text.split()[:2]) and " " in text:
        separator = None
    words = [word.strip() for word in text.split(separator, most)]
    return [_pointed(word) for word in words] if separator != "," and "," in text else words


def _pointed(word: str) -> str:
    matched = _COMMA.fullmatch(word)
    return word if matched is None else matched.expand(r"\1.\2")


def names_columns(text: str) -> bool:
    """Return whether a row names columns: it begins with a word, not with a number."""
    first = words_of(text)[0]
    return first[:1].isalpha() and not is_number(first) and not any(letter.isdigit() for letter in first)


def is_number(word: str) -> bool:
    """Return whether a word is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def number_of(file: Path, row: Row, word: str, what: str, most: float = MOST) -> float:
    """Read a finite number of sensible size. Raises InputError naming file and line otherwise."""
    return number_in(file, row.number, word, what, most)


# The head of a CSV table: what separates its columns, and what they are called.

SEPARATORS = (",", ";", "\t")
_EXCEL = re.compile(r"sep=(.)$", re.IGNORECASE)  # what Excel writes and reads before the names


@dataclass(frozen=True, slots=True)
class Head:
    """What stands before the rows of a table."""

    names: tuple[str, ...]
    separator: str
    lines: int  # up to which there are no rows
    named: bool = True  # else the names are 1, 2, 3 ...


def head_of(rows: Iterable[Row]) -> Head | None:
    """Read a table's head from its rows, names also from the last comment; None for an empty one."""
    separator, comment = None, None
    for row in rows:
        stated = _EXCEL.match(row.text)
        if stated is not None:
            separator = stated[1]
        elif row.text.startswith("#"):
            comment = row
        else:
            return _head(row, comment, separator)
    return None if comment is None else _named(comment, separator)


def split(text: str, separator: str) -> list[str]:
    """Split one line of a table, quoted values included; nothing where csv refuses it."""
    try:
        return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        return []


def _head(first: Row, comment: Row | None, separator: str | None) -> Head:
    here = _named(first, separator)
    if not any(is_number(name) for name in here.names):
        return here
    above = None if comment is None else _named(comment, here.separator)
    if above is not None and len(above.names) == len(here.names):
        return above
    numbers = tuple(str(at) for at in range(1, len(here.names) + 1))
    return Head(numbers, here.separator, first.number - 1, named=False)


def _named(row: Row, separator: str | None) -> Head:
    between = separator or max(SEPARATORS, key=row.text.count)
    between = between if separator or between in row.text else " "
    return Head(tuple(name.strip() for name in split(row.text.lstrip("#"), between)), between, row.number)


# What is in the columns of a table: by the command line, or by their names.

LENGTHS = {unit: METERS[unit] for unit in ("m", "cm", "mm", "in")}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
BEFORE = ("", "truth_", "true_", "gt_", "pose_", "pos_", "position_", "t")  # before x, y and the heading
NAMES: dict[str, tuple[str, ...]] = {  # role: names that tell it, without units, lower case
    "time": ("time", "t", "timestamp", "stamp"),
    "image": ("image", "picture", "file", "filename", "image_file", "image_path", "img"),
    "frame": ("frame", "frame_number"),
    **{axis: tuple(f"{before}{axis}" for before in BEFORE) for axis in "xy"},
    "heading": tuple(f"{before}{word}" for word in ("heading", "yaw", "theta") for before in BEFORE),
    **{f"q{axis}": (f"q{axis}", f"q_{axis}", f"quat_{axis}", f"orientation_{axis}") for axis in "wxyz"},
    "odometry_x": ("odometry_x", "odom_x"),
    "odometry_y": ("odometry_y", "odom_y"),
    "odometry_heading": ("odometry_heading", "odom_heading", "odometry_yaw", "odom_yaw", "odom_theta"),
    **{f"odometry_q{axis}": (f"odometry_q{axis}", f"odom_q{axis}", f"odom_q_{axis}") for axis in "wxyz"},
    "forward": ("forward", "dx"),
    "left": ("left", "dy"),
    "turn": ("turn", "dtheta", "dyaw"),
}
TRUTH: tuple[str, ...] = ("x", "y", "heading")
ODOMETRY: tuple[str, ...] = ("odometry_x", "odometry_y", "odometry_heading")
MOTION = ("forward", "left", "turn")
READING = "reading."  # before its name: a column reading_left, or the role reading.left

QUATERNIONS = {group: tuple(f"{group[0][:-1]}q{axis}" for axis in "wxyz") for group in (TRUTH, ODOMETRY)}
ANGULAR = ("heading", "odometry_heading", "turn")
_UNIT = re.compile(r"^(.+?)(?:[_ ]+|\s*[\[(])(ns|us|ms|s|m|cm|mm|in|deg|rad)[\])]?$")


@dataclass(frozen=True, slots=True)
class Column:
    """Where a role's values stand, and what makes them meters, radians or seconds."""

    at: int
    name: str
    unit: str | None  # None: unknown


def roles_of(file: Path, header: Sequence[str], asked: Mapping[str, str]) -> dict[str, Column]:
    """Return the column of each role: as `asked` (column or column:unit), or the first whose name tells it.

    InputError for a role or column that is not there, and for angles without a unit.
    """
    names = [name.strip().lstrip("#").strip() for name in header]
    columns = {role: _asked(file, names, role.replace("-", "_"), value) for role, value in asked.items()}
    columns = {role.replace("-", "_"): column for role, column in columns.items()}
    for at, name in enumerate(names):
        if name.lower().startswith(READING.replace(".", "_")):
            columns.setdefault(READING + name[len(READING) :], Column(at, name, None))
    for role in NAMES:
        named = _named_roles(names, role)
        if role not in columns and named is not None:
            columns[role] = named
    for group in (TRUTH, ODOMETRY):
        _whole(columns, group)
    for role in ANGULAR:
        if role in columns and columns[role].unit not in ANGLES:
            text = f"found column {columns[role].name!r} without a unit; say --reading columns={role}="
            raise InputError(file, f"{text}{columns[role].name}:deg or :rad", 1)
    return columns


def factor(role: str, column: Column) -> float:
    """Return what a role's values are multiplied by; lengths without a unit are meters."""
    return ANGLES.get(column.unit or "", 1.0) if role in ANGULAR else LENGTHS.get(column.unit or "", 1.0)


def _asked(file: Path, names: Sequence[str], role: str, value: str) -> Column:
    if role not in NAMES and not role.startswith(READING):
        there = f"there are {', '.join(NAMES)}, and {READING}NAME"
        raise InputError(file, f"there is no role {role!r} for a column; {there}")
    name, _, unit = value.rpartition(":") if value not in names and ":" in value else (value, "", "")
    if name not in names:
        raise InputError(file, f"found columns {', '.join(names) or 'none'}, expected also {name!r}", 1)
    units = PER_SECOND if role == "time" else ANGLES if role in ANGULAR else LENGTHS
    if unit and unit not in units:
        raise InputError(file, f"found unit {unit!r} of {role}, {expected_one_of(unit, units)}")
    return Column(names.index(name), name, unit or _split(name)[1])


def _named_roles(names: Sequence[str], role: str) -> Column | None:
    for known in NAMES[role]:
        for at, name in enumerate(names):
            base, unit = _split(name)
            if known in (base, name.lower()):
                return Column(at, name, unit)
    return None


def _split(name: str) -> tuple[str, str | None]:
    """Take the unit off a name: heading_deg, x [m], time(ns)."""
    matched = _UNIT.match(name.lower())
    return (name.lower(), None) if matched is None else (matched[1], matched[2])


def _whole(columns: dict[str, Column], group: tuple[str, ...]) -> None:
    """Take out incomplete poses; a quaternion goes before a heading."""
    turned = QUATERNIONS[group]
    unneeded = group[2:] if all(role in columns for role in turned) else turned
    for role in unneeded:
        columns.pop(role, None)
    if any(role not in columns for role in (*group[:2], *(turned if unneeded != turned else group[2:]))):
        for role in (*group, *turned):
            columns.pop(role, None)
