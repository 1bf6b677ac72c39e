"""Text files that name pictures and when they were taken, and reading the pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path

from maurice_mcl.arrays import U8

from ..errors import InputError, PictureError
from ..io.fields import MOST_T_S, show
from ..io.notes import ReadingNotes
from ..io.pictures import decode_picture
from ..recording import Picture
from ..session_log.reader import MAX_PICTURE_BYTES
from ..transforms.clocks import PER_SECOND, TimeSpan, detect_unit, seconds
from ._tables import Row, is_number, names_columns, number_of, rows, words_of
from .cmucam import BEGIN, decode_frame

LOOKED_AT = 200  # rows from which the unit of the times is told


@dataclass(frozen=True, eq=False)
class PictureList:
    """A table of times and file names; nothing is read before it is asked for."""

    file: Path
    root: Path  # the folder that names start from
    column: int | None = None  # of the file names; None: all that follows the first column
    unit: str | None = None  # of the times, which stand in the column before; None: told from them

    def pictures(self, notes: ReadingNotes) -> Iterator[Picture]:
        """Yield the pictures in file order, not opened; broken rows and falling times are problems."""
        last_t_s = -float("inf")
        for row in self._rows():
            try:
                picture = self._picture(row)
                if picture.t_s < last_t_s:
                    found = f"found t {picture.t_s:.15g} after t {last_t_s:.15g}"
                    raise InputError(self.file, f"{found}, expected time not to fall", row.number)
            except InputError as problem:
                notes.problem(problem)
                continue
            last_t_s = picture.t_s
            yield picture

    @cached_property
    def span(self) -> TimeSpan:
        """First and last time of the rows that can be read."""
        span = TimeSpan()
        for picture in self.pictures(ReadingNotes(keep_going=True)):
            span.add(picture.t_s)
        return span

    @cached_property
    def _unit(self) -> str:
        words = [word for row in islice(self._rows(), LOOKED_AT) for word in self._words(row)[:1]]
        return self.unit or detect_unit([word for word in words if is_number(word)] or ["0"])

    def _rows(self) -> Iterator[Row]:
        for number, row in enumerate(rows(self.file)):
            if not row.text.startswith("#") and (number or not names_columns(row.text)):
                yield row

    def _words(self, row: Row) -> list[str]:
        """Return time and name."""
        if self.column is None:
            return words_of(row.text, 1)
        return words_of(row.text)[self.column - 1 : self.column + 1]

    def _picture(self, row: Row) -> Picture:
        words = self._words(row)
        if len(words) < 2 or not words[1]:
            raise InputError(
                self.file, f"found {show(row.text)}, expected a time and a file name", row.number
            )
        number_of(self.file, row, words[0], "time", MOST_T_S * PER_SECOND[self._unit])
        name = words[1]
        return Picture(seconds(words[0], self._unit), partial(read_picture, self.root / name, name), name)


def read_picture(file: Path, name: str) -> U8:
    """Read a picture's file, or a CMUcam's frame. PictureError when it is not there or not whole."""
    try:
        if not file.is_file():
            raise PictureError(f"found no such picture ({name}), expected a file in {file.parent}")
        if file.stat().st_size > MAX_PICTURE_BYTES:
            raise PictureError(f"found a picture of more than {MAX_PICTURE_BYTES // 2**20} MiB")
        data = file.read_bytes()
        return decode_frame(data) if data.startswith(BEGIN) else decode_picture(data, deep=True)
    except (OSError, ValueError) as problem:
        if isinstance(problem, PictureError):
            raise
        raise PictureError(f"cannot be read: {problem}") from None
