"""`--start`: where the particles begin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from maurice_loaders.errors import LogError
from maurice_mcl.session import SessionInfo
from maurice_mcl.typing import F64

from ..look import units_named
from .typed_pose import typed_pose


def start_pose(
    text: str | None, info: SessionInfo, log: Path, first_truth: Callable[[], F64 | None]
) -> F64 | None:
    """Read `--start`: a pose (3,) in the map's frame, or None for anywhere.

    LogError when tracking or the truth is asked for and there is no such pose; a usage error for other words.
    """
    if text is None:
        return info.start
    if text == "global":
        return None
    if text == "tracking":
        if info.start is None:
            found = 'found no "start" pose in a header'
            raise LogError(log, f"{found}; give --start truth, X,Y,HEADING or global")
        return info.start
    if text == "truth":
        pose = first_truth()
        if pose is None:
            raise LogError(log, "found no truth to start from; give --start X,Y,HEADING or global")
        return pose
    return typed_pose(
        text, units_named(info.display_units), "--start is tracking, truth, global or X,Y,HEADING"
    )
