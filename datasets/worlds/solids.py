"""From boxes to faces, in inches: the geometry that furniture and walls are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from maurice_mcl.values import F32, F64, INCH_M

from .textures import Size
from .world import Box, Face

Paint = Callable[[np.random.Generator, Size], F32]

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Solid:
    """An upright box on or above the floor."""

    x_in: float  # of its middle
    y_in: float
    z_in: float  # of its underside
    width_in: float  # along x before turning
    depth_in: float  # along y before turning
    height_in: float
    yaw_rad: float = 0.0  # counter-clockwise about its middle


def pixels(width_in: float, height_in: float, per_inch: float) -> Size:
    """Return the rows and columns that a texture needs; at least 6 each, at most 1600."""
    rows, columns = (int(np.clip(round(side * per_inch), 6, 1600)) for side in (height_in, width_in))
    return rows, columns


def upright(
    rng: np.random.Generator,
    left_in: F64,
    right_in: F64,
    bottom_in: float,
    top_in: float,
    paint: Paint,
    *,
    per_inch: float = 4.0,
    glow: float = 0.0,
) -> Face:
    """Stand a face on the plan from `left_in` to `right_in` (2,), as seen from its front."""
    along = np.append(right_in - left_in, 0.0)
    size = pixels(float(np.linalg.norm(along)), top_in - bottom_in, per_inch)
    corner = np.append(left_in, top_in)
    return Face(corner * INCH_M, along * INCH_M, -UP * (top_in - bottom_in) * INCH_M, paint(rng, size), glow)


def flat(
    rng: np.random.Generator,
    corners_in: F64,
    z_in: float,
    paint: Paint,
    *,
    facing_up: bool = True,
    per_inch: float = 4.0,
) -> Face:
    """Lay a face flat; corners_in (4, 2) go counter-clockwise on the plan from one corner."""
    order = corners_in if facing_up else corners_in[::-1]
    corner, across, down = order[3], order[2] - order[3], order[0] - order[3]
    size = pixels(float(np.linalg.norm(across)), float(np.linalg.norm(down)), per_inch)
    sides = (np.append(side, z) * INCH_M for side, z in ((corner, z_in), (across, 0.0), (down, 0.0)))
    corner, across, down = sides
    return Face(corner, across, down, paint(rng, size))


def footprint(solid: Solid) -> F64:
    """Return the plan (4, 2) of a solid in inches, counter-clockwise from its front left corner."""
    half = np.array([solid.width_in, solid.depth_in]) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    cos, sin = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    return np.asarray(turned + np.array([solid.x_in, solid.y_in]))


def box_of(solid: Solid) -> Box:
    """Return the shadow-casting box of a solid, in meters."""
    center = np.array([solid.x_in, solid.y_in, solid.z_in + solid.height_in / 2]) * INCH_M
    half = np.array([solid.width_in, solid.depth_in, solid.height_in]) / 2 * INCH_M
    (x, y, z), (wide, deep, high) = center.tolist(), half.tolist()
    return Box((x, y, z), (wide, deep, high), solid.yaw_rad)


def faces_of(
    rng: np.random.Generator,
    solid: Solid,
    paint: Paint,
    *,
    top: Paint | None = None,
    underside: bool = False,
    per_inch: float = 6.0,
) -> tuple[Face, ...]:
    """Paint the four sides and the top (and the underside, for things one can look beneath)."""
    plan = footprint(solid)
    low, high = solid.z_in, solid.z_in + solid.height_in
    ends = np.roll(plan, -1, axis=0)
    sides = [upright(rng, a, b, low, high, paint, per_inch=per_inch) for a, b in zip(plan, ends, strict=True)]
    lids = [flat(rng, plan, high, top or paint, per_inch=per_inch)]
    if underside:
        lids.append(flat(rng, plan, low, paint, facing_up=False, per_inch=per_inch))
    return (*sides, *lids)
