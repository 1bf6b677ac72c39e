"""Rows of text tables, streamed, whether packed with gzip or not; what is no text ends in one line."""

from __future__ import annotations

import gzip
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from .errors import LogError
from .fields import MOST, show, up_to
from .regular import expect_regular

MAX_ROW_BYTES = 2**20  # a laser scan has ten thousand
GZIP = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a table."""

    number: int  # from 1, as it stands in the file
    text: str  # without its end


def open_bytes(file: Path) -> BinaryIO:
    """Open a file for reading, unpacked when it is gzip's. OSError as `open` has it."""
    with file.open("rb") as plain:
        packed = plain.read(2) == GZIP
    return gzip.open(file, "rb") if packed else file.open("rb")  # type: ignore[return-value]  # gzip's is one


def begin_of(file: Path, size: int = 4096) -> bytes:
    """Give a file's first bytes, unpacked; nothing where it cannot be read."""
    try:
        if not file.is_file():
            return b""
        with open_bytes(file) as data:
            return data.read(size)
    except (OSError, EOFError, zlib.error):
        return b""


def begin_lines(file: Path, size: int = 4096) -> list[str]:
    """Give the first whole lines of a text file; none where it is no text."""
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
    """Give all lines that are not empty. LogError for what is no text, cut (gzip) or not there."""
    expect_regular(file, "a table")
    number = 0
    try:
        with open_bytes(file) as data:
            while line := data.readline(MAX_ROW_BYTES + 1):
                number += 1
                if len(line) > MAX_ROW_BYTES:
                    raise LogError(file, "found a line of more than 1 MiB, expected a table", number)
                text = line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
                if "\0" in text:
                    raise LogError(file, "found binary data, expected text", number)
                if text:
                    yield Row(number, text)
    except FileNotFoundError:
        raise LogError(file, "found no such file, expected a table; check the path") from None
    except UnicodeDecodeError:
        raise LogError(file, "found bytes that are not UTF-8, expected text", number) from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as problem:
        raise LogError(file, f"cannot be unpacked after line {number}: {problem}") from None
    except OSError as problem:
        raise LogError(file, f"cannot be read: {problem.strerror}") from None


def words_of(text: str, most: int = -1) -> list[str]:
    """Split a row at commas, else semicolons, else blanks and tabs; after `most` cuts the rest is whole."""
    separator = next((one for one in (",", ";") if one in text), None)
    return [word.strip() for word in text.split(separator, most)]


def names_columns(text: str) -> bool:
    """Tell whether a row names columns: it begins with a word, not with a number."""
    first = words_of(text)[0]
    return first[:1].isalpha() and not is_number(first) and not any(one.isdigit() for one in first)


def is_number(word: str) -> bool:
    """Tell whether a word is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def number_of(file: Path, row: Row, word: str, what: str, most: float = MOST) -> float:
    """Read a finite number of sensible size. LogError naming file and line otherwise."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise LogError(file, f"found {what} {show(word)}, expected a finite number", row.number)
    if abs(value) > most:
        raise LogError(file, f"found {what} {show(word)}, expected {up_to(most)}", row.number)
    return value
