"""A Rerun recording written in blocks: what is logged update by update goes out as columns of many updates.

Every call of the SDK costs as much as a dozen rows do. A file that nobody follows can wait, so rows are
collected by entity and sent as columns. What is read back is the same: the same rows, and of rows at one time
the later one still wins.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
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


@dataclass(frozen=True, slots=True, eq=False)
class RowTime:
    """When rows are."""

    timelines: Timelines
    times: Mapping[str, Any]  # by timeline


@dataclass(slots=True)
class Rows:
    """Rows of one entity, in the order in which they were logged."""

    ats: list[RowTime] = field(default_factory=list)
    rows: list[LogRow] = field(default_factory=list)

    def add(self, at: RowTime, row: LogRow) -> None:
        """Append a row."""
        self.ats.append(at)
        self.rows.append(row)

    def together(self) -> list[Rows]:
        """Return those on the same timelines together, or each alone where some are at the same time."""
        if len({at.timelines for at in self.ats}) == 1:
            return [self]
        blocks: dict[Timelines, Rows] = {}
        for at, row in zip(self.ats, self.rows, strict=True):
            blocks.setdefault(at.timelines, Rows()).add(at, row)
        times = [{place for at in block.ats for place in at.times.items()} for block in blocks.values()]
        if sum(map(len, times)) == len(set().union(*times)):
            return list(blocks.values())
        return [Rows([at], [row]) for at, row in zip(self.ats, self.rows, strict=True)]

    def times(self, timeline: str) -> tuple[Any, ...]:
        """Return where the rows are on one of their timelines."""
        return tuple([at.times[timeline] for at in self.ats])

    def columns(self) -> list[Any]:
        """Return every component as a column."""
        descriptors = dict.fromkeys(descriptor for row in self.rows for descriptor in row)
        return [ComponentLists(kind, [row.get(kind) for row in self.rows]) for kind in descriptors]

    @property
    def size(self) -> int:
        """Their bytes, about."""
        return sum([values.size for row in self.rows for values in row.values()])


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
        present = [values for values in self.values if values is not None]
        lengths = [0 if values is None else values.length for values in self.values]
        ends, inner = pa.py_buffer(np.cumsum([0, *lengths], dtype=np.int32)), joined(present)
        gaps = len(present) < len(lengths)
        there = np.packbits([values is not None for values in self.values], bitorder="little")
        buffers = [pa.py_buffer(there) if gaps else None, ends]
        return pa.Array.from_buffers(pa.list_(inner.type), len(lengths), buffers, children=[inner])


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
        self._at: RowTime | None = None  # of what is logged now; None: it was changed
        self._rows: defaultdict[str, Rows] = defaultdict(Rows)  # by entity
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
        self._times[timeline], self._kinds[timeline], self._at = at, kind, None

    def disable_timeline(self, timeline: str) -> None:
        """Leave a timeline out of what is logged from now on."""
        self._times.pop(timeline, None)
        self._at = None

    def log(self, entity_path: Any, entity: Any, *extra: Any, static: bool = False, **how: Any) -> None:
        """Log as any recording does. What is static, or clears an entity, goes out at once.

        What is static is seen at all times, whenever it is logged, and so no block ends for it.
        """
        if type(entity) is rr.Clear:
            self.send_rows()
        if static or not self._times or type(entity) is rr.Clear:
            self._log_now(entity_path, entity, *extra, static=static, **how)
            return
        row = _row_of(entity, extra)
        for values in row.values():
            self._bytes += values.size
        if self._at is None:
            self._at = RowTime(tuple(sorted(self._times)), self._times.copy())
        self._rows[str(entity_path)].add(self._at, row)

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
        for entity, rows in self._rows.items():
            for block in rows.together():
                timelines = block.ats[0].timelines
                times = [self._time_column(timeline, block.times(timeline)) for timeline in timelines]
                self.send_columns(entity, times, block.columns())
            sent += rows.size
            if sent > BYTES_AT_ONCE:
                self._wait_for_the_disk()
                sent = 0
        self._rows.clear()
        self._columns.clear()
        self._updates = self._bytes = 0
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
