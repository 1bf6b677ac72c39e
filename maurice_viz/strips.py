"""Line strips as Arrow data: Rerun's own conversion goes through every strip by itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types, and comes with rerun-sdk

from maurice_mcl.typing import F32

_POINT = pa.field("item", pa.float32(), nullable=False)
_STRIP = pa.field("item", pa.list_(_POINT, 2), nullable=False)


def strips_of(lines: Sequence[F32] | F32) -> Any:
    """Give lines (M, K, 2), or M lines (K_i, 2), as what `LineStrips2D.from_fields` takes as it is."""
    points = np.concatenate(lines) if len(lines) else np.zeros((0, 2), np.float32)
    ends = np.cumsum([0, *(len(line) for line in lines)], dtype=np.int32)
    numbers = pa.array(np.ascontiguousarray(points, np.float32).ravel())
    pairs = pa.FixedSizeListArray.from_arrays(numbers, type=pa.list_(_POINT, 2))
    return pa.ListArray.from_arrays(pa.array(ends), pairs, type=pa.list_(_STRIP))
