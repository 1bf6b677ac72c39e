"""Reading chunks whose messages overlap in time, as few at once as that needs."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Chunk = TypeVar("Chunk")
One = TypeVar("One")


def merged(
    chunks: Iterable[tuple[int, Chunk]],
    read: Callable[[Chunk], Iterable[One]],
    time_ns: Callable[[One], int],
) -> Iterator[One]:
    """Give the messages of chunks by their times; ties keep the order of writing.

    `chunks` come with the time of their first message, and in that order.
    """
    waiting: list[tuple[int, int, One]] = []
    number = 0
    for start_ns, chunk in chunks:
        while waiting and waiting[0][0] < start_ns:
            yield heapq.heappop(waiting)[2]
        for message in read(chunk):
            number += 1
            heapq.heappush(waiting, (time_ns(message), number, message))
    while waiting:
        yield heapq.heappop(waiting)[2]
