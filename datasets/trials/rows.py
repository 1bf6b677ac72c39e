"""The rows of trials on disk: Parquet files that grow while runs are made, and outlive a kill at any moment.

A folder holds `plan.json`, what was asked for, and `rows/`, files of some hundred rows each. The last
of them is written anew, beside it and then in its place, whenever rows arrive: a row that was counted as done
is on disk.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import le
from pathlib import Path
from typing import Any

import polars as pl

from maurice_loaders.errors import InputError
from maurice_loaders.files.paths import TRIALS
from maurice_loaders.files.text import read_json
from maurice_loaders.files.writing import remove_leftovers, write_whole
from maurice_loaders.formats.registry import unlike

from .plan import Plan

MANIFEST, ROWS = "plan.json", "rows"
MOST = 200  # rows a file, from which the next one is begun: the last is written anew for each job
FORMAT = 1
_TEXT, _WHOLE, _NUMBER, _FLAG, _LIST = pl.String, pl.Int64, pl.Float64, pl.Boolean, pl.List(pl.Float32)
SCHEMA: Mapping[str, tuple[Any, str]] = {
    "part": (_TEXT, "the experiment of the plan"),
    "session": (_TEXT, "what was driven, by its label in the plan"),
    "variant": (_WHOLE, "number of the filter within the part, from 0"),
    "label": (_TEXT, "the filter in words"),
    "seed": (_WHOLE, "number of the run: its drive, and the filter's seed"),
    "settings": (_TEXT, "what this variant sets, as JSON"),
    "task": (_TEXT, "tracking, global or kidnapped; null for a recorded session"),
    "tier": (_TEXT, "nominal, dim or hard; null for a recorded session"),
    "lights": (_TEXT, "changes of light; null for a recorded session"),
    "preset": (_TEXT, "preset, where the plan names one"),
    "feature": (_TEXT, "feature, where the plan names one"),
    "particles": (_WHOLE, "number of particles"),
    "configuration": (_TEXT, "hash of every setting of the filter"),
    "version": (_TEXT, "of maurice-replay"),
    "numpy": (_TEXT, "version of numpy"),
    "host": (_TEXT, "name of the machine"),
    "error": (_TEXT, "why the run failed to run; all below are then null"),
    "arena": (_WHOLE, "seed of the simulated arena"),
    "oracle_m": (_NUMBER, "distance of the nearest reference from the truth, mean"),
    "updates": (_WHOLE, "pictures processed"),
    "distance_m": (_NUMBER, "driven, by the truth where it is known"),
    "error_mean_m": (_NUMBER, "position error, mean over updates 4 to the last"),
    "error_median_m": (_NUMBER, "the same, median"),
    "error_final_m": (_NUMBER, "position error at the last update"),
    "heading_error_mean_rad": (_NUMBER, "heading error, mean"),
    "heading_error_median_rad": (_NUMBER, "heading error, median"),
    "relative_error_m": (_NUMBER, "relative pose error, median"),
    "lost": (_FLAG, "whether it was ever lost"),
    "lost_at_update": (_WHOLE, "when"),
    "before_loss_m": (_NUMBER, "driven before it was lost, or at all"),
    "reached": (_FLAG, "whether it drove 1000 in without being lost"),
    "kidnapped_at_update": (_WHOLE, "first update after a kidnapping"),
    "pictures_to_localize": (_WHOLE, "since the start or the kidnapping, this picture included; null: never"),
    "localized_m": (_NUMBER, "driven by then"),
    "localized_s": (_NUMBER, "robot time by then"),
    "pictures_after": (_WHOLE, "pictures since then: where a run without is censored; null without truth"),
    "after_m": (_NUMBER, "driven since then: where `localized_m` of a run without is censored"),
    "after_s": (_NUMBER, "robot time since then: where `localized_s` of a run without is censored"),
    "right_at_end": (_FLAG, "correct in at least 7 of the last 10 updates"),
    "wrong_confident": (_NUMBER, "share of updates converged on a wrong place"),
    "succeeded_tenth": (
        _FLAG,
        "the thesis's success, since a kidnapping: deviation under 10 % of the arena",
    ),
    "succeeded_circle": (_FLAG, "the same: 90 % within 6 in"),
    "confidence_end": (_NUMBER, "share of weight near the estimate, at the last update"),
    "sd_end_m": (_NUMBER, "standard deviation of the cloud, at the last update"),
    "ess_share": (_NUMBER, "effective sample size over the number of particles, mean"),
    "reseeded": (_WHOLE, "updates with fresh particles"),
    "failure": (_TEXT, "of a run that failed, its cause as `diagnose` names it"),
    "took_s": (_NUMBER, "in the filter; of runs stepped together, an equal share; differs from run to run"),
    "error_m": (_LIST, "position error at every update"),
    "sd_m": (_LIST, "standard deviation of the cloud at every update"),
    "confidence": (_LIST, "share of weight near the estimate at every update"),
    "right_m": (_NUMBER, "position error up to which an update is correct"),
    "true_x_m": (_LIST, "true position at every update; NaN where it is not known"),
    "true_y_m": (_LIST, "the same"),
    "truth_rank": (_LIST, "rank of the reference nearest the truth among all, from 1; NaN: not known"),
    "heading_error_rad": (_LIST, "heading error at every update"),
    "mapped": (_LIST, "share of a scan's beams from the true pose that end in mapped space, at every update"),
}
OLDER = {  # names in rows of 0.2.0 and before, which all hold "off_m"
    "error_mean_m": "error_m",
    "error_final_m": "final_error_m",
    "heading_error_mean_rad": "heading_error_rad",
    "error_m": "off_m",
    "heading_error_rad": "off_rad",
}
TYPES = {name: kind for name, (kind, _) in SCHEMA.items()}
KEY = ("part", "session", "variant", "seed")
MEASURED = ("took_s", "host")  # what may differ between two computations of the same run
Key = tuple[str, str, int, int]


@dataclass(slots=True)
class RowStore:
    """The rows in a folder. One process writes; any number may read."""

    folder: Path
    done: set[Key] = field(default_factory=set)
    failed: int = 0
    error: str | None = None  # of the first that failed
    _open: pl.DataFrame = field(default_factory=lambda: pl.DataFrame(schema=TYPES))  # the file that grows
    _number: int = 0

    @classmethod
    def begin(cls, folder: Path, plan: Plan, *, resume: bool) -> RowStore:
        """Start a new folder, or go on in one of the same plan. InputError for any other."""
        file = folder / MANIFEST
        remove_leftovers(file)  # of one that was killed as it began
        if not resume and file.exists():
            raise InputError(folder, "holds trials; --resume goes on with them, or choose another folder")
        if file.exists():
            new = not _is_as_held(file, plan)
        elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(folder, "found something else, expected a new folder or one with trials")
        else:
            new = True
        folder.mkdir(parents=True, exist_ok=True)
        if new:
            manifest = {"format": FORMAT, "hash": plan.hash, "plan": plan.to_json()}
            write_whole(file, json.dumps(manifest, indent=1).encode(), force=True)
        (folder / ROWS).mkdir(exist_ok=True)  # after the plan, without which nobody knows whose it is
        store = cls(folder)
        store._read()
        return store

    def _read(self) -> None:
        files = self.files()
        for target in files[-1:]:  # the only one that was being written
            remove_leftovers(target)
        for file in files:
            rows = _frame(file, [*KEY, "error"])
            valid_rows = rows.filter(pl.col("error").is_null())  # a run that failed is tried again
            self.done |= set(valid_rows.select(KEY).iter_rows())
        self._number = max((int(file.stem) for file in files), default=-1) + 1

    def files(self) -> list[Path]:
        """Return the files of rows, in order."""
        return _files(self.folder)

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Append rows; they are on disk when this returns."""
        if not rows:
            return
        new = pl.DataFrame([{name: row.get(name) for name in SCHEMA} for row in rows], schema=TYPES)
        self._open = pl.concat([self._open, new])
        target = self.folder / ROWS / f"{self._number:06}.parquet"
        filled = io.BytesIO()
        self._open.write_parquet(filled, compression="zstd")
        write_whole(target, filled.getvalue(), force=True)
        self.done |= {(row["part"], row["session"], row["variant"], row["seed"]) for row in rows}
        errors = [str(row["error"]) for row in rows if row.get("error") is not None]
        self.failed += len(errors)
        self.error = self.error or next(iter(errors), None)
        if len(self._open) >= MOST:
            self._open, self._number = self._open.clear(), self._number + 1


