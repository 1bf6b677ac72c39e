"""What the columns of a saved run may hold; every value is checked where a part of the run is read."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import polars as pl

from maurice_mcl.values import AVERAGES, LIBRARY, PICTURE

from ..errors import InputError
from ..files.text import MOST, MOST_T_S, show, up_to
from .writer import BEST, PARTS, TABLES, TOOK, StepRows, steps_schema

SLACK = 1e-3  # tolerance of shares and sums of weights: processors round differently
COMPARED = PICTURE, AVERAGES, LIBRARY
SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class Rule:
    """What one value of a column may be."""

    holds: Callable[[Any], Any]  # whether a value is allowed
    expected: str


def _from(low: float, high: float, expected: str, also: float = math.nan) -> Rule:
    """Return a rule for a number, or for an array of them."""

    def holds(value: Any) -> Any:
        return value is not None and (low <= value) & (value <= high) | (value == also)

    return Rule(holds, expected)


def _or_none(rule: Rule) -> Rule:
    return Rule(lambda value: value is None or rule.holds(value), rule.expected)


def _list_of(holds: Callable[[Any], bool], expected: str, most: float = math.inf) -> Rule:
    return Rule(lambda value: value is not None and len(value) <= most and all(map(holds, value)), expected)


def _is_number(value: Any) -> bool:
    return value is not None and abs(value) <= MOST


def _is_motion(value: Any) -> bool:
    return value is not None and len(value) == 3 and all(map(_is_number, value))


FINITE = _from(-MOST, MOST, f"a finite number, {up_to()}")
NATS = _from(-MOST, MOST, f"{up_to()}, or -inf", -math.inf)
LOG_WEIGHT = _from(-MOST, SLACK, "the logarithm of a weight up to 1", -math.inf)
SHARE = _from(0, 1 + SLACK, "a share from 0 to 1")
SPREAD = _from(0, MOST, f"{up_to()}, not negative")
UNKNOWN = Rule(lambda value: value is not None and math.isnan(value), "NaN: it is not known")
TEXT = Rule(lambda value: value is not None, "a text")
TEXTS = _list_of(TEXT.holds, "a list of texts")
BY_COLUMN = {
    "time_s": _from(-2 * MOST_T_S, 2 * MOST_T_S, f"a finite time, {up_to(2 * MOST_T_S)}"),
    "picture": TEXT,
    "picture_sha256": Rule(lambda value: bool(SHA256.fullmatch(value or "")), "64 hexadecimal digits"),
    "motions": _list_of(_is_motion, "lists of three finite numbers"),
    "effective_sample_size": _from(1 - SLACK, MOST, "a number of particles from 1"),
    "log_evidence": NATS,
    "calibrated_evidence": NATS,
    "events": TEXTS,
    "session_events": TEXTS,
    "best_entries": _list_of(lambda k: k is not None and k >= 0, f"at most {BEST} numbers of entries", BEST),
    "best_quality": _list_of(_is_number, f"at most {BEST} finite numbers", BEST),
    "recovery_compared": Rule(lambda v: v in (None, *COMPARED), " or ".join(COMPARED)),
    **dict.fromkeys(("recovery_threshold", "recovery_found"), _or_none(NATS)),
    **dict.fromkeys(("library_evidence_mean", "library_evidence_best"), _or_none(NATS)),
    **dict.fromkeys(("not_lost", "not_lost_alarm"), _or_none(SHARE)),
    "particles": _from(1, 2**31, "a whole number from 1"),
    TOOK: SPREAD,
}
NOT_RECORDED = ("log_evidence", "calibrated_evidence")
BY_ENDING = {
    "heading_sd_rad": _from(0, MOST, f"{up_to()}, not negative, or inf", math.inf),
    "sd_x_m": SPREAD,
    "sd_y_m": SPREAD,
    "mass": SHARE,
    "confidence": SHARE,
    "converged": SHARE,
}
CLOUDS = {"x_m": FINITE, "y_m": FINITE, "heading_rad": FINITE}
CLOUDS |= {"carried_log_weight": LOG_WEIGHT, "log_weight": LOG_WEIGHT}


def step_rules(channels: Sequence[str], *, recorded: bool = False) -> dict[str, Rule]:
    """Return what each column of `steps` may hold, except the step number, which is checked by counting.

    How well a picture or scan was explained is not known of another localizer's run, as `recorded`.
    """
    rules = {name: _rule(name) for name in steps_schema(channels) if name != "step"}
    return rules | dict.fromkeys(NOT_RECORDED, UNKNOWN) if recorded else rules


def _rule(name: str) -> Rule:
    if name.startswith("evidence_"):
        return NATS
    if name.startswith("truth_"):
        return _or_none(FINITE)
    ending = next((rule for end, rule in BY_ENDING.items() if name.endswith(end)), FINITE)
    return BY_COLUMN.get(name, ending)


def expect_files(folder: Path) -> None:
    """Raise InputError for a device, a pipe or a folder in place of a part of a table."""
    for table in TABLES:
        for part in sorted((folder / table).glob("*.parquet")):
            if not part.is_file():
                raise InputError(part, "found no regular file, expected a Parquet file; is the run damaged?")


def check_step(file: Path, row: Mapping[str, Any], rules: Mapping[str, Rule]) -> None:
    """Raise InputError for the first value in a row of `steps` that its column does not allow."""
    for name, rule in rules.items():
        if not rule.holds(row[name]):
            _refuse(file, name, row[name], row["step"], rule.expected)
    truth = [name for name in row if name.startswith("truth_")]
    for together in (truth, *(list(columns) for _, columns in PARTS.values())):
        missing = [name for name in together if row[name] is None]
        if 0 < len(missing) < len(together):
            _refuse(file, missing[0], None, row["step"], f"{', '.join(together)}, or none of them")
    if len(row["best_entries"]) != len(row["best_quality"]):
        _refuse(file, "best_quality", row["best_quality"], row["step"], "one for each of best_entries")


def check_cloud(file: Path, cloud: pl.DataFrame, steps: pl.Series) -> None:
    """Raise InputError for the first row of a table of clouds with a value that is not allowed."""
    for name in cloud.columns:
        missing, rule = cloud[name].is_null(), CLOUDS.get(name)
        if missing.any():
            _refuse_row(file, cloud, name, int(missing.arg_max() or 0), "a value")
        if rule is not None:
            right = rule.holds(cloud[name].to_numpy())
            if not right.all():
                _refuse_row(file, cloud, name, int(right.argmin()), rule.expected)
    strays = ~cloud["step"].is_in(steps.implode())
    if strays.any():
        _refuse_row(file, cloud, "step", int(strays.arg_max() or 0), "a step of this part")


def check_update(folder: Path, part: str, rows: StepRows) -> None:
    """Raise InputError if the clouds of an update do not fit its row, or each other."""
    step, size = rows.step["step"], rows.particles.height
    weighted, renewed = folder / "particles" / part, folder / "renewed" / part
    if size != rows.step["particles"]:
        fault = f"found {size} particles at step {step}, expected {rows.step['particles']}"
        raise InputError(weighted, f"{fault}; is it damaged?")
    for file, cloud in ((weighted, rows.particles), (renewed, rows.renewed)):
        if not cloud.height:
            continue
        counted = cloud["index"].to_numpy() == np.arange(cloud.height)
        if not counted.all():
            row = int(counted.argmin())
            _refuse(file, "index", cloud["index"][row], step, f"particle {row} in row {row} of the step")
        total = float(np.exp(cloud["log_weight"].to_numpy()).sum())
        if abs(total - 1) > SLACK:
            _refuse(file, "weights that sum to", total, step, "a sum of 1")
    parents = rows.renewed["parent"]
    wrong = ~parents.is_between(-1, size - 1)
    if wrong.any():
        row = int(wrong.arg_max() or 0)
        text = f"found parent {parents[row]} of particle {row} at step {step}, a parent that is no particle"
        raise InputError(renewed, f"{text}; expected -1 to {size - 1}; is it damaged?")


def _refuse_row(file: Path, cloud: pl.DataFrame, name: str, row: int, expected: str) -> NoReturn:
    cell, step = f"{name} {show(cloud[name][row])}", show(cloud["step"][row])
    raise InputError(
        file, f"found {cell} in row {row + 1} (step {step}), expected {expected}; is it damaged?"
    )


def _refuse(file: Path, name: str, found: Any, step: int, expected: str) -> NoReturn:
    raise InputError(file, f"found {name} {show(found)} at step {step}, expected {expected}; is it damaged?")
