"""Benchmarks: `python -m benchmarks`; see README.md."""

from __future__ import annotations

import maurice_mcl  # noqa: F401  # first: it bounds the threads of numpy and OpenCV
