"""The robot's camera: which lit face each picture point sees, and how bright it is there.

For a point of a parallelogram, (s, t, 1) / depth is affine in picture coordinates. So coverage, depth and
texture coordinates of a face are three planes over the picture; a depth buffer decides who is in front, and
the faces that can be seen are warped in with OpenCV.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from maurice_mcl.values import F32, F64, I32, INCH_M, Bool


@dataclass(frozen=True, slots=True, eq=False)
class LitFace:
    """A face at full size and halved again and again.

    `levels` are the light it gives off, or, where `grid` locates its light in the scene, what it reflects.
    """

    corner: F64  # (3,) as in Face
    across: F64  # (3,)
    down: F64  # (3,)
    levels: tuple[F32, ...]  # (H, W, 3) linear; each level has half the rows and columns
    grid: tuple[int, int, int] | None = None  # first point, rows and columns; at the middles of its cells


@dataclass(frozen=True, slots=True, eq=False)
class LitScene:
    """Faces, and where they are all together."""

    faces: tuple[LitFace, ...]
    corner: F64  # (F, 3) of all faces together, as in LitFace
    across: F64  # (F, 3)
    down: F64  # (F, 3)
    light: F32 | None = None  # (K, 3) of the grids of all faces one after the other, where light may change

    def grid_of(self, face: LitFace) -> F32 | None:
        """Return the light (rows, columns, 3) on a face; None where it is in its levels."""
        if self.light is None or face.grid is None:
            return None
        first, rows, columns = face.grid
        return self.light[first : first + rows * columns].reshape(rows, columns, 3)


def scene_of(faces: tuple[LitFace, ...], light: F32 | None = None) -> LitScene:
    """Gather lit faces."""
    sides = (np.stack([getattr(face, side) for face in faces]) for side in ("corner", "across", "down"))
    corner, across, down = sides
    return LitScene(faces, corner, across, down, light)


def joined(scene: LitScene, more: LitScene) -> LitScene:
    """Join the faces and the light of two scenes, both with light that may change."""
    if scene.light is None or more.light is None:
        raise ValueError("expected two scenes with light of their own, found one with fixed light")
    before = len(scene.light)
    return LitScene(
        (*scene.faces, *(_moved_on(face, before) for face in more.faces)),
        np.concatenate([scene.corner, more.corner]),
        np.concatenate([scene.across, more.across]),
        np.concatenate([scene.down, more.down]),
        np.concatenate([scene.light, more.light]),
    )


def _moved_on(face: LitFace, before: int) -> LitFace:
    if face.grid is None:
        return face
    first, rows, columns = face.grid
    return replace(face, grid=(first + before, rows, columns))


def halvings(texture: F32) -> tuple[F32, ...]:
    """Return a texture and its halves by averaging, down to a few pixels."""
    levels = [texture]
    while min(levels[-1].shape[:2]) >= 8:
        rows, columns = levels[-1].shape[:2]
        half = cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.float32))
    return tuple(levels)


Window = tuple[int, int, int, int]  # u1, v1, u2, v2 of a part of the picture, ends exclusive


@dataclass(frozen=True)
class Lens:
    """Pose and optics of the camera. Those of Maurice are unknown: these are invented but common."""

    width_px: int = 176  # CMUcam2's largest picture across
    height_px: int = 144  # and down, cut to the common 11:9
    horizontal_fov_rad: float = float(np.radians(50))  # a 4 mm lens on a 1/4 in sensor
    height_m: float = 9.5 * INCH_M  # on top of a rover
    pitch_rad: float = float(np.radians(6))  # tilted up a little, to see more than the floor
    near_m: float = 0.5 * INCH_M  # nothing nearer than this is drawn
    oversample: int = 2  # samples a pixel in each direction, averaged: smooth edges
    pixel_aspect: float = 1.0  # width of a pixel over its height; 2 for the CMUcam2's 88 x 143

    @cached_property
    def matrix(self) -> F64:
        """Pinhole matrix (3, 3) for the oversampled picture: x right, y down, z forward."""
        columns, rows = self.width_px * self.oversample, self.height_px * self.oversample
        focal = columns / 2 / np.tan(self.horizontal_fov_rad / 2)
        across, down = [focal, 0, columns / 2 - 0.5], [0, focal * self.pixel_aspect, rows / 2 - 0.5]
        return np.array([across, down, [0, 0, 1.0]])


def orientation(heading_rad: float, pitch_rad: float) -> F64:
    """Return the rotation (3, 3) whose rows are the camera's right, down and forward in the world."""
    c, s, cp, sp = np.cos(heading_rad), np.sin(heading_rad), np.cos(pitch_rad), np.sin(pitch_rad)
    forward = np.array([c * cp, s * cp, sp])
    right = np.array([s, -c, 0.0])
    return np.stack([right, np.cross(forward, right), forward])


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One face as the camera has it."""

    face: LitFace
    planes: F64  # (3, 3) takes (u, v, 1) to (s, t, 1) / depth
    window: Window  # the part of the picture that it can touch
    nearest: float  # one over the depth of its nearest corner


def _clip_near(corners: F64, near_m: float) -> F64:
    points = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= near_m:
            points.append(a)
        if (a[2] - near_m) * (b[2] - near_m) < 0:
            points.append(a + (b - a) * (near_m - a[2]) / (b[2] - a[2]))
    return np.array(points).reshape(-1, 3)


def project(scene: LitScene, position: F64, turn: F64, lens: Lens) -> list[Seen]:
    """Find the faces that turn their front to the camera, nearest first, and where they fall in it."""
    corner = (scene.corner - position) @ turn.T
    across, down = scene.across @ turn.T, scene.down @ turn.T
    front = np.sum(np.cross(down, across) * corner, axis=1) < 0
    numbers = np.flatnonzero(front)
    corner, across, down = corner[front], across[front], down[front]
    outlines = np.stack([corner, corner + across, corner + across + down, corner + down], axis=1)
    windows = windows_of(outlines, lens)
    visible = np.flatnonzero((windows[:, 0] < windows[:, 2]) & (windows[:, 1] < windows[:, 3]))
    depth = np.maximum(outlines[visible, :, 2].min(axis=1), lens.near_m)
    order = np.argsort(depth, kind="stable")
    visible, nearest = visible[order], 1 / depth[order]
    planes = np.linalg.inv(lens.matrix @ np.stack([across, down, corner], axis=2)[visible])
    faces = (scene.faces[k] for k in numbers[visible])
    return [
        Seen(face, plane, (u1, v1, u2, v2), float(near))
        for face, plane, (u1, v1, u2, v2), near in zip(
            faces, planes, windows[visible].tolist(), nearest, strict=True
        )
    ]


def windows_of(outlines: F64, lens: Lens) -> I32:
    """Return the part of the picture (F, 4) that outlines (F, 4, 3) can touch; empty for none."""
    ahead = outlines[:, :, 2].min(axis=1) >= lens.near_m
    cut = np.flatnonzero(~ahead & (outlines[:, :, 2].max(axis=1) > lens.near_m))
    bounds = np.zeros((len(outlines), 4))
    bounds[ahead] = bounds_of(outlines[ahead], lens)
    for k in cut:
        bounds[k] = bounds_of(_clip_near(outlines[k], lens.near_m)[None], lens)[0]
    size = lens.width_px * lens.oversample, lens.height_px * lens.oversample
    low = np.maximum(np.floor(bounds[:, :2]), 0)
    high = np.where((ahead | np.isin(np.arange(len(outlines)), cut))[:, None], np.ceil(bounds[:, 2:]) + 1, 0)
    return np.concatenate([np.minimum(low, size), np.clip(high, 0, size)], axis=1).astype(np.int32)


def bounds_of(outlines: F64, lens: Lens) -> F64:
    """Return the bounds (F, 4) u1, v1, u2, v2 of polygons (F, K, 3) before the camera."""
    image = outlines @ lens.matrix.T
    uv = image[..., :2] / image[..., 2:]
    return np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)


def over(row: F64, window: Window) -> F32:
    """Evaluate one plane a*u + b*v + c over a window of the picture."""
    u1, v1, u2, v2 = window
    across = (row[0] * np.arange(u1, u2) + row[2]).astype(np.float32)
    down = (row[1] * np.arange(v1, v2)).astype(np.float32)
    return np.asarray(across[None, :] + down[:, None])


def visibility(seen: list[Seen], lens: Lens) -> tuple[I32, F32]:
    """Return the number of the nearest face (-1: none) and one over its depth, for every sample."""
    shape = lens.height_px * lens.oversample, lens.width_px * lens.oversample
    number = np.full(shape, -1, dtype=np.int32)
    nearness = np.zeros(shape, dtype=np.float32)
    for k, face in enumerate(seen):
        u1, v1, u2, v2 = face.window
        here = nearness[v1:v2, u1:u2]
        if here.min() > face.nearest:  # all of it is behind what is drawn already
            continue
        s, t, near = (over(row, face.window) for row in face.planes)
        wins = (near > here) & (s >= 0) & (t >= 0) & (s <= near) & (t <= near)
        here[wins] = near[wins]
        number[v1:v2, u1:u2][wins] = k
    return number, nearness


def level_of(face: Seen, nearness: F32) -> I32:
    """Choose the texture level of samples: by the mapping's Jacobian, det(planes) * depth^3."""
    rows, columns = face.face.levels[0].shape[:2]
    texels = abs(float(np.linalg.det(face.planes))) * rows * columns / nearness**3
    level = np.rint(0.5 * np.log2(texels))
    return np.asarray(np.clip(level, 0, len(face.face.levels) - 1), dtype=np.int32)


