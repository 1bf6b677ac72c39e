"""Reading text files, checks of the values in them, and values as TOML."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, TypeVar

from ..errors import FieldError, InputError
from .paths import look_again


def expect_regular(file: Path, expected: str) -> None:
    """Raise InputError for a device, pipe or socket; what is not there, and folders, are the caller's."""
    if file.exists() and not file.is_file() and not file.is_dir():
        raise InputError(file, f"found no regular file, expected {expected}; save it to a file first")


@contextmanager
def reading(file: Path, wanted: str) -> Iterator[None]:
    """Turn what the system says while a file is read into an InputError; a device or pipe is one at once."""
    expect_regular(file, wanted)
    try:
        yield
    except FileNotFoundError:
        raise InputError(file, f"found no such file, expected {wanted}; {look_again(file)}") from None
    except OSError as problem:
        raise InputError(file, f"cannot be read: {problem.strerror or problem}") from None


def read_bounded(file: Path, wanted: str, most_bytes: int) -> bytes:
    """Return what a regular file holds. InputError for any other, a larger one, and one that cannot be read.

    A pipe would wait forever, and a device such as `/dev/zero` has no end.
    """
    with reading(file, wanted), file.open("rb") as data:
        content = data.read(most_bytes + 1)
    if len(content) > most_bytes:
        size = f"more than {most_bytes / 1e6:g} MB"
        raise InputError(file, f"found {size}, expected {wanted} of at most that size; is it another file?")
    return content


