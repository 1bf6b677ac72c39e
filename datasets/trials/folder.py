"""A folder of trials: its rows, and the run behind a row, made again or as commands that show it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import polars as pl

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import toml_value
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.values import Arena

from .drives import FIRST, Drive, arena_of, filter_for, open_drive
from .plan import SPECIAL, SessionSpec, Variant, Variants
from .rows import read_plan_of
from .table import load_trials

Row = dict[str, Any]
SIMULATED = ("world", "tier", "updates", "kidnap_at", "slip_at", "lights", "moved", "people")
SURVEYED = ("spacing_in", "headings", "camera")  # no options of `simulate`: only their defaults can be shown
_USUAL = {field.name: field.default for field in fields(SessionSpec)}


class MissingRuns(InputError):
    """The folder does not hold what is asked for; the text says which plan makes it."""


@dataclass(frozen=True)
class TrialsFolder:
    """A folder that `trials run` has made.

    >>> from maurice_datasets.trials.folder import TrialsFolder
    >>> TrialsFolder(Path("trials")).rows["error_mean_m"].max()  # doctest: +SKIP
    1.63
    """

    folder: Path

    @cached_property
    def rows(self) -> pl.DataFrame:
        """All rows that did not fail."""
        return load_trials(self.folder).filter(pl.col("error").is_null())

    @cached_property
    def parts(self) -> list[dict[str, Any]]:
        """The parts of the folder's plan, in order, as plain values."""
        parts: list[dict[str, Any]] = read_plan_of(self.folder)["parts"]
        return parts

    def part(self, name: str, **wanted: Any) -> pl.DataFrame:
        """Return the rows of a part in which columns have some values; MissingRuns where there are none."""
        rows = self.rows.filter(pl.col("part") == name)
        for column, value in wanted.items():
            rows = rows.filter(pl.col(column) == value) if column in rows.columns else rows.clear()
        if rows.is_empty():
            condition = " and ".join(f"{column} {value}" for column, value in wanted.items())
            what = f"holds no runs of {name}{f' with {condition}' if condition else ''}"
            raise MissingRuns(self.folder, f"{what}; maurice-replay trials run {name} makes them")
        return rows

    def drive_of(self, row: Row) -> Drive:
        """Return the drive of the run behind a row."""
        return _drive(self.spec_of(row), row["seed"])

    def arena_of(self, row: Row) -> Arena:
        """Return the map of the run behind a row."""
        return arena_of(self.spec_of(row), row["seed"])

    def localizer_of(self, row: Row) -> Localizer:
        """Return the filter of the run behind a row."""
        return filter_for(self.drive_of(row), self.settings_of(row), row["seed"])

    def spec_of(self, row: Row) -> SessionSpec:
        """Return the session that a row is of."""
        sessions = self._part_of(row)["sessions"]
        values = next(session for session in sessions if session["label"] == row["session"])
        if other := [key for key in values if key not in _USUAL]:
            what = f"its plan is of another version, with {other[0]!r}: its runs cannot be made again"
            raise MissingRuns(self.folder, f"{what}; make the trials anew to see one")
        return SessionSpec(**values)

    def settings_of(self, row: Row) -> dict[str, Any]:
        """Return all that the variant of a row sets."""
        variants = self._part_of(row)["variants"]
        listed = tuple(Variant(variant["label"], variant["settings"]) for variant in variants["listed"])
        return dict(Variants(variants["settings"], variants["grid"], listed)[row["variant"]].settings)

    def _part_of(self, row: Row) -> dict[str, Any]:
        for part in self.parts:
            if part["name"] == row["part"] and any(row["session"] == s["label"] for s in part["sessions"]):
                return part
        raise MissingRuns(self.folder, f"holds no session {row['session']!r} of a part {row['part']!r}")

    def commands_of(self, row: Row) -> str | None:
        """Return the commands that show the run behind a row: its drive simulated, and its filter on it.

        The replay has the row's error to the last bit. None: no command has words for this drive or filter.
        """
        spec, settings, seed = self.spec_of(row), self.settings_of(row), row["seed"]
        unusual = any(getattr(spec, name) != _USUAL[name] for name in SURVEYED)
        if "control" in settings or unusual or spec.is_cut:
            return None
        replay = ["maurice-replay", spec.path or f"drive-{seed}"]
        replay += ["--library", spec.library] if spec.library else []
        replay += spec.read_as.words
        if "sensor.weights" in settings:
            settings.pop("feature", None)  # an option that would replace them
        for key, value in settings.items():
            text = value if isinstance(value, str) else toml_value(value)
            replay += [f"--{key}", text] if key in SPECIAL else ["--set", f"{key}={text}"]
        replay += ["--seed", str(seed), *(["--start", "global"] if spec.start else [])]
        if spec.path:
            return shlex.join(replay)
        arena = FIRST + seed % spec.arenas
        simulate = ["maurice-replay", "simulate", spec.task]
        simulate += ["--arena-seed", str(arena), "--seed", str(FIRST + seed)]
        for name in SIMULATED:
            if getattr(spec, name) != _USUAL[name]:
                simulate += [f"--{name.replace('_', '-')}", str(getattr(spec, name))]
        simulate += ["--lossless", "-o", f"drive-{seed}"]
        return f"{shlex.join(simulate)} && {shlex.join(replay)}"


@lru_cache(2)
def _drive(spec: SessionSpec, seed: int) -> Drive:
    """Return a drive; the last two are kept, because their pictures take longer to render than to use."""
    return open_drive(spec, seed)
