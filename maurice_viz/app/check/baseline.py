"""The baseline of a check: the runs of an earlier one, seed by seed, as a Parquet file."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_loaders.errors import InputError
from maurice_mcl.scoring.demands import RunTrack

FLAGS = ("localized", "lost", "converged")
SCHEMA: Mapping[str, Any] = {
    "session": pl.String,
    "seed": pl.Int64,
    "configuration": pl.String,
    "version": pl.String,
    "off_m": pl.List(pl.Float64),
    **dict.fromkeys(FLAGS, pl.List(pl.Boolean)),
}


@dataclass(frozen=True, slots=True, eq=False)
class DriveRuns:
    """All runs over one drive."""

    session: str  # its name
    configuration: str  # hash of the filter's settings
    tracks: tuple[RunTrack, ...]  # one a seed


@dataclass(frozen=True, slots=True, eq=False)
class BaselineRuns:
    """The runs of an earlier check, by session and seed."""

    file: Path
    tracks: Mapping[str, Mapping[int, RunTrack]]
    configurations: Mapping[str, str]  # hash of the filter's settings, by session

    def of(self, session: str, updates: int) -> Mapping[int, RunTrack]:
        """Return the runs of a drive by seed. InputError where there are none, or of another drive."""
        tracks = self.tracks.get(session)
        if tracks is None:
            names = ", ".join(map(repr, self.tracks))
            raise InputError(
                self.file, f"found runs of {names}, and none of {session!r}; save a baseline of it"
            )
        lengths = {len(track.off_m) for track in tracks.values()}
        if lengths != {updates}:
            was = ", ".join(map(str, sorted(lengths)))
            what = f"found runs of {session!r} with {was} steps, and it has {updates} now"
            raise InputError(self.file, f"{what}: another drive; save a new baseline")
        return tracks


def baseline_bytes(drives: Iterable[DriveRuns]) -> bytes:
    """Return the runs of a check as a Parquet file."""
    rows = [
        {
            "session": drive.session,
            "seed": track.seed,
            "configuration": drive.configuration,
            "version": version("maurice-replay"),
            "off_m": track.off_m.tolist(),
            **{name: getattr(track, name).tolist() for name in FLAGS},
        }
        for drive in drives
        for track in drive.tracks
    ]
    content = io.BytesIO()
    pl.DataFrame(rows, schema=dict(SCHEMA)).write_parquet(content, compression="zstd")
    return content.getvalue()


def read_baseline(file: Path) -> BaselineRuns:
    """Read what `baseline_bytes` made. InputError for anything else."""
    if not file.is_file():
        raise InputError(file, "there is no such file; make one with `check -o FILE.parquet`")
    expected = "expected a baseline that `check -o FILE.parquet` has written"
    try:
        rows = pl.read_parquet(file)
    except (OSError, pl.exceptions.PolarsError) as problem:
        raise InputError(file, f"cannot be read ({str(problem).splitlines()[0]}); {expected}") from None
    if dict(rows.schema) != dict(SCHEMA):
        raise InputError(file, f"found the columns {', '.join(rows.columns)}; {expected}")
    if not len(rows) or any(rows[name].null_count() for name in SCHEMA):
        raise InputError(file, f"found {'empty values' if len(rows) else 'no run'}; {expected}")
    tracks: dict[str, dict[int, RunTrack]] = {}
    configurations: dict[str, str] = {}
    for row in rows.iter_rows(named=True):
        off_m = np.array([np.nan if value is None else value for value in row["off_m"]], np.float64)
        flags = [np.array(row[name], bool) for name in FLAGS]
        if {len(flag) for flag in flags} != {len(off_m)}:
            raise InputError(
                file, f"found a run of {row['session']!r} whose columns differ in length; {expected}"
            )
        tracks.setdefault(row["session"], {})[row["seed"]] = RunTrack(row["seed"], off_m, *flags)
        configurations[row["session"]] = row["configuration"]
    return BaselineRuns(file, tracks, configurations)
