"""Poses in space projected to a plane: which plane the motion lies in, and the heading of a body in it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.arrays import F64

SIDES = {"zx": (0.0, 1.0, 0.0), "zy": (-1.0, 0.0, 0.0)}  # named in this order: which way is up, by right hand
TURNED = ("xz", "yz", *SIDES)  # planes that poses have to be turned for
PLANES = ("auto", "xy", *TURNED)
AXES = "xyz"
UP_ON_BODY = (1.0, -1.0, 1.0)  # which way x, y or z points on a body where it is upright; cameras have y down

FEWEST = 20  # fewest poses to detect a plane from
MOST = 4000  # poses kept for that; of more than that, every second, fourth, ...
FIRST = 200  # poses after which a flat path is known to be in x-y
THIN = 1 / 3  # most spread across the plane, relative to the lesser spread in it
WIDE = 0.2  # least spread in the plane, relative to the greater, where only the positions tell it
ALONG = 0.8  # least cosine between the plane's normal and an axis
STEADY = 0.9  # how steady the normal has to be, as seen from the body: 1 for turns about it alone
STEADIER = 0.1  # and by how much steadier than z

Pose = tuple[F64, F64]  # position (3,) and rotation (3, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane of two axes of a recording's frame, seen from above."""

    name: str = "xy"
    turned: F64 = field(default_factory=lambda: np.eye(3))  # (3, 3) to a frame with z up
    forward: str = "x"  # which axis of the body points forward
    remark: str = ""  # why it is not x-y, or why that is doubtful

    def place(self, position: F64, rotation: F64) -> Pose:
        """Return position (3,) and rotation (3, 3) in a frame with z up."""
        return (position, rotation) if self.name == "xy" else (self.turned @ position, self.turned @ rotation)

    def pose(self, matrix: F64) -> F64:
        """Return x, y and heading (3,) of a matrix (4, 4) in the recording's frame."""
        return planar(*self.place(matrix[:3, 3], matrix[:3, :3]), self.forward)


def plane_of(poses: Iterable[Pose], wanted: str | None) -> Plane:
    """Return the plane of a motion: the requested one, or the one that its poses show clearly."""
    if wanted == "xy":
        return Plane()
    positions, rotations = _sampled(poses, FIRST if wanted in TURNED else MOST)
    if wanted is not None and wanted in TURNED:
        return _seen_from_above(wanted, rotations)
    if len(positions) < FEWEST or not np.ptp(positions[:, 2]):
        return Plane()
    spreads, axes = np.linalg.eigh(np.cov(positions.T))
    least, less, most = np.sqrt(np.maximum(spreads, 0.0))
    normal = axes[:, 0]
    across = int(np.argmax(np.abs(normal)))
    if across == 2 or abs(normal[across]) < ALONG or least > THIN * less:
        return Plane()
    name = AXES.replace(AXES[across], "")
    size = " x ".join(f"{one:.3g}" for one in np.ptp(positions, axis=0))
    found = f"the motion lies in the plane of {name[0]} and {name[1]} (extents {size} m)"
    steady, upright = _steadiness(rotations, normal), _steadiness(rotations, np.array([0.0, 0.0, 1.0]))
    if steady >= STEADY and upright <= steady - STEADIER:
        said = f"{found}, as in a camera's frame, so these are read; --reading plane=xy reads x and y"
        return _seen_from_above(name, rotations, said)
    if upright > STEADY and steady > STEADY and less > WIDE * most:
        text = f"{found}, but no turn shows which axis is up: x and y are read; --reading plane={name} reads"
        return Plane(remark=f"{text} {name[0]} and {name[1]}")
    return Plane()


def _sampled(poses: Iterable[Pose], most: int) -> Pose:
    """Return positions (n, 3) and rotations (n, 3, 3), thinned out; only the first ones if z is constant."""
    kept: list[Pose] = []
    stride = 1
    for number, pose in enumerate(poses):
        if number % stride == 0:
            kept.append(pose)
        if number + 1 >= FIRST and (most == FIRST or (number + 1 == FIRST and _is_flat(kept))):
            break
        if len(kept) > most:
            kept, stride = kept[::2], 2 * stride
    positions = np.array([position for position, _ in kept]).reshape(-1, 3)
    return positions, np.array([rotation for _, rotation in kept]).reshape(-1, 3, 3)


def _is_flat(poses: list[Pose]) -> bool:
    extents = np.ptp([position for position, _ in poses], axis=0)
    return bool(extents[2] == 0 < extents[:2].max())


def _steadiness(rotations: F64, direction: F64) -> float:
    """Return the length of the mean of a direction (3,) as seen from the body; 1 if it is constant."""
    return float(np.linalg.norm(np.einsum("nij,i->nj", rotations, direction).mean(axis=0)))


def _seen_from_above(name: str, rotations: F64, remark: str = "") -> Plane:
    """Return the plane of two axes; the upright axis of the bodies determines which side is up.

    A body with y up in a frame with y up turns as a camera does in its own frame, where both y point down:
    only a name of SIDES tells them apart.
    """
    across = 3 - AXES.index(name[0]) - AXES.index(name[1])
    upright = rotations[:, across].mean(axis=0) if len(rotations) else np.array([0.0, 1.0, 0.0])
    on_body = int(np.argmax(np.abs(upright)))
    up, first = np.zeros(3), np.zeros(3)
    up[across] = 1.0 if upright[on_body] * UP_ON_BODY[on_body] > 0 else -1.0
    up = np.array(SIDES.get(name, up))
    if remark and AXES[on_body] == "y" and up[1] < 0:
        remark += "; y is taken to point down, as in a camera's frame; --reading plane=zx if it points up"
    first[AXES.index(name[0])] = 1.0
    turned = np.array([first, np.cross(up, first), up])
    return Plane(name, turned, forward_axis(turned @ rotations) if len(rotations) else "z", remark)


LEANING_RAD = math.radians(30)  # a larger angle to the plane is reported


def rotation(quaternion_wxyz: F64) -> F64:
    """Return the rotation matrix (3, 3) of a quaternion (4,). ValueError when its length is not about 1."""
    length = float(np.linalg.norm(quaternion_wxyz))
    if not 0.9 < length < 1.1:
        raise ValueError(f"found a quaternion of length {length:.3g}, expected 1")
    w, x, y, z = (float(v) / length for v in quaternion_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def forward_axis(rotations: Iterable[F64]) -> str:
    """Return which axis of a body points forward, "x" (z is upright: robots) or "z" (cameras)."""
    upright = np.mean([np.abs(r[2]) for r in rotations], axis=0)
    return "x" if int(np.argmax(upright)) == 2 else "z"


def planar(position: F64, turned: F64, axis: str) -> F64:
    """Return x, y and the heading of the forward axis (3,) of a pose in a z-up world."""
    ahead = turned[:, 0 if axis == "x" else 2]
    return np.array([position[0], position[1], math.atan2(ahead[1], ahead[0])])


def leaning(turned: F64, axis: str) -> float:
    """Return how far, in radians, the forward axis points out of the plane."""
    return abs(math.asin(max(-1.0, min(1.0, float(turned[2, 0 if axis == "x" else 2])))))
