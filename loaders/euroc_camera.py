"""What an EuRoC camera's `sensor.yaml` says: size, angle of view, and where the camera looks on the body."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from maurice_mcl.session import Camera
from maurice_mcl.typing import F64

from .pose_files import PoseFile
from .text_rows import begin_of

_LISTS = re.compile(r"^\s*(T_BS|data|resolution|intrinsics)\s*:\s*(?:\[([^\]]*)\])?", re.MULTILINE)
MOST_BYTES = 2**16  # a description has one or two thousand


def camera_of(file: Path, name: str, poses: PoseFile | None) -> Camera:
    """Describe a camera as far as the file does, and its yaw as far as the poses of the body tell it.

    What is missing or makes no sense stays unknown. The file is YAML of a fixed form: `resolution: [w, h]`,
    `intrinsics: [fu, fv, cu, cv]` in pixels, and `T_BS` with its 16 numbers in rows under `data`, which lead
    from the camera's frame (z along its optical axis) to the body's.
    """
    lists = _lists(begin_of(file, MOST_BYTES).decode(errors="replace"))
    size, inner, turned = (lists.get(key, []) for key in ("resolution", "intrinsics", "T_BS"))
    width, height = (int(v) for v in size) if len(size) == 2 and min(size) >= 1 else (None, None)
    wide = width is not None and len(inner) == 4 and inner[0] > 0
    fov = 2 * math.atan2(width / 2, inner[0]) if wide and width else None
    yaw = yaw_on_body(np.array(turned).reshape(4, 4), poses) if len(turned) == 16 and poses else 0.0
    return Camera(name, width, height, fov, yaw)


def yaw_on_body(camera_to_body: F64, poses: PoseFile) -> float:
    """Tell where a camera looks, counter-clockwise from the forward axis that the poses' headings have.

    Which way is up on the body the poses tell: on a flying robot (EuRoC) it is x, on a driving one z.
    """
    forward, up = poses.body
    looks = camera_to_body[:3, 2]
    return math.atan2(float(looks @ np.cross(up, forward)), float(looks @ forward))


def _lists(text: str) -> dict[str, list[float]]:
    """Find the lists of numbers by their names; the first `data` after T_BS is its."""
    found: dict[str, list[float]] = {}
    inside = ""
    for name, values in _LISTS.findall(text):
        if name == "T_BS":
            inside = name
        key = inside if name == "data" else name
        try:
            numbers = [float(word) for word in values.replace("\n", " ").split(",") if word.strip()]
        except ValueError:
            continue
        if numbers and np.isfinite(numbers).all() and key:
            found.setdefault(key, numbers)
    return found
