"""The CMUcam2's histogram, of a picture made ready in several ways (thesis 3.3, 4.2.1 and 4.2.2).

- `color`: of the picture itself, the thesis's first feature. Cheap, but blind to where in the picture.
- `edges`: of the edge image, Sobel's magnitude a color (figures 51 to 55). Knows less of the light's color.
- `blurred`: of a blurred picture, without the sensor's noise: one reading of the thesis's "smoothing".
- `smoothed`: the other reading, smoothed over neighboring bins (figures 47 to 50): a little more light moves
  pixels into the next bin. The thesis's kernel is not known.
- `cumulative`: how many pixels are darker than each level (Stricker and Orengo 1995), very likely the
  thesis's "summation histogram" (figure 43); differences add up to the earth mover's distance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from ...values import F32, U8

BINS = 28
LOW, HIGH, WIDTH = 16, 240, 8
SCALE = 256.0  # value of a bin that holds every pixel ...
CAP = 255.0  # ... capped at the largest value the camera can send
EDGE_BLUR_PX = 1.0  # sd of the Gaussian: pixels with almost no gradient stay below 16, out of the histogram
EDGE_GAIN = 0.5  # a step of 128 gray levels from one pixel to the next then reads 164
BLUR_PX = 2.0  # sd of the Gaussian: removes the sensor's noise, which widens every peak
KERNEL = (0.06, 0.24, 0.40, 0.24, 0.06)  # over bins; sums to one


def camera_histogram(image: U8) -> F32:
    """Return the histogram (84,) of a picture (H, W, 3): 28 bins of red, then green, then blue."""
    planes = [_bins_of(image, plane) for plane in range(3)]
    share = np.concatenate(planes) / np.float32(image.shape[0] * image.shape[1])
    return np.asarray(np.minimum(share * np.float32(SCALE), CAP), np.float32)


def _bins_of(image: U8, plane: int) -> F32:
    counts = cv2.calcHist([image], [plane], None, [256], [0.0, 256.0]).ravel()
    bins = counts[LOW:HIGH].reshape(BINS, WIDTH).sum(axis=1)
    bins[-1] += counts[HIGH]
    return np.asarray(bins, np.float32)


def edge_image(image: U8) -> U8:
    """Return the edge image (H, W, 3) uint8 of a picture (H, W, 3) uint8, each color plane separately."""
    blurred = cv2.GaussianBlur(image, (0, 0), EDGE_BLUR_PX)
    # a plane at a time, so that memory can be reused
    planes = [_gradient(np.asarray(plane, np.uint8)) for plane in cv2.split(blurred)]
    return np.asarray(cv2.merge(planes), np.uint8)


def _gradient(plane: U8) -> U8:
    across = cv2.Sobel(plane, cv2.CV_32F, 1, 0)
    down = cv2.Sobel(plane, cv2.CV_32F, 0, 1)
    magnitude = cv2.magnitude(across, down, across)
    return np.asarray(cv2.convertScaleAbs(magnitude, alpha=EDGE_GAIN), np.uint8)


def blur(image: U8) -> U8:
    """Return a picture (H, W, 3) after a Gaussian blur."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), BLUR_PX), np.uint8)


def smooth(histogram: F32) -> F32:
    """Smooth the bins of each plane (3 x 28,), mirrored at both ends."""
    reach = len(KERNEL) // 2
    planes = np.pad(histogram.reshape(3, BINS), ((0, 0), (reach, reach)), mode="symmetric")
    parts = [np.float32(share) * planes[:, k : k + BINS] for k, share in enumerate(KERNEL)]
    return np.asarray(np.sum(parts, axis=0, dtype=np.float32).ravel(), np.float32)


def accumulate(histogram: F32) -> F32:
    """Return running sums (84,) of each plane of a histogram (84,)."""
    planes = histogram.reshape(3, BINS)
    return np.asarray(planes.cumsum(axis=1, dtype=np.float32).ravel(), np.float32)


def _unchanged(values: Any) -> Any:
    return values


@dataclass(frozen=True, slots=True)
class CameraHistogram:
    """The histogram of a picture that was made ready, and what is made of it. 0.04 to 0.3 ms."""

    name: str
    settings: Mapping[str, Any]  # all that it depends on
    before: Callable[[U8], U8] = _unchanged  # of the picture
    after: Callable[[F32], F32] = _unchanged  # of the histogram
    distance: str = field(default="hellinger", init=False)
    unit: str = field(default="256 x share", init=False)

    def describe(self, image: U8) -> F32:
        """Return the histogram (84,) of a picture (H, W, 3) RGB."""
        return self.after(camera_histogram(self.before(image)))

    def parameters(self) -> dict[str, Any]:
        """Return all that it depends on."""
        return dict(self.settings)


RANGE = {"bins": BINS, "low": LOW, "high": HIGH}
EDGES = {"feature": "histogram of Sobel magnitude", **RANGE, "blur_px": EDGE_BLUR_PX, "gain": EDGE_GAIN}
HISTOGRAMS = (
    CameraHistogram("color", {"feature": "camera histogram", **RANGE}),
    CameraHistogram("edges", EDGES, before=edge_image),
    CameraHistogram(
        "smoothed", {"feature": "smoothed camera histogram", "kernel": list(KERNEL)}, after=smooth
    ),
    CameraHistogram(
        "blurred", {"feature": "camera histogram of a blurred picture", "blur_px": BLUR_PX}, before=blur
    ),
    CameraHistogram("cumulative", {"feature": "cumulative camera histogram", "bins": BINS}, after=accumulate),
)
