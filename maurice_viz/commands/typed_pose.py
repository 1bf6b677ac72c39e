"""A pose as it is typed: X,Y,HEADING in the session's display units and degrees."""

from __future__ import annotations

import numpy as np
import typer

from maurice_mcl.typing import F64

from ..look import Units

FARTHEST_M = 1e9  # no map reaches further


def typed_pose(text: str, units: Units, wanted: str) -> F64:
    """Read a pose (3,) in metres and radians; a usage error that says what was wanted for anything else."""
    try:
        x, y, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        x = y = heading_deg = np.nan
    pose = np.array([x / units.per_m, y / units.per_m, np.deg2rad(heading_deg)])
    if not (np.abs(pose) <= FARTHEST_M).all():
        raise typer.BadParameter(f"{wanted} in {units.name} and degrees, found {text!r}")
    return pose
