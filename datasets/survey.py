"""The survey: reference pictures at every free node in eight headings, and some with the lens covered.

References are placed by hand, so a little off; they are labelled with where they should have been.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import INCH_M, wrap
from maurice_mcl.randomness import Domain, stream

from .render.camera_session import CameraSession
from .seeds import SimPurpose


@dataclass(frozen=True, slots=True)
class Surveyor:
    """How carefully the survey is made."""

    place_sd_m: float = 0.4 * INCH_M  # of each reference along x and y: tape on the floor
    heading_sd_rad: float = float(np.radians(1.5))  # of each reference: set by eye
    headings: int = 8  # per node, from 0 (thesis 3.3)
    covered: int = 10  # pictures with the lens covered, for the noise floor


def reference_poses(nodes: F64, headings: int) -> F64:
    """Give the nominal poses (K * headings, 3) of nodes (K, 2): each node's headings one after the other."""
    angles = wrap(np.arange(headings) * (2 * np.pi / headings))
    poses = [[x, y, angle] for x, y in nodes for angle in angles]
    return np.array(poses)


def placed_poses(nominal: F64, seed: int, surveyor: Surveyor) -> F64:
    """Give where the references (L, 3) really were: each a little off its nominal pose."""
    rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.SURVEY_PLACING)
    sd = np.array([surveyor.place_sd_m, surveyor.place_sd_m, surveyor.heading_sd_rad])
    return np.asarray(nominal + rng.standard_normal(nominal.shape) * sd)


def references(nodes: F64, camera: CameraSession, surveyor: Surveyor) -> Iterator[tuple[F64, U8]]:
    """Give the nominal pose (3,) and the picture of each reference."""
    nominal = reference_poses(nodes, surveyor.headings)
    for number, (label, pose) in enumerate(
        zip(nominal, placed_poses(nominal, camera.seed, surveyor), strict=True)
    ):
        yield label, camera.take(number, pose)
