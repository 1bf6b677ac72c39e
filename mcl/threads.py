"""How many threads an operation of numpy and OpenCV uses: one, where the user does not say otherwise.

Reading, comparing, filtering and drawing already run side by side, and their operations are small: on two
cores a second thread of the libraries made them slower. Results do not depend on it.
"""

from __future__ import annotations

import os

THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)


def bound_threads() -> None:
    """Set each variable that is not set to one thread; the libraries read them when they are imported."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
