"""A Rerun recording written in blocks: what is logged update by update goes out as columns of many updates.

Every call of the SDK costs as much as a dozen rows do. A file that nobody follows can wait, so rows are
collected by entity and sent as columns. What is read back is the same: the same rows, and of rows at one time
the later one still wins.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import rerun as rr

from ..drawing.arrow import ReadyComponent, Values, joined, ready
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

    times: dict[str, list[Any]]
    columns: dict[Any, list[Any]] = field(default_factory=dict)  # by descriptor; None: not in that row
    count: int = 0
    size: int = 0  # bytes
    seen: set[tuple[str, Any]] = field(default_factory=set)  # timelines and times of all rows

    def add(self, times: Mapping[str, Any], components: Mapping[Any, Values]) -> None:
        """Append a row."""
        for name, value in times.items():
            self.times[name].append(value)
        self.seen.update(times.items())
        for descriptor, values in components.items():
            column = self.columns.get(descriptor)
            if column is None:
                column = self.columns[descriptor] = []
            if len(column) < self.count:
                column.extend([None] * (self.count - len(column)))
            column.append(values)
            self.size += values.size
        self.count += 1

    def filled(self) -> Iterator[tuple[Any, list[Any]]]:
        """Yield every column with its descriptor, as long as there are rows."""
        for descriptor, column in self.columns.items():
            yield descriptor, column + [None] * (self.count - len(column))


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
        self._rows: dict[str, dict[Timelines, Rows]] = {}  # by entity
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
        self._times[timeline], self._kinds[timeline] = at, kind

    def disable_timeline(self, timeline: str) -> None:
        """Leave a timeline out of what is logged from now on."""
        self._times.pop(timeline, None)

    def log(self, entity_path: Any, entity: Any, *extra: Any, static: bool = False, **how: Any) -> None:
        """Log as any recording does. What is static, or clears an entity, goes out at once.

        What is static is seen at all times, whenever it is logged, and so no block ends for it.
        """
        if type(entity) is rr.Clear:
            self.send_rows()
        if static or not self._times or type(entity) is rr.Clear:
            self._log_now(entity_path, entity, *extra, static=static, **how)
            return
        components: dict[Any, Values] = {}
        for part in (entity, *extra):
            for descriptor, values in _components_of(part):
                components[descriptor] = values
                self._bytes += values.size
        self._rows_of(str(entity_path)).add(self._times, components)

    def _rows_of(self, entity: str) -> Rows:
        """Return where rows at this time go; rows at this time on other timelines go out before them."""
        timelines, blocks = tuple(sorted(self._times)), self._rows.setdefault(entity, {})
        if len(blocks) > 1 or timelines not in blocks:
            others = [rows for other, rows in blocks.items() if other != timelines]
            if not all(rows.seen.isdisjoint(self._times.items()) for rows in others):
                self._send_entity(entity)
        if timelines not in blocks:
            blocks[timelines] = Rows({name: [] for name in timelines})
        return blocks[timelines]

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
        for entity in list(self._rows):
            sent += self._send_entity(entity)
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

    def _send_entity(self, entity: str) -> int:
        """Send the rows of an entity; return their bytes."""
        size = 0
        for rows in self._rows[entity].values():
            times = [self._time_column(name, tuple(at)) for name, at in rows.times.items()]
            columns: list[Any] = [ComponentLists(*column) for column in rows.filled()]
            self.send_columns(entity, times, columns)
            size += rows.size
        self._rows[entity].clear()
        return size

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


def _components_of(part: Any) -> Iterator[tuple[Any, Values]]:
    """Yield descriptor and values of each component of what is logged: a ready row, or what Rerun takes."""
    for batch in part.as_component_batches() if hasattr(part, "as_component_batches") else part:
        if type(batch) is ReadyComponent:
            yield batch.descriptor, batch.values
        else:
            yield batch.component_descriptor(), ready(batch.as_arrow_array())
