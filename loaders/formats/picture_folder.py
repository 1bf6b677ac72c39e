"""A folder or a video of pictures, alone or with a CSV table of poses or odometry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.values import F64, SessionInfo

from ..errors import InputError, ReadingNotes
from ..files.text import MOST_T_S, PICTURES, pictures_in, show, time_falls
from ..reading.options import Reading
from ..reading.plane import planar, rotation
from ..reading.recording import Motion, OdometryPose, Picture, Readings, Record, TruthPose
from ..reading.time_alignment import PER_SECOND, detect_unit, seconds
from ._poses import read_picture
from ._tables import (
    MOTION,
    ODOMETRY,
    QUATERNIONS,
    READING,
    TRUTH,
    Column,
    Head,
    Row,
    begin_lines,
    factor,
    head_of,
    is_number,
    number_of,
    roles_of,
    rows,
    split,
)
from .registry import Format
from .video import ENDINGS as VIDEOS
from .video import Frames

TABLES = (".csv", ".tsv")
PERIOD_S = 1.0  # of rows without a time
LOOKED_AT = 200  # rows from which the unit of times is detected


@dataclass(frozen=True, eq=False)
class TableRecording:
    """Rows in order; a row may have a picture, an odometry pose or motion, and a true pose."""

    path: Path
    info: SessionInfo
    table: Path
    roles: dict[str, Column]
    head: Head
    frames: Sequence[Path] | Frames | None  # for tables that name no files
    unit: str | None
    outside: bool = False  # whether names of pictures may lead out of the folder

    @property
    def surveyed(self) -> bool:
        """Whether the rows are pictures with poses and nothing of a drive: no time, and no odometry."""
        return not self.has_times and not self.has_odometry

    @property
    def has_times(self) -> bool:
        """Whether a column holds times."""
        return "time" in self.roles

    @property
    def has_odometry(self) -> bool:
        """Whether columns hold poses or motions by odometry."""
        return any(role in self.roles for role in (*ODOMETRY, *MOTION))

    def root_of(self, name: str) -> Path:
        """Return the folder that a picture's name starts from: that of the pictures, or the table's."""
        roots = (self.path, self.table.parent)
        return next((root for root in roots if _is_file(root / name)), self.table.parent)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the table row by row; poses come before the picture of their row."""
        if not self.has_times:
            notes.warning(f"{self.table}: no column holds the time; one row per second is assumed")
        if not any(role in self.roles for role in (*TRUTH, *ODOMETRY, *MOTION)):
            notes.warning(f"{self.table}: no column tells a pose or a motion; see --reading columns=...")
        last_t_s = -float("inf")
        for number, (row, words) in enumerate(self._rows()):
            try:
                t_s = self._time(number, row, words)
                if t_s < last_t_s:
                    raise InputError(self.table, time_falls(t_s, last_t_s), row.number)
                found_records = list(self._of_row(number, t_s, row, words))
            except InputError as problem:
                notes.problem(problem)
                continue
            last_t_s = t_s
            yield from found_records

    def check(self) -> TableRecording:
        """Read the first row. Raises InputError if it is broken or there is none."""
        first = next(self._rows(), None)
        if first is None:
            raise InputError(self.table, "found no rows, expected one a picture")
        list(self._of_row(0, self._time(0, *first), *first))
        return self

    def _of_row(self, number: int, t_s: float, row: Row, words: list[str]) -> Iterator[Record]:
        odometry, truth = self._vector(ODOMETRY, row, words), self._vector(TRUTH, row, words)
        if odometry is not None:
            yield OdometryPose(t_s, odometry)
        elif any(role in self.roles for role in MOTION):
            yield Motion(t_s, np.array([self._value(role, row, words) for role in MOTION]))
        if truth is not None:
            yield TruthPose(t_s, truth)
        readings = self._readings(row, words)
        if readings:
            yield Readings(t_s, readings)
        picture = self._picture(number, t_s, row, words)
        if picture is not None:
            yield picture

    def _picture(self, number: int, t_s: float, row: Row, words: list[str]) -> Picture | None:
        if "image" in self.roles:
            name = self._word("image", row, words)
            if not name:
                return None
            return Picture(t_s, partial(read_picture, self.root_of(name), name, self.outside), name)
        if self.frames is None:
            return None
        if "frame" in self.roles:
            number = int(number_of(self.table, row, self._word("frame", row, words), "frame"))
        if isinstance(self.frames, Frames):
            name = f"{self.frames.path.name}, frame {number}"
            return Picture(t_s, partial(self.frames.read, number), name)
        if not 0 <= number < len(self.frames):
            fault = f"found no picture {number}, there are {len(self.frames)} in {self.path}"
            raise InputError(self.table, fault, row.number)
        file = self.frames[number]
        return Picture(t_s, partial(read_picture, file.parent, file.name), file.name)

    def _readings(self, row: Row, words: list[str]) -> dict[str, float]:
        roles = [role for role in self.roles if role.startswith(READING) and self._word(role, row, words)]
        return {role.removeprefix(READING): self._value(role, row, words) for role in roles}

    def _vector(self, group: tuple[str, ...], row: Row, words: list[str]) -> F64 | None:
        turned = [role for role in QUATERNIONS[group] if role in self.roles]
        roles = [*group[:2], *(turned or group[2:])]
        if not all(role in self.roles for role in roles):
            return None
        if not any(self._word(role, row, words) for role in roles):
            return None
        values = np.array([self._value(role, row, words) for role in roles])
        if not turned:
            return values
        try:
            return planar(values[:2], rotation(values[2:]), "x")
        except ValueError as problem:
            raise InputError(self.table, str(problem), row.number) from None

    def _value(self, role: str, row: Row, words: list[str]) -> float:
        column = self.roles.get(role)
        if column is None:
            return 0.0
        word = self._number(role, row, words)
        return number_of(self.table, row, word, f"{column.name}", 1e9) * factor(role, column)

    def _number(self, role: str, row: Row, words: list[str]) -> str:
        """Return a word that is a number; where no comma separates, it may have a decimal comma."""
        word = self._word(role, row, words)
        return word if self.head.separator == "," else word.replace(",", ".")

    def _word(self, role: str, row: Row, words: list[str]) -> str:
        at = self.roles[role].at
        if at >= len(words):
            raise InputError(self.table, f"found {len(words)} values, expected at least {at + 1}", row.number)
        return words[at].strip()

    def _time(self, number: int, row: Row, words: list[str]) -> float:
        if not self.has_times:
            return number * PERIOD_S
        word = self._number("time", row, words)
        number_of(self.table, row, word, "time", MOST_T_S * PER_SECOND[self._unit])
        return seconds(word, self._unit)

    @cached_property
    def _unit(self) -> str:
        named = self.unit or self.roles["time"].unit
        if named in PER_SECOND:
            return str(named)
        first = [self._number("time", row, words) for row, words in islice(self._rows(), LOOKED_AT)]
        return detect_unit([word for word in first if is_number(word)] or ["0"])

    def _rows(self) -> Iterator[tuple[Row, list[str]]]:
        for row in rows(self.table):
            if row.number <= self.head.lines or row.text.startswith("#"):
                continue
            words = split(row.text, self.head.separator)
            if not words or any(word.strip() for word in words):  # without any it is broken, not empty
                yield row, words


