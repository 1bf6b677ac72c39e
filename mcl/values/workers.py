"""Calls made side by side on all cores, as numpy and OpenCV let other threads run."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 4  # items a core that are taken before their results are asked for


def on_all_cores(call: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Yield the result of each item, in order. Items are taken by the caller's thread, a few ahead."""
    cores, source = os.cpu_count() or 1, iter(items)
    pool = ThreadPoolExecutor(cores)
    try:
        waiting = deque(pool.submit(call, item) for item in islice(source, AHEAD * cores))
        while waiting:
            yield waiting.popleft().result()
            waiting.extend(pool.submit(call, item) for item in islice(source, 1))
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C nobody waits for the others
