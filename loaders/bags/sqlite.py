"""A ROS 2 SQLite file that is damaged or cut: row by row as written, past those that are broken."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..errors import InputError
from .ros_types import bag_errors, decode_cdr
from .source import Message, Topic, short_type, sorted_topics

# Indexes are not used: they may be what is damaged, and what was written first is likely whole.
_AFTER = "FROM messages NOT INDEXED WHERE rowid > ? ORDER BY rowid"
_ROWS = f"SELECT rowid, topic_id, timestamp, data {_AFTER}"
_COUNTED = f"SELECT rowid, topic_id {_AFTER}"
_DEFINED = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
LEAP = 20_000  # rows in a row that cannot be read; after so many the file is taken to end there


class BrokenDatabase:
    """What can be read of the file, as a `BagSource`. InputError where not even its topics can."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cut = ""  # where it breaks; "" as long as it does not
        self._gaps: list[str] = []  # rows that were left out before that
        self._base = sqlite3.connect(
            f"file:{quote(str(path.absolute()))}?immutable=1", uri=True, check_same_thread=False
        )
        try:
            self._base.execute("PRAGMA writable_schema = ON")  # else a file that is cut is not opened
            found = self._base.execute("SELECT id, name, type FROM topics").fetchall()
            self._names = {number: (str(name), str(kind)) for number, name, kind in found}
        except sqlite3.Error as problem:
            self._base.close()
            raise InputError(path, f"found no topics in it ({problem}), expected a ROS 2 bag") from None
        self._definitions: dict[str, tuple[str, str]] = {}
        with suppress(sqlite3.Error):  # before ROS 2 Iron there are none
            self._definitions = {
                str(kind): (str(text), str(form).removeprefix("ros2"))
                for kind, form, text in self._base.execute(_DEFINED)
            }
        counts = Counter(number for (number,) in self._rows(_COUNTED))
        named = self._names.items()
        self.topics = sorted_topics([Topic(name, short_type(kind), counts[n]) for n, (name, kind) in named])

    @property
    def damaged(self) -> tuple[str, ...]:
        """The rows that were left out in the middle."""
        return tuple(self._gaps)

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def messages(self, names: Collection[str]) -> Iterator[Message]:
        """Give the messages of these topics that can be read."""
        self._gaps = []
        for number, log_ns, data in self._rows(_ROWS):
            name, kind = self._names.get(number, ("", ""))
            if name in names and isinstance(log_ns, int):
                whole = data if isinstance(data, bytes) else b""  # which no message is
                yield Message(name, short_type(kind), log_ns, partial(self._decode, kind, whole))

    def _rows(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Give the rows that can be read. A broken page of the file hides those of a few numbers."""
        rows = last = at = 0
        while at - last <= LEAP:
            try:
                for number, *row in self._base.execute(query, (at,)):
                    if at > last:
                        self._gaps.append(f"rows {last + 1} to {at} cannot be read")
                    at = number if at < number <= at + LEAP else at + 1  # the number may be damaged too
                    rows, last = rows + 1, at
                    yield tuple(row)
            except sqlite3.Error as problem:
                at, why = at + 1, str(problem)
            else:
                break
        if at > last:
            self.cut = f"breaks off after {rows} messages ({why})"

    def _decode(self, kind: str, data: bytes) -> Any:
        with bag_errors(self._path):
            return decode_cdr(data, kind, *self._definitions.get(kind, ()))
