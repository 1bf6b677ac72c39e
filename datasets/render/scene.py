"""What a camera needs of a world: faces with the light they emit."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.arrays import F32, F64


@dataclass(frozen=True, slots=True, eq=False)
class LitFace:
    """A face at full size and halved again and again.

    Either `levels` are the light it gives off, or, where light may change, what it reflects; `grid` then
    tells where in the scene's light the coarse grid is found that they are multiplied by.
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
    corner = np.stack([face.corner for face in faces])
    across = np.stack([face.across for face in faces])
    return LitScene(faces, corner, across, np.stack([face.down for face in faces]), light)


def joined(scene: LitScene, more: LitScene) -> LitScene:
    """Join the faces and the light of two scenes, both with light that may change."""
    if scene.light is None or more.light is None:
        raise ValueError("expected two scenes with light of their own, found one with fixed light")
    before = len(scene.light)
    return LitScene(
        (*scene.faces, *(moved_on(face, before) for face in more.faces)),
        np.concatenate([scene.corner, more.corner]),
        np.concatenate([scene.across, more.across]),
        np.concatenate([scene.down, more.down]),
        np.concatenate([scene.light, more.light]),
    )


def moved_on(face: LitFace, before: int) -> LitFace:
    """Shift a face's index of light points by `count` of another scene."""
    if face.grid is None:
        return face
    first, rows, columns = face.grid
    return LitFace(face.corner, face.across, face.down, face.levels, (first + before, rows, columns))


def halvings(texture: F32) -> tuple[F32, ...]:
    """Return a texture and its halves by averaging, down to a few pixels."""
    levels = [texture]
    while min(levels[-1].shape[:2]) >= 8:
        rows, columns = levels[-1].shape[:2]
        half = cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.float32))
    return tuple(levels)
