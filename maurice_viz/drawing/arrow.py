"""Rows of a recording as ready-made Arrow arrays.

Rerun's own conversion of values takes longer than all else about a small row. What these functions return is
what Rerun would have made, and it takes it unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import rerun as rr
from numpy.typing import ArrayLike
from rerun.components import TensorDataBatch

from maurice_mcl.arrays import F32

_POINT = pa.field("item", pa.float32(), nullable=False)
_PAIR = pa.list_(_POINT, 2)
_STRIPS = pa.list_(pa.field("item", _PAIR, nullable=False))
_BLOB = pa.list_(pa.field("item", pa.uint8(), nullable=False))


@dataclass(frozen=True, slots=True)
class ReadyComponent:
    """One component of a row."""

    descriptor: Any
    values: Any

    def component_descriptor(self) -> Any:
        """Say which component."""
        return self.descriptor

    def as_arrow_array(self) -> Any:
        """Return the values as they are stored."""
        return self.values


Row = list[Any]  # of ready components; Rerun annotates what it logs with a class of its own


def row_of(archetype: type, **values: Any) -> Row:
    """Return a row to log: fields of an archetype, each as one of the functions below returns it."""
    return [ReadyComponent(_descriptor(archetype, name), ready) for name, ready in values.items()]


@cache
def _descriptor(archetype: Any, field: str) -> Any:
    return getattr(archetype, f"descriptor_{field}")()


def floats_of(values: ArrayLike) -> Any:
    """Return numbers (K,) in single precision: radii."""
    return _plain(pa.float32(), np.ascontiguousarray(values, np.float32))


def ui_points_of(radii: ArrayLike) -> Any:
    """Return radii (K,) in points of the screen, which Rerun writes as negative numbers."""
    return floats_of(-np.asarray(radii, np.float32))


def doubles_of(values: ArrayLike) -> Any:
    """Return numbers (K,), or one, in double precision."""
    return _plain(pa.float64(), np.atleast_1d(np.ascontiguousarray(values, np.float64)))


def scalars(values: ArrayLike) -> Row:
    """Return a row for the lines of a plot: numbers (K,), or one."""
    return row_of(rr.Scalars, scalars=doubles_of(values))


def colors_of(packed: ArrayLike) -> Any:
    """Return packed colors (K,) 0xRRGGBBAA."""
    return _plain(pa.uint32(), np.ascontiguousarray(packed, np.uint32))


def texts_of(texts: Sequence[str]) -> Any:
    """Return texts (K,): labels."""
    return pa.array(texts, pa.string())


def text_of(text: str) -> Any:
    """Return a text."""
    return pa.array([text], pa.utf8())


def points_of(places: ArrayLike) -> Any:
    """Return places or vectors (K, 2)."""
    flat = np.ascontiguousarray(places, np.float32).ravel()
    inner = _plain(pa.float32(), flat)
    return pa.Array.from_buffers(_PAIR, len(flat) // 2, [None], children=[inner])


def strips_of(lines: Sequence[F32] | F32) -> Any:
    """Return lines (M, K, 2), or M lines (K_i, 2)."""
    points = np.concatenate(lines) if len(lines) else np.zeros((0, 2), np.float32)
    ends = np.cumsum([0, *map(len, lines)], dtype=np.int32)
    return pa.Array.from_buffers(
        _STRIPS, len(lines), [None, pa.py_buffer(ends)], children=[points_of(points)]
    )


def blob_of(data: bytes) -> Any:
    """Return the content of a file, such as an encoded picture."""
    inner = pa.Array.from_buffers(pa.uint8(), len(data), [None, pa.py_buffer(data)])
    ends = pa.py_buffer(np.array([0, len(data)], np.int32))
    return pa.Array.from_buffers(_BLOB, 1, [None, ends], children=[inner])


def _plain(kind: Any, values: Any) -> Any:
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(values)])


KIND = "F32"  # the union's name for float32


@lru_cache(maxsize=16)
def _mold(length: int) -> tuple[Any, list[Any], int]:
    """Let Rerun build a tensor of this length once: return it, its kinds of numbers, and which is float32."""
    tensor = TensorDataBatch(np.zeros(length, np.float32)).as_arrow_array()
    union = tensor.field(2)
    names = [union.type.field(k).name for k in range(union.type.num_fields)]
    return tensor, [union.field(k) for k in range(len(names))], names.index(KIND)


def tensor_of(values: F32) -> Any:
    """Return a vector (D,): the heights of a bar chart. All but the numbers is built once a length."""
    tensor, kinds, at = _mold(len(values))
    numbers = _plain(pa.float32(), np.ascontiguousarray(values, np.float32))
    hole = kinds[at]
    filled = pa.Array.from_buffers(hole.type, 1, hole.buffers()[:2], children=[numbers])
    shape, names, buffer = (tensor.field(k) for k in range(3))
    children = [*kinds[:at], filled, *kinds[at + 1 :]]
    union = pa.Array.from_buffers(buffer.type, 1, buffer.buffers()[:3], children=children)
    return pa.Array.from_buffers(tensor.type, 1, [None], children=[shape, names, union])
