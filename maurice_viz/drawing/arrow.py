"""Rows of a recording as ready-made Arrow arrays.

Rerun's own conversion of values takes longer than all else about a small row. What these functions return is
what Rerun would have made, and it takes it unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import rerun as rr
from numpy.typing import ArrayLike

from maurice_mcl.values import F32

_POINT = pa.field("item", pa.float32(), nullable=False)
_PAIR = pa.list_(_POINT, 2)
_TRIPLE = pa.list_(_POINT, 3)
_STRIPS = pa.list_(pa.field("item", _PAIR, nullable=False))
_SPACE_STRIPS = pa.list_(pa.field("item", _TRIPLE, nullable=False))
_BLOB = pa.list_(pa.field("item", pa.uint8(), nullable=False))


Maker = Callable[[Sequence[Any]], Any]  # of an Arrow array, from what one or several rows hold


@dataclass(slots=True)
class Values:
    """The values of one component in one row. An Arrow array is made late: of many rows at once."""

    make: Maker
    raw: Any  # what `make` takes a list of
    length: int  # of the Arrow array
    size: int  # in bytes, about

    def arrow(self) -> Any:
        """Return the Arrow array."""
        return self.make([self.raw])


def joined(rows: Sequence[Values]) -> Any:
    """Return the Arrow array of the values of one component in several rows, one after the other."""
    make = rows[0].make
    if all(row.make is make for row in rows):
        return make([row.raw for row in rows])
    return pa.concat_arrays([row.arrow() for row in rows])


def ready(values: Any) -> Values:
    """Return an Arrow array as values."""
    return Values(_concat, values, len(values), values.get_total_buffer_size())


def _concat(arrays: Sequence[Any]) -> Any:
    return pa.concat_arrays(arrays)


@dataclass(frozen=True, slots=True)
class ReadyComponent:
    """One component of a row, as Rerun takes it."""

    descriptor: Any
    values: Values

    def component_descriptor(self) -> Any:
        """Say which component."""
        return self.descriptor

    def as_arrow_array(self) -> Any:
        """Return the values as they are stored."""
        return self.values.arrow()


class LogRow(dict[Any, Values]):
    """A row to log: values by the descriptor of their component."""

    def as_component_batches(self) -> list[Any]:
        """Return the components for a recording that is written call by call."""
        return [ReadyComponent(*item) for item in self.items()]


def row_of(archetype: type, **values: Values) -> LogRow:
    """Return a row to log: fields of an archetype, each as one of the functions below returns it."""
    return LogRow({_descriptor(archetype, name): ready for name, ready in values.items()})


@cache
def _descriptor(archetype: Any, field: str) -> Any:
    return getattr(archetype, f"descriptor_{field}")()


def floats_of(values: ArrayLike) -> Values:
    """Return numbers (K,) in single precision: radii."""
    return _numbers(_floats, np.ascontiguousarray(values, np.float32))


def ui_points_of(radii: ArrayLike) -> Values:
    """Return radii (K,) in points of the screen, which Rerun writes as negative numbers."""
    return floats_of(-np.asarray(radii, np.float32))


def doubles_of(values: ArrayLike) -> Values:
    """Return numbers (K,), or one, in double precision."""
    return _numbers(_doubles, np.atleast_1d(np.ascontiguousarray(values, np.float64)))


def scalars(values: ArrayLike) -> LogRow:
    """Return a row for the lines of a plot: numbers (K,), or one."""
    return row_of(rr.Scalars, scalars=doubles_of(values))


def colors_of(packed: ArrayLike) -> Values:
    """Return packed colors (K,) 0xRRGGBBAA."""
    return _numbers(_colors, np.ascontiguousarray(packed, np.uint32))


def texts_of(texts: Sequence[str]) -> Values:
    """Return texts (K,): labels."""
    return Values(_texts, texts, len(texts), sum(map(len, texts)))


def text_of(text: str) -> Values:
    """Return a text."""
    return texts_of([text])


def points_of(places: ArrayLike) -> Values:
    """Return places or vectors (K, 2)."""
    flat = np.ascontiguousarray(places, np.float32).ravel()
    return Values(_points, flat, len(flat) // 2, flat.nbytes)


def places_of(place: ArrayLike) -> Values:
    """Return a place or size (3,) in space, a part of a transform; or places (K, 3)."""
    flat = np.ascontiguousarray(place, np.float32).ravel()
    return Values(_places, flat, len(flat) // 3, flat.nbytes)


def strips_of(lines: Sequence[F32] | F32) -> Values:
    """Return lines (M, K, 2), or M lines (K_i, 2)."""
    points = np.concatenate(lines) if len(lines) else np.zeros((0, 2), np.float32)
    lengths = [len(line) for line in lines]
    return Values(_strips, (np.ascontiguousarray(points, np.float32), lengths), len(lengths), points.nbytes)


def space_strips_of(lines: F32) -> Values:
    """Return lines in space (M, K, 3)."""
    flat = np.ascontiguousarray(lines, np.float32).ravel()
    return Values(_space_strips, (flat, [lines.shape[1]] * len(lines)), len(lines), flat.nbytes)


def blob_of(data: bytes) -> Values:
    """Return the content of a file, such as an encoded picture."""
    return Values(_blobs, data, 1, len(data))


def _numbers(make: Maker, values: Any) -> Values:
    return Values(make, values, len(values), values.nbytes)


def _plain(kind: Any, values: Sequence[Any]) -> Any:
    flat = values[0] if len(values) == 1 else np.concatenate(values)
    return pa.Array.from_buffers(kind, len(flat), [None, pa.py_buffer(flat)])


def _floats(rows: Sequence[Any]) -> Any:
    return _plain(pa.float32(), rows)


def _doubles(rows: Sequence[Any]) -> Any:
    return _plain(pa.float64(), rows)


def _colors(rows: Sequence[Any]) -> Any:
    return _plain(pa.uint32(), rows)


def _texts(rows: Sequence[Sequence[str]]) -> Any:
    return pa.array([text for texts in rows for text in texts], pa.utf8())


def _points(rows: Sequence[Any]) -> Any:
    inner = _floats(rows)
    return pa.Array.from_buffers(_PAIR, len(inner) // 2, [None], children=[inner])


def _places(rows: Sequence[Any]) -> Any:
    inner = _floats(rows)
    return pa.Array.from_buffers(_TRIPLE, len(inner) // 3, [None], children=[inner])


def _strips(rows: Sequence[tuple[F32, list[int]]]) -> Any:
    return _lines(_STRIPS, rows, _points([points.ravel() for points, _ in rows]))


def _space_strips(rows: Sequence[tuple[F32, list[int]]]) -> Any:
    return _lines(_SPACE_STRIPS, rows, _places([points for points, _ in rows]))


def _lines(kind: Any, rows: Sequence[tuple[F32, list[int]]], points: Any) -> Any:
    lengths = [length for _, lengths in rows for length in lengths]
    return pa.Array.from_buffers(kind, len(lengths), [None, _ends(lengths)], children=[points])


def _blobs(rows: Sequence[bytes]) -> Any:
    data = rows[0] if len(rows) == 1 else b"".join(rows)
    inner = pa.Array.from_buffers(pa.uint8(), len(data), [None, pa.py_buffer(data)])
    ends = _ends([len(blob) for blob in rows])
    return pa.Array.from_buffers(_BLOB, len(rows), [None, ends], children=[inner])


def _ends(lengths: Sequence[int]) -> Any:
    return pa.py_buffer(np.cumsum([0, *lengths], dtype=np.int32))