def warp(texture: F32, planes: F64, window: Window) -> F32:
    """Warp what covers a face, from edge to edge, into a window of the picture."""
    u1, v1, u2, v2 = window
    rows, columns = texture.shape[:2]
    to_texture = np.array([[columns, 0, -0.5], [0, rows, -0.5], [0, 0, 1.0]])
    shift = np.array([[1.0, 0, u1], [0, 1.0, v1], [0, 0, 1.0]])
    return np.asarray(
        cv2.warpPerspective(
            texture,
            to_texture @ planes @ shift,
            (u2 - u1, v2 - v1),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def draw(picture: F32, face: Seen, grid: F32 | None, mine: Bool, nearness: F32) -> None:
    """Fill in the samples `mine` (of its window) of a picture (H, W, 3) in place, under a light `grid`."""
    left, top, width, height = cv2.boundingRect(mine.view(np.uint8))
    u, v = face.window[0] + left, face.window[1] + top
    window, part = (u, v, u + width, v + height), (slice(v, v + height), slice(u, u + width))
    here = mine[top : top + height, left : left + width]
    levels = level_of(face, nearness[part][here])
    light = None if grid is None else warp(grid, face.planes, window)
    for level in np.flatnonzero(np.bincount(levels)):
        which = here.copy()
        which[here] = levels == level
        shown = warp(face.face.levels[level], face.planes, window)
        if light is not None:
            cv2.multiply(shown, light, dst=shown)
        cv2.copyTo(shown, which.view(np.uint8), picture[part])


def radiance(scene: LitScene, pose: F64, lens: Lens | None = None) -> F32:
    """Take a perfect picture (H, W, 3) in linear light from pose (3,) x_m, y_m, heading_rad."""
    lens = lens or Lens()
    position = np.array([pose[0], pose[1], lens.height_m])
    turn = orientation(float(pose[2]), lens.pitch_rad)
    seen = project(scene, position, turn, lens)
    number, nearness = visibility(seen, lens)
    picture = np.zeros((*number.shape, 3), dtype=np.float32)
    for k in np.flatnonzero(np.bincount(number.ravel() + 1, minlength=2)[1:]):
        u1, v1, u2, v2 = seen[k].window
        grid = scene.grid_of(seen[k].face)
        draw(picture, seen[k], grid, number[v1:v2, u1:u2] == k, nearness)
    size = (lens.width_px, lens.height_px)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
