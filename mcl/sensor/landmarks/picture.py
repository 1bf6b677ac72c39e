"""What people are shown of one picture: matches that agree and that do not, and where landmarks should be."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...arrays import F32, F64, U8, Bool
from ...pose_sensor import Shown, ShownMarks
from .camera import project
from .landmark_set import LandmarkSet

AGREES_PX = 4.0  # a match nearer than this to where it should be agrees
FARTHEST_PX = 60.0  # lines longer than this to where a landmark should be are not drawn
PICTURE = "Keypoints that match landmarks: green agree with the estimate, red do not"


def errors_at(landmarks: LandmarkSet, pixels: F32, matched: NDArray[np.intp], pose: F64) -> tuple[F32, F32]:
    """Return where matched landmarks (K,) fall for a pose (3,): pixels (K, 2), and how far off (K,)."""
    points = (landmarks.points[matched] - [pose[0], pose[1], 0.0]).astype(np.float32)
    there, _ = project(landmarks.fit.camera, np.array([[0.0, 0.0, pose[2]]], np.float32), points)
    fallen = np.ascontiguousarray(there[:, 0].T)
    return fallen, np.hypot(*(fallen - pixels).T).astype(np.float32)


def shown_of(
    landmarks: LandmarkSet,
    image: U8 | None,
    pixels: F32,
    matched: NDArray[np.intp],
    poses: Mapping[str, F64],
) -> Shown:
    """Return what to show of matches (K,) at pixels (K, 2), judged by the estimate."""
    pictures = {} if image is None else {PICTURE: image}
    places = landmarks.points[matched][:, None, :2].astype(np.float32)
    agrees: Bool | None = None
    words, marks = f"{len(matched)} keypoints match landmarks", []
    for name, pose in poses.items():
        fallen, off = errors_at(landmarks, pixels, matched, pose)
        if name == "estimate":
            agrees = off < AGREES_PX
            words = f"{int(agrees.sum())} of {len(matched)} matched landmarks agree"
        near = off < FARTHEST_PX
        lines = np.stack([pixels[near], fallen[near]], axis=1)
        judged = None if agrees is None or name != "estimate" else agrees[near]
        marks.append(ShownMarks(f"to where the {name} has them", PICTURE, lines, judged))
    found = ShownMarks("matched keypoints", PICTURE, pixels[:, None, :], agrees)
    marks += [found, ShownMarks("matched landmarks", "map", places, agrees)]
    return Shown(words, pictures, tuple(marks))