def _is_as_held(file: Path, plan: Plan) -> bool:
    """Return whether a folder's plan is this one; False: this one has more seeds. InputError for others."""
    manifest = _manifest(file)
    if manifest["hash"] == plan.hash:
        return True
    before, after = manifest["plan"], plan.to_json()
    if _seedless(before) == _seedless(after) and all(map(le, _seeds(before), _seeds(after))):
        return False
    name = manifest["plan"].get("name", "?")
    what = f"found trials of the plan {name} as it was then, and {plan.name} differs in more than more seeds"
    raise InputError(file, f"{what}; choose another folder")


def _seeds(plan: Mapping[str, Any]) -> list[int]:
    return [part["seeds"] for part in plan["parts"]]


def _seedless(plan: Mapping[str, Any]) -> dict[str, Any]:
    return {**plan, "parts": [{**part, "seeds": 0} for part in plan["parts"]]}


def read_rows(folder: Path, columns: Iterable[str] | None = None) -> pl.DataFrame:
    """Return all rows of a folder, sorted by part, session, variant and seed; a run counts once.

    A run that failed and was made again is the later one. InputError for a folder without trials.
    """
    expect_trials(folder)
    files = _files(folder)
    names = list(dict.fromkeys([*KEY, *(columns or SCHEMA)]))
    frames = [_frame(file, names) for file in files]
    rows = pl.concat(frames) if frames else pl.DataFrame(schema={name: TYPES[name] for name in names})
    return rows.unique(KEY, keep="last", maintain_order=True).sort(KEY)