_DIGITS = re.compile(r"(\d+)")


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Sort by name, numbers in names by their value."""
    return sorted(files, key=lambda file: _parts(file.name))


def _parts(name: str) -> list[tuple[int, int, str]]:
    parts = _DIGITS.split(name)
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in parts]


PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")  # endings, in lower case


def pictures_in(folder: Path) -> list[Path]:
    """Return the pictures of a folder in natural order."""
    return natural_order(file for file in folder.iterdir() if file.suffix.lower() in PICTURES)


# Text files: CSV, TOML, rows of numbers.

Row = TypeVar("Row")


def read_csv(
    file: Path, wanted: str, each: str, parse: Callable[[csv.DictReader[str]], Iterator[Row]]
) -> list[Row]:
    """Read a CSV table row by row. Raises InputError if it cannot be read, or has no rows."""
    try:
        with reading(file, wanted), file.open(newline="", encoding="utf-8-sig") as data:
            rows = list(parse(csv.DictReader(data)))
    except (UnicodeDecodeError, csv.Error) as problem:
        raise InputError(file, f"cannot be read as a CSV table: {problem}") from None
    if not rows:
        raise InputError(file, f"found no rows, expected one a {each}")
    return rows


MOST_TABLE_BYTES = 64_000_000  # of numbers that are read at once
MOST_TOML_BYTES = 1_000_000  # settings, plans and worlds have some kilobytes
_LONG_KEY = re.compile(r"""(?<!["'\w-])(?:["'\w-]+[ \t]*\.[ \t]*){32}""")  # takes tomllib long


def read_toml(file: Path, wanted: str) -> dict[str, Any]:
    """Read a TOML file, of bounded size and nesting. Raises InputError if it cannot be read."""
    content = read_bounded(file, wanted, MOST_TOML_BYTES)
    try:
        return parse_toml(content.decode("utf-8-sig"))
    except ValueError as problem:
        raise InputError(file, f"cannot be read as TOML: {problem}; correct it there") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Return the values of a TOML text. ValueError in one line where it is broken or nested too deeply."""
    if key := _LONG_KEY.search(text):
        line = text.count("\n", 0, key.start()) + 1
        raise ValueError(f"found a key of more than 32 parts (at line {line})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise ValueError(" ".join(str(problem).split())) from None
    except (ValueError, RecursionError):
        raise ValueError("found a number of thousands of digits, or too much nesting") from None


def read_number_rows(
    file: Path, regular: str, form: str, count: int, wanted: str, *, commas: bool = False
) -> list[list[float]]:
    """Read lines of `count` numbers; `commas` allows commas and # comments. InputError names the line."""
    try:
        lines = read_bounded(file, regular, MOST_TABLE_BYTES).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as problem:
        raise InputError(file, f"cannot be read as {form}: {problem}") from None
    rows = []
    for at, line in enumerate(map(str.strip, lines), 1):
        if not line or (commas and line.startswith("#")):
            continue
        try:
            values = [float(word) for word in (line.replace(",", " ") if commas else line).split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            raise InputError(file, f"found {show(line)}, expected {wanted}", at)
        if max(map(abs, values)) > MOST:
            raise InputError(file, f"found {show(line)}, expected each {up_to()}", at)
        rows.append(values)
    return rows


# Checks of values: each returns the value with its type known, or says what is wrong.

MOST = 1e9  # meters, radians, pixels: more is a slip, and squares of it still fit into float32
MOST_T_S = 4e9  # Unix time until 2096; the time between any two is still one that the viewer can count


MOST_VALUES = 4_000_000  # in one JSON text: an empty list of two bytes takes some 60 in memory


def read_json(data: bytes | str, **hooks: Any) -> Any:
    """Return the value of a JSON text; `hooks` as for `json.loads`.

    ValueError for what is none, and where it is nested too deeply or holds too many values.
    """
    marks: Any = (b",", b"[", b"{") if isinstance(data, bytes) else (",", "[", "{")
    if len(data) > MOST_VALUES and sum(map(data.count, marks)) > MOST_VALUES:
        raise ValueError(f"found JSON with more than {MOST_VALUES:,} values")
    try:
        return json.loads(data, **hooks)
    except RecursionError:
        raise ValueError("found JSON that is nested too deeply") from None


def show(value: Any) -> str:
    """Show a found value on one line, short."""
    if value is None:
        return "nothing"
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def show_time(t_s: float) -> str:
    """Show a time in seconds with as many digits as tell it from every other."""
    short = f"{t_s:.15g}"
    return short if float(short) == t_s else repr(float(t_s))


def time_falls(t_s: float, last_t_s: float) -> str:
    """Return the error of a time that is less than the one before it."""
    return f"found t {show_time(t_s)} after t {show_time(last_t_s)}, expected time not to fall"


def number(value: Any, what: str, most: float = MOST) -> float:
    """Return a finite number at most so far from zero; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise FieldError(f"found {what} {show(value)}, expected a finite number")
    if abs(value) > most:
        raise FieldError(f"found {what} {show(value)}, expected {up_to(most)}")
    return float(value)


def whole(value: Any, what: str) -> int:
    """Return a whole number below 2**32."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise FieldError(f"found {what} {show(value)}, expected a whole number from 0")
    return value


def up_to(most: float = MOST) -> str:
    """Return how large a number may be."""
    return f"a number up to {most:g} in size".replace("e+0", "e")


def numbers(value: Any, count: int, what: str, most: float = MOST) -> list[float]:
    """Return a list of exactly so many numbers, each of them as `number` takes it."""
    if not isinstance(value, list) or len(value) != count:
        raise FieldError(f"found {what} {show(value)}, expected a list of {count} numbers")
    return [number(v, what, most) for v in value]


def text(value: Any, what: str) -> str:
    """Return a text that is not empty."""
    if not isinstance(value, str) or not value:
        raise FieldError(f"found {what} {show(value)}, expected a text")
    return whole_characters(value, what)


def whole_characters(value: str, what: str) -> str:
    """Return a text without lone surrogates, which JSON can hold but no file can be written with."""
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise FieldError(f"found half a character in {what} {show(value)}, expected whole ones")
    return value


def flag(value: Any, what: str) -> bool:
    """Return true or false."""
    if not isinstance(value, bool):
        raise FieldError(f"found {what} {show(value)}, expected true or false")
    return value


def items(value: Any, what: str) -> list[Any]:
    """Return a list of anything."""
    if not isinstance(value, list):
        raise FieldError(f"found {what} {show(value)}, expected a list")
    return value


def mapping(value: Any, what: str) -> dict[str, Any]:
    """Return an object."""
    if not isinstance(value, dict):
        raise FieldError(f"found {what} {show(value)}, expected an object")
    return value


# Cells of tables: a number, or one line that says where it is none.


def number_in(file: Path, line: int, word: str | None, what: str, most: float = MOST) -> float:
    """Read a finite number of sensible size. Raises InputError naming file and line otherwise."""
    try:
        value = float(word or "")
    except ValueError:
        value = math.nan
    if abs(value) <= most:
        return value
    expected = up_to(most) if math.isfinite(value) else "a finite number"
    raise InputError(file, f"found {what} {show(word)}, expected {expected}", line)


METERS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}  # units of length as typed


# Values as TOML. `tomli-w` writes neither inline tables nor comments behind values, which our files have.


def toml_value(value: Any) -> str:
    """Return one value as TOML, on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{toml_key(name)} = {toml_value(entry)}" for name, entry in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, str):  # TOML's basic strings are escaped as JSON's are, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(toml_value(entry) for entry in value)}]"
    return str(value) if isinstance(value, (date, datetime, time)) else repr(value)


def toml_key(name: str) -> str:
    """Return a key as TOML, quoted where it must be."""
    bare = bool(name) and name.isascii() and all(c.isalnum() or c in "_-" for c in name)
    return name if bare else toml_value(name)


def plain_cell(value: Any) -> Any:
    """Return a cell that no spreadsheet takes for a formula: before text such as `=1+1` stands an apostrophe.

    >>> [plain_cell(value) for value in ("=1+1", "-", "corridor", -0.5)]
    ["'=1+1", "'-", 'corridor', -0.5]
    """
    is_formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if is_formula else value
