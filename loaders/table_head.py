"""The head of a CSV table: what separates its columns, and what they are called."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass

from .text_rows import Row, is_number

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
    """Read a table's head from its rows as they stand; None for an empty one.

    Lines with # are comments, of which the last one has the names where no other line does. A first row with
    a number in it has no names.
    """
    separator, comment = None, None
    for row in rows:
        said = _EXCEL.match(row.text)
        if said is not None:
            separator = said[1]
        elif row.text.startswith("#"):
            comment = row
        else:
            return _head(row, comment, separator)
    return None if comment is None else _named(comment, separator)


def split(text: str, separator: str) -> list[str]:
    """Split one line of a table, quoted values included; nothing where it is no such line.

    That is one with a carriage return in its middle, or with a value of more than 128 KiB.
    """
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
    return Head(tuple(name.strip() for name in split(row.text.lstrip("#"), between)), between, row.number)
