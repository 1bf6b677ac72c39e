"""Keypoints of a picture: SIFT with root descriptors, on brightness of equal contrast."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, cast

import cv2
import numpy as np

from ...values import F32, U8

MOST_KEYPOINTS = 220  # keypoints of one picture
SIFT_CONTRAST = 0.02  # SIFT's threshold, of a picture whose contrast was made equal
BRIGHTNESS_MEAN, BRIGHTNESS_SD = 128.0, 45.0  # of the brightness that keypoints are sought in
LEAST_BRIGHTNESS_SD = 4.0  # a standard deviation of brightness below this holds nothing but noise
DESCRIPTOR_LENGTH = 128  # of a descriptor


@dataclass(frozen=True, slots=True, eq=False)
class Keypoints:
    """K keypoints of one picture."""

    pixels: F32  # (K, 2) columns and rows; the middle of the first pixel is (0, 0)
    descriptors: F32  # (K, 128) of length one: their product is a cosine


_OF_THREAD = threading.local()  # a detector each: OpenCV does not say that threads may share one


def _sift() -> Any:
    if not hasattr(_OF_THREAD, "sift"):
        sift: Any = cast(Any, cv2).SIFT_create  # the stubs of OpenCV lack enable_precise_upscale
        _OF_THREAD.sift = sift(
            nfeatures=MOST_KEYPOINTS, contrastThreshold=SIFT_CONTRAST, enable_precise_upscale=True
        )
    return _OF_THREAD.sift


def keypoints_of(image: U8) -> Keypoints:
    """Find the keypoints of a picture (H, W, 3); none in a blank one.

    Brightness is stretched to one contrast first, so that a dim picture keeps its keypoints.

        >>> import numpy as np
        >>> keypoints_of(np.zeros((48, 64, 3), np.uint8)).pixels.shape
        (0, 2)
    """
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    deviation = float(gray.std())
    if deviation < LEAST_BRIGHTNESS_SD:
        return Keypoints(np.zeros((0, 2), np.float32), np.zeros((0, DESCRIPTOR_LENGTH), np.float32))
    equal = (gray - gray.mean()) * (BRIGHTNESS_SD / deviation) + BRIGHTNESS_MEAN
    points, described = _sift().detectAndCompute(np.clip(equal, 0, 255).astype(np.uint8), None)
    if described is None or not len(points):
        return Keypoints(np.zeros((0, 2), np.float32), np.zeros((0, DESCRIPTOR_LENGTH), np.float32))
    strongest = np.argsort([-point.response for point in points], kind="stable")[:MOST_KEYPOINTS]
    pixels = np.array([points[k].pt for k in strongest], np.float32).reshape(-1, 2)
    return Keypoints(pixels, root_descriptors(np.asarray(described, np.float32)[strongest]))


def root_descriptors(described: F32) -> F32:
    """Return the square roots of descriptors (K, D) that sum to one: RootSIFT (Arandjelovic 2012)."""
    total = np.maximum(described.sum(axis=1, keepdims=True), 1e-6)
    return np.asarray(np.sqrt(described / total), np.float32)
