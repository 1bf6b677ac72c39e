"""The truth at each picture's time, from truth records before and after it, looking ahead at most 1 s."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

import numpy as np

from maurice_mcl.arrays import F64

from .records import EventRecord, PictureRecord, Record, TruthRecord

MAX_GAP_S = 1.0  # truth records further apart say nothing about the time between them
MAX_WAITING = 10_000  # records held back while the next truth is awaited, whatever the clock does

Answered = tuple[Record, F64 | None]


def with_truth(records: Iterable[Record]) -> Iterator[Answered]:
    """Yield every record in order, and beside each picture the truth at its time, (3,) or None.

    A truth record at the same time counts as it stands; otherwise the pose is interpolated between two
    truth records at most 1 s apart, the heading the short way round, and never across a kidnapping.
    """
    before: TruthRecord | None = None
    waiting: deque[Record] = deque()  # begins with a picture, when there is anything in it
    for record in records:
        if isinstance(record, TruthRecord):
            yield from _answer(waiting, before, record)
            before = record
        elif waiting and (_in_vain(waiting, before, record) or is_kidnapping(record)):
            yield from _answer(waiting, before, None)
        if is_kidnapping(record):
            before = None
        if isinstance(record, PictureRecord) and before is not None and before.t_s == record.t_s:
            yield record, before.pose
        elif waiting or isinstance(record, PictureRecord):
            waiting.append(record)
        else:
            yield record, None
    yield from _answer(waiting, before, None)


def truth_between(before: TruthRecord | None, after: TruthRecord, t_s: float) -> F64 | None:
    """Return the pose (3,) at a time between two truth records, or None when they are over 1 s apart."""
    if after.t_s == t_s:
        return after.pose
    if before is None or after.t_s - before.t_s > MAX_GAP_S + 1e-9:  # decimal seconds are not exact
        return None
    step = after.pose - before.pose
    step[2] = _short_way(step[2])
    pose = before.pose + step * ((t_s - before.t_s) / (after.t_s - before.t_s))
    pose[2] = _short_way(pose[2])
    return pose


def is_kidnapping(record: Record) -> bool:
    """Return whether a record tells that the robot was carried away."""
    return isinstance(record, EventRecord) and record.text.startswith("kidnapped")


def _answer(
    waiting: deque[Record], before: TruthRecord | None, after: TruthRecord | None
) -> Iterator[Answered]:
    """Empty the queue, giving its pictures their truth."""
    while waiting:
        record = waiting.popleft()
        known = after is not None and isinstance(record, PictureRecord)
        yield record, truth_between(before, after, record.t_s) if known and after is not None else None


def _in_vain(waiting: deque[Record], before: TruthRecord | None, record: Record) -> bool:
    """Return whether no truth from this record on can tell anything about the pictures that wait."""
    first_s = waiting[0].t_s
    until_s = first_s if before is None else max(first_s, before.t_s + MAX_GAP_S + 1e-9)
    return record.t_s > until_s or len(waiting) >= MAX_WAITING


def _short_way(angle_rad: float) -> float:
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)
