"""Putting records in order that were written nearly so: each as soon as nothing earlier can come."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator

from .bag_parts import Timed
from .recording import Picture

WINDOW_S = 1.0  # a message recorded later than another was measured at most so much earlier
MOST_WAITING = 5000  # records held back ...
MOST_PICTURES = 32  # ... and pictures among them, which are large


def in_order(records: Iterable[Timed], late: Callable[[Timed], None]) -> Iterator[Timed]:
    """Give records by their times; those that come too late for that go to `late` instead."""
    waiting: list[tuple[float, int, Timed]] = []
    newest_s = given_s = float("-inf")
    number = pictures = 0
    for record in records:
        if record.t_s < given_s:
            late(record)
            continue
        number += 1
        pictures += isinstance(record, Picture)
        heapq.heappush(waiting, (record.t_s, number, record))
        newest_s = max(newest_s, record.t_s)
        while waiting and (
            waiting[0][0] < newest_s - WINDOW_S or len(waiting) > MOST_WAITING or pictures > MOST_PICTURES
        ):
            given_s, _, first = heapq.heappop(waiting)
            pictures -= isinstance(first, Picture)
            yield first
    while waiting:
        yield heapq.heappop(waiting)[2]
