"""What a camera needs to know of a world: faces with the light they give off."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.typing import F32, F64


@dataclass(frozen=True, slots=True, eq=False)
class LitFace:
    """A face at full size and halved again and again.

    Either `levels` are the light it gives off, or, where light may change, what it reflects; `light` then
    is a coarse grid to multiply them by.
    """

    corner: F64  # (3,) as in Face
    across: F64  # (3,)
    down: F64  # (3,)
    levels: tuple[F32, ...]  # (H, W, 3) linear; each level has half the rows and columns
    light: F32 | None = None  # (rows, columns, 3) over the whole face, at the middles of its cells


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Faces, and where they are all together."""

    faces: tuple[LitFace, ...]
    corner: F64  # (F, 3) of all faces together, as in LitFace
    across: F64  # (F, 3)
    down: F64  # (F, 3)


def scene_of(faces: tuple[LitFace, ...]) -> Scene:
    """Gather lit faces."""
    corner = np.stack([face.corner for face in faces])
    across = np.stack([face.across for face in faces])
    return Scene(faces, corner, across, np.stack([face.down for face in faces]))


def joined(scene: Scene, more: Scene) -> Scene:
    """Put the faces of two scenes together."""
    return Scene(
        (*scene.faces, *more.faces),
        np.concatenate([scene.corner, more.corner]),
        np.concatenate([scene.across, more.across]),
        np.concatenate([scene.down, more.down]),
    )


def halvings(texture: F32) -> tuple[F32, ...]:
    """Give a texture and its halves by averaging, down to a few pixels."""
    levels = [texture]
    while min(levels[-1].shape[:2]) >= 8:
        rows, columns = levels[-1].shape[:2]
        half = cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.float32))
    return tuple(levels)
