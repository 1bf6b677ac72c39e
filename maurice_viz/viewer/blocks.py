"""A Rerun recording written in blocks: what is logged update by update goes out as columns of many updates.

Every call of the SDK costs as much as a dozen rows do. A file that nobody follows can wait, so rows are
collected by entity and sent as columns. What is read back is the same: the same rows, and of rows at one time
the later one still wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from itertools import chain, count
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import rerun as rr

from ..drawing.arrow import LogRow, Values, joined, ready
from ..entities import STEP

Timelines = tuple[str, ...]
UPDATES_A_BLOCK = (
    100  # in a block; every block of an entity costs the writer some 8 kB of memory until the end
)
BYTES_A_BLOCK = 16 << 20  # in a block: pictures may be large
BYTES_AT_ONCE = 1 << 19  # bytes given to the writer, which holds them several times, before it is waited for
FILE_BATCH_S = 1.0  # of what is not in blocks
GIVEN_UP_S = 1.0  # to wait after a block, once a disk has not taken one


@dataclass(slots=True)
class Rows:
    """The rows of one entity on one set of timelines: every column as long as there are rows, or shorter."""

    timelines: Timelines
    ats: list[tuple[Any, ...]] = field(default_factory=list)  # a number that rises, and a time on each
    columns: dict[Any, list[Values | None]] = field(default_factory=dict)  # by descriptor; None: not there
    size: int = 0  # bytes, about

    def add(self, at: tuple[Any, ...], row: LogRow) -> None:
        """Append a row."""
        count = len(self.ats)
        self.ats.append(at)
        for descriptor, values in row.items():
            column = self.columns.get(descriptor)
            if column is None:
                column = self.columns[descriptor] = []
            if len(column) < count:
                column.extend([None] * (count - len(column)))
            column.append(values)
            self.size += values.size

    def filled(self) -> list[Any]:
        """Return every column, as long as there are rows."""
        count = len(self.ats)
        for column in self.columns.values():
            column.extend([None] * (count - len(column)))
        return [ComponentLists(*column) for column in self.columns.items()]

    def times(self) -> list[tuple[str, tuple[Any, ...]]]:
        """Return every timeline with the times of all rows."""
        return list(zip(self.timelines, list(zip(*self.ats, strict=True))[1:], strict=True))

    def single(self, number: int) -> Rows:
        """Return one of the rows."""
        columns = {descriptor: column[number : number + 1] for descriptor, column in self.columns.items()}
        present = {descriptor: column for descriptor, column in columns.items() if any(column)}
        return Rows(self.timelines, [self.ats[number]], present)


def in_order(blocks: list[Rows]) -> list[Rows]:
    """Return rows of an entity so that of two at one time the later one is later, also on other timelines."""
    seen: dict[str, set[Any]] = {}
    for timeline, times in chain.from_iterable(rows.times() for rows in blocks[1:] and blocks):
        others = seen.setdefault(timeline, set())
        if not others.isdisjoint(times):
            break
        others.update(times)
    else:
        return blocks
    alone = [rows.single(number) for rows in blocks for number in range(len(rows.ats))]
    return sorted(alone, key=lambda rows: rows.ats[0][0])


@dataclass(frozen=True, slots=True)
class ComponentLists:
    """A column of one component, as `send_columns` takes it."""

    descriptor: Any
    values: Sequence[Values | None]  # a row each; None where the row has none

    def component_descriptor(self) -> Any:
        """Say which component."""
        return self.descriptor

    def as_arrow_array(self) -> Any:
        """Return lists, one per row; null where the component is not in the row."""
        present, gaps = [values for values in self.values if values is not None], None
        if len(present) < len(self.values):
            validity = np.packbits([values is not None for values in self.values], bitorder="little")
            gaps = pa.py_buffer(validity)
        lengths = [0 if values is None else values.length for values in self.values]
        ends, inner = pa.py_buffer(np.cumsum([0, *lengths], dtype=np.int32)), joined(present)
        return pa.Array.from_buffers(pa.list_(inner.type), len(lengths), [gaps, ends], children=[inner])


class BlockRecording(rr.RecordingStream):
    """A recording into a file that nobody follows."""

    def __init__(self, application: str, *, patience_s: float) -> None:
        """Open a recording that goes nowhere yet. After each block it waits for the disk, at most so long."""
        batches = rr.ChunkBatcherConfig()
        batches.flush_tick = timedelta(seconds=FILE_BATCH_S)
        super().__init__(application, batcher_config=batches)
        self._patience_s = patience_s
        self._times: dict[str, Any] = {}  # by timeline
        self._kinds: dict[str, str] = {}  # of number, by timeline
        self._rows: dict[Timelines, dict[str, Rows]] = {}  # by entity
        self._now: tuple[dict[str, Rows], Timelines, tuple[Any, ...]] | None = None  # None: the time changed
        self._numbers = count()
        self._columns: dict[tuple[str, tuple[Any, ...]], rr.TimeColumn] = {}  # of this block
        self._step: Any = None
        self._updates = self._bytes = 0

    def set_time(self, timeline: str, **value: Any) -> None:
        """Set the time of what is logged from now on; a new step ends a block that is full."""
        ((kind, at),) = value.items()
        if timeline == STEP and self._step != at:
            self._step = at
            self._updates += 1
            if self._updates > UPDATES_A_BLOCK or self._bytes > BYTES_A_BLOCK:
                self.send_rows()
        self._times[timeline], self._kinds[timeline], self._now = at, kind, None

    def disable_timeline(self, timeline: str) -> None:
        """Leave a timeline out of what is logged from now on."""
        self._times.pop(timeline, None)
        self._now = None

    def log(self, entity_path: Any, entity: Any, *extra: Any, static: bool = False, **how: Any) -> None:
        """Log as any recording does. What is static, and seen at all times, goes out at once."""
        if static or not self._times:
            self._log_now(entity_path, entity, *extra, static=static, **how)
            return
        blocks, timelines, at = self._now or self._begin()
        rows = blocks.get(str(entity_path))
        if rows is None:
            rows = blocks[str(entity_path)] = Rows(timelines)
        before = rows.size
        rows.add(at, _row_of(entity, extra))
        self._bytes += rows.size - before

    def _begin(self) -> tuple[dict[str, Rows], Timelines, tuple[Any, ...]]:
        """Return where rows at the present time go."""
        timelines = tuple(sorted(self._times))
        at = next(self._numbers), *(self._times[timeline] for timeline in timelines)
        self._now = self._rows.setdefault(timelines, {}), timelines, at
        return self._now

    def _log_now(self, entity_path: Any, entity: Any, *extra: Any, **how: Any) -> None:
        super().reset_time()
        for timeline, at in self._times.items():
            super().set_time(timeline, **{self._kinds[timeline]: at})
        super().log(entity_path, entity, *extra, **how)

    def send_rows(self) -> None:
        """Send all rows that wait, and let the disk catch up."""
        if not self._rows:
            return
        sent = 0
        for entity in dict.fromkeys(chain.from_iterable(self._rows.values())):
            for rows in in_order([blocks[entity] for blocks in self._rows.values() if entity in blocks]):
                times = [self._time_column(timeline, at) for timeline, at in rows.times()]
                self.send_columns(entity, times, rows.filled())
                sent += rows.size
            if sent > BYTES_AT_ONCE:
                self._wait_for_the_disk()
                sent = 0
        self._rows.clear()
        self._columns.clear()
        self._now, self._updates, self._bytes = None, 0, 0
        self._wait_for_the_disk()

    def _wait_for_the_disk(self) -> None:
        try:
            super().flush(timeout_sec=self._patience_s)
        except (RuntimeError, OSError, ValueError):  # reported at the end, with all that could be written
            self._patience_s = min(self._patience_s, GIVEN_UP_S)

    def _time_column(self, timeline: str, at: tuple[Any, ...]) -> rr.TimeColumn:
        """Return when rows are; most entities of a block have theirs at the same times."""
        column = self._columns.get((timeline, at))
        if column is None:
            column = rr.TimeColumn(timeline, **{self._kinds[timeline]: at})
            self._columns[timeline, at] = column
        return column

    def flush(self, *, timeout_sec: float = 1e38) -> None:
        """Write all that was logged."""
        self.send_rows()
        super().flush(timeout_sec=timeout_sec)

    def disconnect(self) -> None:
        """Write all that was logged, and close the file."""
        self.send_rows()
        super().disconnect()


def _row_of(entity: Any, extra: Sequence[Any]) -> LogRow:
    """Return the components of what is logged: ready rows, or what Rerun takes."""
    if type(entity) is LogRow and not extra:
        return entity
    row = LogRow()
    for part in (entity, *extra):
        if type(part) is LogRow:
            row |= part
        else:
            batches = part.as_component_batches() if hasattr(part, "as_component_batches") else part
            row |= {batch.component_descriptor(): ready(batch.as_arrow_array()) for batch in batches}
    return row
