"""The print of a floor as a map: how light the floor is at any point."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from .arrays import F32, F64

MOST_BLUR = 0.25  # of the longer side: a wider blur is all one gray
MOST_WIDE = 256


@dataclass(frozen=True, slots=True, eq=False)
class FloorImage:
    """A picture that lies on the floor; its first row is the lowest in y, its first column in x.

    >>> import numpy as np, maurice_mcl as mcl
    >>> floor = mcl.FloorImage(np.array([[0, 1], [0, 1]], np.float32), 0.1, np.zeros(3))
    >>> floor.at(np.array([[0.05, 0.05], [0.1, 0.1], [0.3, 0.1]])).round(2).tolist()
    [0.0, 0.5, nan]
    """

    values: F32  # (H, W) 0 black to 1 white, NaN where nothing is known
    resolution_m: float  # side of a pixel
    origin: F64  # (3,) x_m, y_m, heading_rad of the outer corner of the first pixel, in the map's frame

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along the rows and depth along the columns, before it is turned."""
        rows, columns = self.values.shape
        return columns * self.resolution_m, rows * self.resolution_m

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return x_min, y_min, x_max, y_max in the map's frame."""
        width, depth = self.size_m
        corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]])
        x_m, y_m, heading = (float(v) for v in self.origin)
        cos, sin = math.cos(heading), math.sin(heading)
        x = x_m + corners[:, 0] * cos - corners[:, 1] * sin
        y = y_m + corners[:, 0] * sin + corners[:, 1] * cos
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    def pixels_of(self, x: F32 | F64, y: F32 | F64, about: F64 | None = None) -> tuple[F32, F32]:
        """Return column and row (N,) of points of the map, in pixels from the first pixel's center.

        Points may be relative to `about` (2,), as those of particles are.
        """
        x_m, y_m, heading = (float(v) for v in self.origin)
        x_m, y_m = (x_m, y_m) if about is None else (x_m - float(about[0]), y_m - float(about[1]))
        cos, sin = math.cos(heading) / self.resolution_m, math.sin(heading) / self.resolution_m
        column = np.float32(cos) * x + np.float32(sin) * y - np.float32(cos * x_m + sin * y_m + 0.5)
        row = np.float32(cos) * y - np.float32(sin) * x - np.float32(cos * y_m - sin * x_m + 0.5)
        return np.asarray(column, np.float32), np.asarray(row, np.float32)

    def at(self, points: F64) -> F32:
        """Return how light the floor is (N,) at points (N, 2) of the map; NaN off it and where unknown."""
        column, row = self.pixels_of(points[:, 0], points[:, 1])
        return bilinear(self.values, column, row, np.array([np.nan], np.float32))[:, 0]

    def blurred(self, sd_m: float) -> FloorImage:
        """Return the floor as a spot of this standard deviation sees it; unknown pixels count for nothing."""
        known = ~np.isnan(self.values)
        share = blur(known.astype(np.float32), sd_m / self.resolution_m)
        light = blur(np.where(known, self.values, 0).astype(np.float32), sd_m / self.resolution_m)
        found = np.divide(light, share, out=np.full_like(light, np.nan), where=share > 1e-3)
        return replace(self, values=found)


def bilinear(values: F32, column: F32, row: F32, outside: F32) -> F32:
    """Return the values (N, C) of an image (H, W, C) between the centers of its pixels, to 1/32 of a pixel.

    `outside` (C,) is given off the image.
    """
    height, width = values.shape[:2]
    off = (column < -0.5) | (row < -0.5) | (column > width - 0.5) | (row > height - 0.5)
    # OpenCV's pictures have a largest width: the points are laid out as a picture of many rows
    laid = max(math.ceil(len(column) / MOST_WIDE), 1), MOST_WIDE
    x = np.resize(np.clip(column, 0, width - 1), laid)
    y = np.resize(np.clip(row, 0, height - 1), laid)
    picture = cv2.remap(values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    found = picture.reshape(MOST_WIDE * laid[0], -1)[: len(column)]
    found[off] = outside
    return np.asarray(found, np.float32)


def blur(values: F32, sd_pixels: float) -> F32:
    """Return an image (H, W) blurred by a Gaussian, which is at most a quarter of the image wide."""
    sd = min(sd_pixels, MOST_BLUR * max(values.shape))
    if sd < 0.05:
        return values
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sd, borderType=cv2.BORDER_REPLICATE), np.float32)
