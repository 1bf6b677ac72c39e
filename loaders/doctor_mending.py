"""From what the doctor found to the options of reading that mend it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from maurice_mcl.diagnosis import Complaint

from .formats import OpenOptions

UNITS_TAKEN = ("session-log", "table", "tum", "tum-trajectory", "openloris", "euroc")  # by --time-unit
FACTORS = (
    "odometry_scale",
    "turn_scale",
    "turn_gain",
    "truth_scale",
    "truth_turn_scale",
)  # what was read with one factor and needs another is read with their product


def mendable(complaint: Complaint, format_name: str) -> Complaint:
    """Leave out of a complaint the options that a format does not take."""
    if "time_unit" in complaint.options and format_name not in UNITS_TAKEN:
        return replace(complaint, options={})
    return complaint


def mended(options: OpenOptions, complaints: Iterable[Complaint]) -> OpenOptions:
    """Give options that read a recording as it should have been, by what was found reading it with others."""
    for complaint in complaints:
        options = _with(options, complaint.options)
    return options


def _with(options: OpenOptions, changes: Mapping[str, float | str]) -> OpenOptions:
    found: dict[str, float | str] = {}
    for name, value in changes.items():
        before = getattr(options, name)
        if isinstance(value, str):
            found[name] = value
        else:
            found[name] = before * value if name in FACTORS else before + value
    return replace(options, **found)  # type: ignore[arg-type]  # fields by name