def open_table(path: Path, options: Reading) -> TableRecording:
    """Open a table, or a folder or video with `options.table` or its one table. InputError as `roles_of`."""
    table = options.table or _table_of(path)
    if table is None or not table.is_file():
        raise InputError(table or path, "found no table (CSV); name one with --reading table=...")
    head = head_of(rows(table))
    if head is None:
        raise InputError(table, "found an empty file, expected a table")
    roles = roles_of(table, head.names, options.columns)
    if not roles:
        fault = f"found columns {show(', '.join(head.names))}, none of a known name"
        if not head.named:
            fault = f"found no names of columns, and {len(head.names)} columns; they are called 1, 2, 3 ..."
        raise InputError(table, f"{fault}; say what they are with --reading columns=...", head.lines or None)
    frames = _frames(path, "image" in roles)
    info = SessionInfo(table.stem if table == path else path.resolve().stem)
    unit, outside = options.time_unit, options.pictures_outside
    return TableRecording(path, info, table, roles, head, frames, unit, outside).check()


def looks_like_table(path: Path) -> bool:
    """Recognize a table by the names of its columns: a file's, or those of the one table in a folder."""
    table = _table_of(path)
    lines = [] if table is None else begin_lines(table)
    head = head_of(Row(number, line) for number, line in enumerate(lines, 1) if line.strip())
    if table is None or head is None:
        return False
    try:
        roles = roles_of(table, head.names, {})
    except InputError:
        return True  # columns without a unit: open_table says so
    return bool(set(roles) - {"time", "frame"})


def _table_of(path: Path) -> Path | None:
    try:
        if path.is_dir():
            tables = [file for file in path.iterdir() if file.suffix.lower() in TABLES]
            return tables[0] if len(tables) == 1 else None
        return path if path.is_file() and path.suffix.lower() not in VIDEOS else None
    except OSError:
        return None


def _is_file(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:  # no file can have such a name
        return False


def _frames(path: Path, named: bool) -> Sequence[Path] | Frames | None:
    if named:
        return None
    if path.is_dir():
        videos = [file for file in path.iterdir() if file.suffix.lower() in VIDEOS]
        return pictures_in(path) or (Frames(videos[0]) if len(videos) == 1 else None)
    return Frames(path) if path.suffix.lower() in VIDEOS else None


@dataclass(frozen=True, eq=False)
class FolderRecording:
    """Pictures in the order of their names, a second apart."""

    path: Path
    info: SessionInfo

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the pictures."""
        notes.warning("no table: one picture per second is assumed; see --reading table=...")
        tables = [file.name for file in self.path.iterdir() if file.suffix.lower() in TABLES]
        if tables:
            why = "no table, or several, with known columns in UTF-8; see --reading table=..., columns=..."
            notes.warning(f"{', '.join(sorted(tables))} beside them is not used: {why}")
        for number, file in enumerate(pictures_in(self.path)):
            yield Picture(number * PERIOD_S, partial(read_picture, file.parent, file.name), file.name)


def open_folder(path: Path, options: Reading) -> TableRecording | FolderRecording:
    """Open a folder of pictures, with `options.table` when there is one. Raises InputError if it has none."""
    if options.table is not None:
        return open_table(path, options)
    if not path.is_dir() or not pictures_in(path):
        raise InputError(path, f"found no pictures ({', '.join(PICTURES)}), expected a folder of them")
    return FolderRecording(path, SessionInfo(path.resolve().name))


def looks_like_pictures(path: Path) -> bool:
    """Recognize a folder by a picture in it."""
    try:
        return path.is_dir() and any(file.suffix.lower() in PICTURES for file in path.iterdir())
    except OSError:
        return False


FORMATS = (
    Format(
        "table",
        "a CSV table of pictures with poses or odometry",
        looks_like_table,
        open_table,
        takes_unit=True,
        readings=True,
    ),
    Format(
        "pictures",
        "a folder of pictures, in the order of their names",
        looks_like_pictures,
        open_folder,
        bare=True,
    ),
)
