"""From what the doctor found to the options of reading that fix it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ..formats.registry import Format
from ..reading.options import Reading
from .findings import Finding

# what was read with one factor and needs another is read with their product
FACTORS = ("odometry_scale", "turn_scale", "turn_gain", "truth_scale", "truth_turn_scale")


def fixable(finding: Finding, form: Format, options: Reading) -> Finding:
    """Leave out of a finding the options that a format does not take, or that hold something else."""
    is_taken = options.odometry_are is not None and "odometry_are" in finding.options
    if is_taken or ("time_unit" in finding.options and not form.takes_unit):
        return replace(finding, options={})
    return finding


def on_robot(finding: Finding, options: Reading) -> Finding:
    """Return a place on the robot as the options have it: from forward, not from where the camera looks."""
    if finding.code != "truth-mast" or not options.camera_yaw_rad:
        return finding
    place = complex(finding.numbers["ahead_m"], finding.numbers["left_m"])
    turned = place * np.exp(1j * options.camera_yaw_rad)
    numbers = {"ahead_m": round(turned.real, 3), "left_m": round(turned.imag, 3)}
    return replace(finding, numbers=numbers, options={f"truth_{name}": v for name, v in numbers.items() if v})


def fixed_options(options: Reading, findings: Iterable[Finding]) -> Reading:
    """Return the options with what fixes the findings, found in reading with these options."""
    for finding in findings:
        changed: dict[str, Any] = {}
        for name, value in finding.options.items():
            before = getattr(options, name)
            if isinstance(value, str):
                changed[name] = value
            else:
                changed[name] = before * value if name in FACTORS else before + value
        options = replace(options, **changed)
    return options
