"""Poses in space projected to a plane: which plane the motion lies in, and the heading of a body in it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from maurice_mcl.values import F64

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
    upright: F64 | None = None  # (3,) up, as seen from the body, over all poses; None: not looked at

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
    plane = _detected(positions, rotations, wanted)
    if not len(rotations):
        return plane
    up = np.einsum("nij,i->nj", rotations, plane.turned[2]).mean(axis=0)
    return replace(plane, upright=up / max(float(np.linalg.norm(up)), 1e-9))


def _detected(positions: F64, rotations: F64, wanted: str | None) -> Plane:
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
    size = " x ".join(f"{extent:.3g}" for extent in np.ptp(positions, axis=0))
    motion = f"the motion lies in the plane of {name[0]} and {name[1]} (extents {size} m)"
    steady, upright = _steadiness(rotations, normal), _steadiness(rotations, np.array([0.0, 0.0, 1.0]))
    if steady >= STEADY and upright <= steady - STEADIER:
        remark = f"{motion}, as in a camera's frame, so these are read; --reading plane=xy reads x and y"
        return _seen_from_above(name, rotations, remark)
    if upright > STEADY and steady > STEADY and less > WIDE * most:
        text = f"{motion}, but no turn shows which axis is up: x and y are read; --reading plane={name} reads"
        return Plane(remark=f"{text} {name[0]} and {name[1]}")
    return Plane()


def _sampled(poses: Iterable[Pose], most: int) -> Pose:
    """Return positions (n, 3) and rotations (n, 3, 3), thinned out; only the first ones if z is constant."""
    sample: list[Pose] = []
    stride = 1
    for number, pose in enumerate(poses):
        if number % stride == 0:
            sample.append(pose)
        if number + 1 >= FIRST and (most == FIRST or (number + 1 == FIRST and _is_flat(sample))):
            break
        if len(sample) > most:
            sample, stride = sample[::2], 2 * stride
    positions = np.array([position for position, _ in sample]).reshape(-1, 3)
    return positions, np.array([rotation for _, rotation in sample]).reshape(-1, 3, 3)


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


TILTED_RAD, LEVEL_RAD = math.radians(15), math.radians(10)  # tilts from which on it is told, and no more
SAMPLED = 500  # poses by which a motion is judged; of more than that, every second, fourth, ...
TILTED, LEVEL = "tilted", "level again"  # how such notes begin
LEFT_RAD = math.radians(5)  # a tilt from which on the plane was left ...
LEFT_M, LEFT_SHARE = 0.3, 0.05  # or a range of height, by itself and as a share of the drive's extent


@dataclass(slots=True)
class OutOfPlane:
    """How far poses in space leave the plane: their height over it, and their tilt, pitch and roll in one."""

    plane: Plane
    _places: list[tuple[float, ...]] = field(default_factory=list)  # of SAMPLED poses at most
    _tilts_rad: list[float] = field(default_factory=list)
    _stride: int = 1
    _seen: int = 0
    _tilted: bool = False  # when it was noted last

    def add(self, position: F64, turned: F64) -> str:
        """Take in a pose in a frame with z up; return a note where the body begins to tilt, or ends it."""
        up = self.plane.upright
        tilt_rad = 0.0 if up is None else math.acos(max(-1.0, min(1.0, float(turned[2] @ up))))
        if self._seen % self._stride == 0:
            self._places.append(tuple(position.tolist()))
            self._tilts_rad.append(tilt_rad)
        self._seen += 1
        if len(self._tilts_rad) > SAMPLED:
            self._places, self._tilts_rad = self._places[::2], self._tilts_rad[::2]
            self._stride *= 2
        if self._tilted != (tilt_rad > (LEVEL_RAD if self._tilted else TILTED_RAD)):
            self._tilted = not self._tilted
            return f"{TILTED} {math.degrees(tilt_rad):.0f} deg out of the plane" if self._tilted else LEVEL
        return ""

    @property
    def height_m(self) -> float:
        """The range of heights of nine in ten poses."""
        return float(np.ptp(np.percentile([place[2] for place in self._places], [5, 95])))

    @property
    def tilt_rad(self) -> float:
        """The tilt that one pose in twenty exceeds."""
        return float(np.percentile(self._tilts_rad, 95))

    def __str__(self) -> str:
        """Say it in a sentence; "" for a motion in the plane."""
        if not self._places:
            return ""
        extent_m = float(np.ptp(self._places, axis=0)[:2].max())
        if self.tilt_rad < LEFT_RAD and self.height_m < max(LEFT_M, LEFT_SHARE * extent_m):
            return ""
        tilt = f"tilted by up to {math.degrees(self.tilt_rad):.0f} degrees (pitch and roll)"
        height = f"height over {self.height_m:.2f} m"
        return f"the motion leaves the plane: {tilt}, {height}; only x, y and the heading are used"


def rotation(quaternion_wxyz: F64) -> F64:
    """Return the rotation matrix (3, 3) of a quaternion (4,). ValueError when its length is not about 1."""
    length = float(np.linalg.norm(quaternion_wxyz))
    if not 0.9 < length < 1.1:
        raise ValueError(f"found a quaternion of length {length:.3g}, expected 1")
    return unit_rotation(*(float(v) / length for v in quaternion_wxyz))


def unit_rotation(w: float, x: float, y: float, z: float) -> F64:
    """Return the rotation matrix (3, 3) of a quaternion of length 1."""
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
