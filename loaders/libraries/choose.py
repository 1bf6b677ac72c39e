"""Which pictures of a drive make a library: sharp ones, so far apart and so far turned from each other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.arrays import F64, U8, Bool

METERS = {"in": 0.0254, "ft": 0.3048, "m": 1.0, "cm": 0.01}
FEWEST_JUDGED = 12  # pictures; fewer do not tell what is usual
NOISE_PX = 1.0  # sd of the smoothing that takes noise away
BLUR_PX = 9  # width of the blurring
BLURRED_SDS = 3.5  # robust standard deviations below the median, of the logarithm ...
LESS_SHARP_SDS = 2.0  # ... or so few, where the picture is ...
ONE_WAY_SDS = 3.0  # ... sharper across than along, or along than across, than is usual by so many
LEAST_SD = 0.06  # of the logarithm, where nearly all pictures are equally sharp


@dataclass(frozen=True, slots=True)
class Spacing:
    """How far apart entries are at least: nearer ones look other ways."""

    distance_m: float
    angle_rad: float


def read_every(text: str) -> Spacing:
    """Read `0.4m,45deg`; ValueError for other words."""
    length, _, angle = text.partition(",")
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(in|ft|cm|m)\s*", length)
    turned = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*deg\s*", angle)
    if not found or not turned:
        raise ValueError(f"--every is a length and an angle like 0.4m,45deg or 18in,45deg, found {text!r}")
    every = Spacing(float(found[1]) * METERS[found[2]], float(np.radians(float(turned[1]))))
    if not 0.01 <= every.distance_m <= 1000 or not 0.01 <= every.angle_rad <= np.pi:
        raise ValueError(f"--every goes from 1 cm to 1 km and from 0.6 to 180 deg, found {text!r}")
    return every


def sharpness(image: U8) -> F64:
    """Return the logarithm (2,) of the share of a picture's detail (H, W, 3) that blurring it takes away.

    After Crete et al. (2007): what is blurred already loses little by being blurred again, whatever it shows.
    Down and across count apart, as motion blurs one of them; noise is smoothed away first.
    """
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(gray, (0, 0), NOISE_PX)
    return np.log(np.array([_lost(smooth, axis) for axis in (0, 1)]) + 1e-6)


def _lost(gray: NDArray[Any], axis: int) -> float:
    """Return the share of the changes along an axis that go when the picture is blurred along it."""
    size = (BLUR_PX, 1) if axis else (1, BLUR_PX)
    before, after = (np.abs(np.diff(one, axis=axis)) for one in (gray, cv2.blur(gray, size)))
    return float(np.maximum(before - after, 0).sum() / max(float(before.sum()), 1e-6))


def blurred(sharpnesses: F64) -> Bool:
    """Mark the pictures that are far less sharp (n, 2) than usual, or less sharp and that one way."""
    if len(sharpnesses) < FEWEST_JUDGED:
        return np.zeros(len(sharpnesses), bool)
    below = -_deviations(sharpnesses.min(axis=1))
    one_way = np.abs(_deviations(sharpnesses[:, 0] - sharpnesses[:, 1])) > ONE_WAY_SDS
    return np.asarray((below > BLURRED_SDS) | ((below > LESS_SHARP_SDS) & one_way))


def _deviations(values: F64) -> F64:
    """Return how many robust standard deviations values (n,) are above their median, by median deviation."""
    above = values - np.median(values)
    return np.asarray(above / max(1.4826 * float(np.median(np.abs(above))), LEAST_SD))


def choose(poses: F64, sharpnesses: F64, every: Spacing) -> NDArray[np.intp]:
    """Choose among poses (n, 3), the sharpest first, none near a chosen one; return numbers (k,), rising."""
    cells: dict[tuple[int, int], list[int]] = {}
    chosen: list[int] = []
    for number in np.argsort(-sharpnesses, kind="stable"):
        pose = poses[number]
        cell = _cell(pose, every)
        near = (other for around in _around(cell) for other in cells.get(around, ()))
        if not any(_same(pose, poses[other], every) for other in near):
            cells.setdefault(cell, []).append(int(number))
            chosen.append(int(number))
    return np.sort(np.array(chosen, np.intp))


def _cell(pose: F64, every: Spacing) -> tuple[int, int]:
    x, y = np.floor(pose[:2] / every.distance_m).astype(int).tolist()
    return x, y


def _around(cell: tuple[int, int]) -> Iterator[tuple[int, int]]:
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            yield cell[0] + dx, cell[1] + dy


def _same(a: F64, b: F64, every: Spacing) -> bool:
    """Return whether two poses are nearer than asked, in place and in heading."""
    turned = abs((float(a[2] - b[2]) + np.pi) % (2 * np.pi) - np.pi)
    apart = float(np.hypot(a[0] - b[0], a[1] - b[1]))
    return apart < every.distance_m * (1 - 1e-9) and turned < every.angle_rad * (1 - 1e-9)
