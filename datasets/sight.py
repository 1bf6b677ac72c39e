"""Which lamps a point sees: few rays, many boxes."""

from __future__ import annotations

import numpy as np

from maurice_mcl.typing import F64, Bool

from .world import Box


def seen_past(point: F64, targets: F64, boxes: tuple[Box, ...]) -> Bool:
    """Tell which targets (P, 3) can be seen from a point (3,) past boxes, by the slab method."""
    if not boxes:
        return np.ones(len(targets), dtype=bool)
    cos, sin = np.array([(np.cos(box.yaw_rad), np.sin(box.yaw_rad)) for box in boxes]).T
    half = np.array([box.half for box in boxes])
    away = point - np.array([box.center for box in boxes])  # (B, 3)
    step = np.broadcast_to((targets - point)[:, None], (len(targets), len(boxes), 3))
    at, by = into(away, cos, sin), into(step, cos, sin)
    by = np.where(np.abs(by) < 1e-9, 1e-9, by)
    enter = ((-at - np.sign(by) * half) / by).max(axis=-1)
    leave = ((-at + np.sign(by) * half) / by).min(axis=-1)
    blocked = (enter < leave) & (leave > 0) & (enter < 0.995)
    return np.asarray(~blocked.any(axis=1))


def into(vectors: F64, cos: F64, sin: F64) -> F64:
    """Turn vectors (..., B, 3) into the frames of B boxes."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)
