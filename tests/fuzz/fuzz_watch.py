"""Watching one input: how long it takes, and how much memory."""

from __future__ import annotations

import resource
import signal
import sys
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

MOST_CPU_S = 5.0  # of one input; each takes a few thousandths
MOST_S = 60.0  # by the clock, for what waits instead of working
MOST_PEAK = 64 * 2**20  # bytes of Python's and numpy's memory for one input of at most 200 kB
MOST_MORE = 4 * 2**30  # address space that the process may take in addition


class TookTooLong(BaseException):
    """Not an Exception, so that nobody on the way catches it."""


def _too_long(number: int, frame: FrameType | None) -> None:
    raise TookTooLong(f"more than {MOST_CPU_S:g} s of work, or {MOST_S:g} s of waiting, for one input")


@contextmanager
def in_time(cpu_s: float = MOST_CPU_S, clock_s: float = MOST_S) -> Iterator[None]:
    """Raise TookTooLong in what takes too long."""
    before = [signal.signal(number, _too_long) for number in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    signal.setitimer(signal.ITIMER_REAL, clock_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGPROF, before[0])
        signal.signal(signal.SIGALRM, before[1])


@contextmanager
def in_memory(most: int = MOST_PEAK) -> Iterator[None]:
    """AssertionError for what takes too much memory at any time; needs `tracemalloc` to be on."""
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    yield
    taken = tracemalloc.get_traced_memory()[1] - before
    assert taken <= most, f"{taken // 2**20} MiB were taken for one input"


@contextmanager
def limited_memory() -> Iterator[None]:
    """Make the whole process fail with MemoryError before it harms the machine; on Linux only.

    The limit is taken back afterwards: processes that are started later, as a browser, would have it too.
    """
    if sys.platform != "linux":
        yield
        return
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (now + MOST_MORE, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def resident() -> int:
    """Give the bytes of memory that the process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def peak() -> int:
    """Give the most that it ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
