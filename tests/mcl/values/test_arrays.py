"""Scalar products do not depend on the number of threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from maurice_mcl.values.arrays import ONE_THREAD_ELEMENTS, dot

PRINT = """
import numpy as np
from maurice_mcl.values.arrays import dot
from maurice_mcl.values.geometry import circular_mean
rng = np.random.default_rng(1)
for n in (100, 8192, 8193, 60_000, 500_000):
    a, b = rng.random(n), rng.normal(size=n)
    print(repr(dot(a, b)), repr(dot(a, b > 0)), *map(repr, circular_mean(b.astype(np.float32), a)))
"""


@pytest.mark.parametrize(
    "n", [0, 1, ONE_THREAD_ELEMENTS, ONE_THREAD_ELEMENTS + 1, 3 * ONE_THREAD_ELEMENTS + 5]
)
def test_it_is_the_sum_of_products(n):
    rng = np.random.default_rng(n)
    a, b = rng.random(n), rng.normal(size=n)
    assert dot(a, b) == pytest.approx(float((a * b).sum()), rel=1e-12, abs=1e-12)
    assert dot(a, b > 0) == pytest.approx(float(a[b > 0].sum()), rel=1e-12, abs=1e-12)


def test_one_and_two_threads_give_the_same_bits():
    said = set()
    for threads in ("1", "2"):
        limits = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), threads)
        done = subprocess.run(
            [sys.executable, "-c", PRINT], env=os.environ | limits, capture_output=True, text=True, check=True
        )
        said.add(done.stdout)
    assert len(said) == 1
