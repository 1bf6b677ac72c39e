"""Calibration trials as the table that `calibrate motion` reads."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from maurice_loaders.calibration_trials import COLUMNS
from maurice_mcl.fitting.motion import Trials


def write_trials(file: Path, trials: Trials) -> None:
    """Write trials for `read_trials`, in meters."""
    turns, ways = trials.turns, trials.straights
    rows: list[list[str]] = []
    for measured, actual in np.degrees(np.column_stack([turns.measured_rad, turns.actual_rad])):
        rows.append(["turn", f"{measured:.4f}", f"{actual:.4f}", "", ""])
    columns = (ways.measured_m, ways.actual_m, ways.drift_rad, ways.floors)
    for measured, actual, drift, floor in zip(*columns, strict=True):
        turned = f"{np.degrees(drift):.4f}" if math.isfinite(drift) else ""
        rows.append(["straight", f"{measured:.6f}", f"{actual:.6f}", turned, floor or ""])
    with file.open("w", newline="", encoding="utf-8") as data:
        csv.writer(data, lineterminator="\n").writerows([COLUMNS, *rows])