def is_trials(folder: Path) -> bool:
    """Return whether a folder is one that `maurice-replay trials run` has made."""
    return (folder / MANIFEST).is_file()


def expect_trials(folder: Path) -> None:
    """Refuse what is no such folder. InputError."""
    if not is_trials(folder):
        raise unlike(folder, TRIALS)


def read_plan_of(folder: Path) -> dict[str, Any]:
    """Return the plan of a folder, as plain values."""
    plan: dict[str, Any] = _manifest(folder / MANIFEST)["plan"]
    return plan


def _manifest(file: Path) -> dict[str, Any]:
    """Return what the file says of the folder: its format, and the plan with its hash."""
    try:
        manifest = read_json(file.read_bytes())
        if not isinstance(manifest["hash"], str) or not isinstance(manifest["plan"]["parts"], list):
            raise TypeError
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(
            file, "cannot be read, expected the plan of the trials; restore it, or choose another folder"
        ) from None
    return dict(manifest)


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in (folder / ROWS).glob("*.parquet") if file.stem.isdecimal())


def _frame(file: Path, columns: Sequence[str]) -> pl.DataFrame:
    """Read columns of a file of rows; InputError for one that is damaged, or is none of ours."""
    try:
        names = OLDER if "off_m" in pl.read_parquet_schema(file) else {}
        rows = pl.read_parquet(file, columns=[names.get(name, name) for name in columns])
        rows = rows.select(pl.col(names.get(name, name)).alias(name) for name in columns)
        what = next(
            (f"found {name} as {kind}" for name, kind in rows.schema.items() if kind != TYPES[name]), ""
        )
    except (OSError, pl.exceptions.PolarsError) as problem:
        what = str(problem).splitlines()[0]
    if what:
        raise InputError(file, f"cannot be read: {what}; delete it, and --resume makes its runs again")
    return rows
