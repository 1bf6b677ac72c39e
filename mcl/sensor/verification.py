"""Verification: the references that a picture fits best are compared with it again, keypoint by keypoint.

Channels count what is in a picture, and many places have as much of each color. Whether a picture shows the
same things as a reference is told by its keypoints: by how many match one of the reference's. To verify the
first that were found, and no others, is how large collections are searched (Philbin et al. 2007, section 5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..values import (
    EXACT,
    F32,
    F64,
    I32,
    U8,
    Beside,
    Frame,
    PoseProposal,
    PoseSpread,
    Shown,
    ShownMarks,
    wrap,
)
from .descriptors.registry import reduced
from .landmarks.features import Keypoints, keypoints_of
from .landmarks.matching import mutual

KEYPOINTS = "keypoints"  # the key of `sensor.weights`: nats a match
VERIFIED = 12  # references of a picture: the right one is among them in 73 to 100 % of real pictures
MOST_MATCHES = 60  # that count: pictures of one place have as many, however alike they are
MOST_KEYPOINTS = 500_000  # of a library: 130 MB; of a larger one the strongest of each picture
ARRAYS = ("poses", "pixels", "descriptors", "first")  # of a file
MOST_TURNED_RAD = float(np.radians(45))  # a reference that looks elsewhere is not beside the estimate
BESIDE = "Camera beside the reference at the estimate: lines join keypoints that match"


@dataclass(frozen=True, slots=True, eq=False)
class PictureKeypoints:
    """What was read in one picture."""

    image: U8  # (H, W, 3), to be shown
    keypoints: Keypoints


@dataclass(frozen=True, eq=False)
class KeypointMatches:
    """A sensor model over the keypoints of L references; see `maurice_mcl.PoseSensor`.

    It weighs references, with which particles are compared; of a pose by itself it says nothing.
    """

    poses: F64  # (L, 3) of the references
    pixels: F32  # (T, 2) of the keypoints of all references, one reference after another
    descriptors: NDArray[np.float16]  # (T, 128) of length one
    first: I32  # (L + 1,) number of each reference's first keypoint, and T
    name: ClassVar[str] = KEYPOINTS
    pictures: ClassVar[tuple[str, ...]] = (BESIDE,)

    @classmethod
    def of(cls, poses: F64, keypoints: Sequence[Keypoints]) -> KeypointMatches:
        """Return the sensor of references (L, 3) with their pictures' keypoints, the strongest first."""
        most = MOST_KEYPOINTS // max(len(poses), 1)
        counts = [len(points.pixels[:most]) for points in keypoints]
        return cls(
            poses,
            np.concatenate([points.pixels[:most] for points in keypoints]),
            np.concatenate([points.descriptors[:most] for points in keypoints]).astype(np.float16),
            np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        )

    @property
    def summary(self) -> str:
        """One line for tables."""
        return f"{len(self.pixels):,} in {len(self.poses):,} pictures, the best {VERIFIED} verified"

    def read(self, frame: Frame) -> PictureKeypoints:
        """Find the keypoints of a picture."""
        image = reduced(frame.image)
        return PictureKeypoints(image, keypoints_of(image))

    def verify(self, reading: PictureKeypoints, log_likelihood: F32) -> F32:
        """Return how many matches each reference (L,) lacks beside the one with the most.

        The first by their log-likelihood (L,) are compared; all others lack as many as the worst of these.
        """
        best = np.argsort(-log_likelihood, kind="stable")[:VERIFIED]
        matches = np.array([len(own) for own, _ in self._matched(reading.keypoints, best)], np.float32)
        matches = np.minimum(matches, MOST_MATCHES)
        lacking = matches.max(initial=0) - matches
        lacks = np.full(len(log_likelihood), lacking.max(initial=0), np.float32)
        lacks[best] = lacking
        return lacks

    def log_likelihood(
        self, reading: PictureKeypoints, poses: F32, origin: F64, spread: PoseSpread = EXACT
    ) -> F32:
        """Return 0 (N,): poses (N, 3) are weighed by the references that they are compared with."""
        return np.zeros(len(poses), np.float32)

    def propose(self, reading: PictureKeypoints) -> PoseProposal | None:
        """Return None: references are no poses."""
        return None

    def shown(self, reading: PictureKeypoints, poses: Mapping[str, F64]) -> Shown:
        """Return the picture beside that of the reference at the estimate, with the keypoints that match."""
        entry = self._at(poses["estimate"])
        own, other = next(iter(self._matched(reading.keypoints, np.array([entry]))))
        beside = Beside(reading.image, entry)
        there = self.pixels[self.first[entry] + other] + np.array([beside.right_px, 0], np.float32)
        lines = np.stack([reading.keypoints.pixels[own], there], axis=1)
        marks = ShownMarks("matches", BESIDE, lines, np.ones(len(lines), np.bool_))
        words = f"{len(own)} of {len(reading.keypoints.pixels)} keypoints match the reference at the estimate"
        words += f" (lines); by chance some do, and more than {MOST_MATCHES} count as {MOST_MATCHES}."
        return Shown(words, {BESIDE: beside}, (marks,))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a file."""
        return {name: getattr(self, name) for name in ARRAYS}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> KeypointMatches:
        """Return the sensor of `to_arrays`. KeyError and ValueError for arrays that are not."""
        poses, pixels, descriptors, first = (arrays[name] for name in ARRAYS)
        if len(first) != len(poses) + 1 or not len(pixels) == len(descriptors) == first[-1]:
            raise ValueError("found keypoints of other references")
        return cls(poses, pixels, descriptors, first)

    def _matched(
        self, keypoints: Keypoints, entries: NDArray[np.intp]
    ) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Return the numbers of the keypoints that match each of some references', and of the reference's."""
        firsts, lasts = self.first[entries], self.first[entries + 1]
        rows = [self.descriptors[a:b] for a, b in zip(firsts.tolist(), lasts.tolist(), strict=True)]
        # one product with all of them: many small ones cost more
        product = keypoints.descriptors @ np.concatenate(rows).astype(np.float32).T
        parts = np.split(product, np.cumsum(lasts - firsts)[:-1], axis=1)
        none = np.zeros(0, np.intp)
        return [mutual(part)[:2] if part.size else (none, none) for part in parts]

    def _at(self, pose: F64) -> int:
        """Return the number of the reference nearest to a pose (3,) of those that look where it does."""
        away_m = np.hypot(*(self.poses[:, :2] - pose[:2]).T)
        turned = np.abs(wrap(self.poses[:, 2] - pose[2]))
        return int(np.lexsort((turned, away_m, turned > MOST_TURNED_RAD))[0])
