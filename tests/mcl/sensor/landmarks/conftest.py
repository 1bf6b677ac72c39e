"""A square room with points on its walls, seen by a camera whose every value is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from maurice_mcl.sensor.landmarks.building import NoLandmarks, landmarks_of
from maurice_mcl.sensor.landmarks.camera import PinholeCamera, linearize
from maurice_mcl.sensor.landmarks.features import Keypoints
from maurice_mcl.sensor.landmarks.landmark_set import LandmarkSet
from maurice_mcl.sensor.landmarks.sensor import Landmarks
from maurice_mcl.values.arrays import F32, F64
from maurice_mcl.values.session import Camera

CAMERA = PinholeCamera(176, 144, 188.0, tilt_rad=0.1, height_m=0.24)
KNOWN = Camera("front", 176, 144, float(2 * np.arctan(88 / 188.0)), 0.0, 0.24)
SIDE_M = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Points, and what each looks like."""

    points: F64  # (M, 3)
    descriptors: F32  # (M, 128)

    def keypoints(self, pose: F64, noise_px: float = 0.0, seed: int = 0) -> Keypoints:
        """Return what the camera sees from a pose: walls hide nothing."""
        rng = np.random.default_rng(seed)
        seen = linearize(CAMERA, np.broadcast_to(pose, self.points.shape), self.points)
        u, v = seen.pixels.T
        inside = (seen.depth > 0.2) & (u > 0) & (v > 0) & (u < 175) & (v < 143)
        pixels = seen.pixels[inside] + noise_px * rng.standard_normal((inside.sum(), 2))
        looks = self.descriptors[inside] + 0.02 * rng.random((inside.sum(), 128))
        looks /= np.linalg.norm(looks, axis=1, keepdims=True)
        return Keypoints(pixels.astype(np.float32), looks.astype(np.float32))


@pytest.fixture(scope="session")
def room() -> Room:
    """Return a room with 240 points on its four walls."""
    rng = np.random.default_rng(1)
    along, up = rng.uniform(0, SIDE_M, 240), rng.uniform(0.0, 1.4, 240)
    wall, zero = np.arange(240) % 4, np.zeros(240)
    x = np.choose(wall, [along, along, zero, zero + SIDE_M])
    y = np.choose(wall, [zero, zero + SIDE_M, along, along])
    looks = rng.random((240, 128)) ** 4
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    return Room(np.column_stack([x, y, up]), looks.astype(np.float32))


@pytest.fixture(scope="session")
def references() -> tuple[F64, F64]:
    """Return the stated and the true poses (L, 3) of references: six places, twelve headings."""
    rng = np.random.default_rng(2)
    steps = np.meshgrid([1.0, 1.5, 2.0], [1.2, 1.8], np.arange(12) * np.pi / 6 - np.pi)
    stated = np.column_stack([axis.ravel() for axis in steps])
    return stated, stated + rng.standard_normal(stated.shape) * [0.01, 0.01, np.radians(1.5)]


def built(
    room: Room, references: tuple[F64, F64], known: Camera | None, off: F64 | float = 0.0
) -> LandmarkSet:
    """Build landmarks from what references see, with half a pixel of noise, in a map that is `off` (3,)."""
    stated, true = references
    keypoints = [room.keypoints(pose, 0.5, number) for number, pose in enumerate(true)]
    found = landmarks_of(keypoints, (144, 176), stated + off, known)
    assert not isinstance(found, NoLandmarks), found
    return found


@pytest.fixture(scope="session")
def landmark_set(room: Room, references: tuple[F64, F64]) -> LandmarkSet:
    """Return the room's landmarks, built with a known focal length."""
    return built(room, references, KNOWN)


@pytest.fixture(scope="session")
def landmarks(landmark_set: LandmarkSet) -> Landmarks:
    """Return the sensor over them."""
    return Landmarks(landmark_set)
