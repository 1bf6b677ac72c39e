"""A saved run as one table, a row an update: CSV for spreadsheets, Parquet for programs."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]  # has no types
import pyarrow.parquet as pq  # type: ignore[import-untyped]  # has no types

from maurice_mcl.typing import U8

from .export_steps import ExportStep, filling
from .run_store_rows import steps_schema

LEFT_OUT = ("picture_sha256", "motions", "best_entries", "best_quality", "events", "session_events")
TEXTS = ("events", "session_events")  # lists in a saved run; one text here
GROUP_ROWS = 2000  # of a Parquet file are written at once; no more are held


def table_columns(channels: Sequence[str]) -> dict[str, type]:
    """Give names and Python types of the columns, for a run with these channels."""
    kinds = {pl.Int32: int, pl.Float64: float, pl.String: str}
    kept = {name: kinds[kind] for name, kind in steps_schema(channels).items() if name not in LEFT_OUT}
    odometry = {f"odometry_{name}": float for name in ("x_m", "y_m", "heading_rad")}
    return kept | odometry | dict.fromkeys(TEXTS, str)


def table_row(step: ExportStep) -> dict[str, Any]:
    """Give one row, by the names of `table_columns`; None where a value is not known."""
    row = dict(step.rows.step) | {"time_s": step.time_s}
    odometry = zip(("x_m", "y_m", "heading_rad"), step.odometry.tolist(), strict=True)
    row |= {f"odometry_{name}": value for name, value in odometry}
    return row | {name: "; ".join(row[name]) for name in TEXTS}


class CsvSink:
    """Writes a row an update."""

    def __init__(self, writer: csv.DictWriter[str]) -> None:
        self._writer = writer

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write one update."""
        self._writer.writerow(table_row(step))


@contextmanager
def csv_sink(file: Path, channels: Sequence[str], *, force: bool = False) -> Iterator[CsvSink]:
    """Open a CSV file (RFC 4180, UTF-8, a header line). LogError as for `filling`."""
    with filling(file, force=force) as part, part.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(
            out, list(table_columns(channels)), extrasaction="ignore", lineterminator="\n"
        )
        writer.writeheader()
        yield CsvSink(writer)


class ParquetSink:
    """Writes groups of rows, so that memory holds no more than one."""

    def __init__(self, writer: Any, schema: Any) -> None:
        self._writer, self._schema = writer, schema
        self._rows: list[dict[str, Any]] = []

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Take in one update."""
        row = table_row(step)
        self._rows.append({name: row[name] for name in self._schema.names})
        if len(self._rows) >= GROUP_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting."""
        if self._rows:
            self._writer.write_table(pa.Table.from_pylist(self._rows, self._schema))
        self._rows = []


@contextmanager
def parquet_sink(file: Path, channels: Sequence[str], *, force: bool = False) -> Iterator[ParquetSink]:
    """Open a Parquet file. LogError as for `filling`."""
    kinds = {int: pa.int32(), float: pa.float64(), str: pa.string()}
    schema = pa.schema([(name, kinds[kind]) for name, kind in table_columns(channels).items()])
    with filling(file, force=force) as part, pq.ParquetWriter(part, schema, compression="zstd") as writer:
        sink = ParquetSink(writer, schema)
        yield sink
        sink.flush()
