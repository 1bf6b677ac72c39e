"""Kinds of values: arrays, with the letters used for axes in every docstring, and who hears of progress.

N particles or other poses, L library entries, R references (entries, then virtual ones), P places,
C channels, D descriptor length, M motions in one frame, T steps in time, K matches or marks in a
picture, J modes of a proposal, H x W picture rows and columns, n some of what the text names. A pose is
(x_m, y_m, heading_rad), heading counter-clockwise from +x.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I16 = NDArray[np.int16]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]
U64 = NDArray[np.uint64]
Bool = NDArray[np.bool_]

Progress = Callable[[int, int], None]  # done, of how many
NamedProgress = Callable[[int, int, str], None]  # and what is being made

ONE_THREAD_ELEMENTS = 8192  # elements up to which every BLAS computes a scalar product on one thread


def dot(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the scalar product of two vectors (N,), the same to the last bit for any number of threads.

    A BLAS splits long vectors among its threads, and the order of the sum decides the last bit.
    """
    if len(a) <= ONE_THREAD_ELEMENTS:
        return float(a @ b)
    parts = (slice(k, k + ONE_THREAD_ELEMENTS) for k in range(0, len(a), ONE_THREAD_ELEMENTS))
    return float(sum(a[part] @ b[part] for part in parts))


KEPT_BYTES = 8 << 20


def keep_freed_memory() -> None:
    """Let the process keep the memory of arrays of up to 8 MB that were freed, for those that follow.

    Of glibc, which gives arrays of more than 128 kB back at once until a larger one was freed; then it keeps
    up to twice as much. Fetched anew page by page, they took a third of the time of a picture's likelihood.
    """
    np.empty(KEPT_BYTES, np.uint8)
