"""Whether another light explains a picture.

That is: how much brighter it is than the references at the true place, how well it would have fitted them
with that taken out, and whether the same parts of the view are the light ones: another light leaves that as
it is, something in view does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...sensor.descriptors.chromaticity import BLACK
from ...sensor.descriptors.tiny import Tiny
from ...values.arrays import F64, U8
from ...values.session import Frame
from .around import PlaceFit, Surroundings, layouts_of

LEAST_LEVEL = 2.0  # above black; a darker picture has no usable brightness
NOTABLE = 0.1  # log of the brightness, from which on the picture is corrected and compared again


@dataclass(frozen=True, slots=True)
class LightFit:
    """One picture beside what the references at the true place make expect."""

    ratio: float  # log of its brightness over the expected one: negative where it is darker
    level: float  # mean gray level of the picture
    expected: float  # and that of the references
    cost: float  # nats of the true place, as `PlaceFit.cost`, of the corrected picture
    behind: float  # and as `PlaceFit.behind`
    colors: float = 1.0  # share of `ratio` by which the least changed of red, green and blue changed


def mean_level(image: U8) -> float:
    """Return the mean gray level of a picture, 0 to 255; NaN for one without pixels."""
    return sum(cv2.mean(image)[:3]) / 3 if image.size else float("nan")


def light_fit(around: Surroundings, image: U8, truth: F64, estimate: F64, fit: PlaceFit) -> LightFit | None:
    """Compare a picture's brightness with that expected at the truth (3,); None where not known."""
    expected = around.expected_levels(truth)
    if expected is None:
        return None
    levels = image.reshape(-1, 3).mean(axis=0)
    over, wanted = (np.maximum(one - BLACK, LEAST_LEVEL) for one in (levels, expected))
    ratio = float(np.log(over.sum() / wanted.sum()))
    if abs(ratio) < NOTABLE:
        return LightFit(ratio, float(levels.mean()), float(expected.mean()), fit.cost, fit.behind)
    brighter = np.clip((image - BLACK) * (wanted / over) + BLACK, 0, 255).astype(np.uint8)
    sensor = around.sensor
    seen = sensor.see(Frame(0, 0.0, np.empty((0, 3)), brighter, ""))
    again = around.fit(seen, truth, estimate)
    colors = float((np.log(over / wanted) / ratio).min())
    cost, behind = (fit.cost, fit.behind) if again is None else (again.cost, again.behind)
    return LightFit(ratio, float(levels.mean()), float(expected.mean()), cost, behind, colors)


def layout_fit(around: Surroundings, image: U8, truth: F64) -> float | None:
    """Correlate a picture's layout with the expected one; 0 for an even picture, None where not known."""
    expected = around.expected_layout(truth) if image.size else None
    if expected is None:
        return None
    seen = layouts_of(Tiny().describe(image)[None])[0]
    return float(np.corrcoef(seen, expected)[0, 1]) if seen.std() > 0 < expected.std() else 0.0
