"""The camera's noise floor from pictures taken with the lens covered (thesis 3.3, figures 13 and 14)."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..arrays import F64, U8
from ..sensor.descriptors.channel import BINS, LOW, WIDTH, camera_histogram

COLORS = ("red", "green", "blue")
LIT = 64.0  # a mean level above this is no covered lens


@dataclass(frozen=True, slots=True)
class Peak:
    """The highest bin of one color; counts are 256 times the share of pixels."""

    color: str
    count: float  # mean over the frames
    sd: float  # between frames, of that bin's count
    first_value: int  # the pixel values that the bin holds, from this ...
    last_value: int  # ... to this
    largest_bin_sd: float  # between frames, of the bin that varies most


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFloor:
    """What a camera measures in the dark."""

    frames: int
    mean: F64  # (84,) camera histogram, mean over the frames
    sd: F64  # (84,) its standard deviation between frames; nan for one frame
    level: F64  # (3,) mean pixel value of red, green and blue
    example: U8  # (H, W, 3) the first frame

    def peaks(self) -> tuple[Peak, ...]:
        """Return the highest bin of each color; of equal ones the darkest."""
        rows = zip(COLORS, self.mean.reshape(3, BINS), self.sd.reshape(3, BINS), strict=True)
        return tuple(_peak(*row) for row in rows)

    @property
    def lit(self) -> bool:
        """Return whether it is too bright for a covered lens."""
        return bool(self.level.mean() > LIT)


def noise_floor(pictures: Iterable[U8]) -> NoiseFloor:
    """Average the histograms of pictures (H, W, 3), one by one (Welford 1962). ValueError for none."""
    count, example = 0, None
    mean, squares, level = np.zeros(3 * BINS), np.zeros(3 * BINS), np.zeros(3)
    for picture in pictures:
        example = picture if example is None else example
        count += 1
        histogram = camera_histogram(picture).astype(np.float64)
        before = histogram - mean
        mean = mean + before / count
        squares = squares + before * (histogram - mean)
        level = level + (picture.reshape(-1, 3).mean(axis=0) - level) / count
    if example is None:
        raise ValueError("found no picture, expected some taken with the lens covered")
    sd = np.sqrt(squares / (count - 1)) if count > 1 else np.full(3 * BINS, np.nan)
    return NoiseFloor(count, mean, sd, level, example)


def stretched(picture: U8) -> U8:
    """Stretch a picture's contrast (H, W, 3) so that its darkest value is 0 and its brightest 255."""
    low, high = int(picture.min()), int(picture.max())
    scaled = (picture.astype(np.float64) - low) * (255 / max(high - low, 1))
    return np.round(scaled).astype(np.uint8)


def _peak(color: str, mean: F64, sd: F64) -> Peak:
    best = int(mean.argmax())
    first = LOW + WIDTH * best
    last = first + WIDTH - (0 if best == BINS - 1 else 1)
    return Peak(color, float(mean[best]), float(sd[best]), first, last, float(sd.max()))
