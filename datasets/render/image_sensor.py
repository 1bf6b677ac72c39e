"""The image sensor: lens faults, exposure, tone curve, noise, and slow drift of gain and white balance."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.values import F32, U8, Domain, stream

from ..tasks import SimPurpose
from .conditions import Conditions


@dataclass(frozen=True, slots=True)
class Sensor:
    """A camera like the CMUcam2's; black level and noise are set by the thesis's covered lens (figure 14)."""

    black: tuple[float, float, float] = (27.8, 27.2, 28.6)  # level of each channel in the dark
    read_noise: float = 9.6  # sd in levels of each pixel and channel
    row_noise: float = 1.2  # sd in levels of complete rows: cheap power supply
    shot_noise: float = 0.35  # variance in levels a level of signal
    span: float = 212.0  # levels from black to white
    gamma: float = 1 / 2.0  # tone curve of the sensor
    lowest: int = 16  # the CMUcam2 keeps its values within 16 ...
    highest: int = 240  # ... and 240
    white: float = 1.3  # exposed light beyond this gives no more signal
    blur_px: float = 0.75  # sd of the lens's blur ...
    blur_of_px: int = 176  # ... in a picture with this many columns; it grows with the picture
    vignette: float = 0.35  # light lost in the corners
    target: float = 62.0  # levels above black that automatic gain wants on the mean: between the two rooms'
    least_gain: float = 0.4  # what automatic gain does at most to fixed gain
    most_gain: float = 4.0


@dataclass(frozen=True, slots=True)
class Exposure:
    """How one picture is exposed: survey and session each have their own."""

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)  # light gain of R, G, B, white balance included
    automatic: bool = False  # each picture's gain is chosen by its own light, from `gain` on


def draw_exposure(rng: np.random.Generator) -> Exposure:
    """Draw the light and white balance of a camera session: some percent in all, two between colors."""
    common = 1 + 0.05 * float(rng.standard_normal())
    red, green, blue = common * (1 + 0.02 * rng.standard_normal(3))
    return Exposure((float(red), float(green), float(blue)))


def falloff(rows: int, columns: int, lost: float) -> F32:
    """Return how much light reaches each pixel (H, W): 1 in the middle, 1 - `lost` in the corners."""
    y = np.linspace(-1, 1, rows)[:, None]
    x = np.linspace(-1, 1, columns)[None, :]
    return (1 - lost * (x**2 + y**2) / 2).astype(np.float32)


def _through_lens(light: F32, sensor: Sensor) -> F32:
    rows, columns = light.shape[:2]
    blur = sensor.blur_px * columns / sensor.blur_of_px
    shade = falloff(rows, columns, sensor.vignette)[..., None]
    return np.asarray(cv2.GaussianBlur(light, (0, 0), blur) * shade)


def signal_of(light: F32, sensor: Sensor, gain: tuple[float, float, float]) -> F32:
    """Return the signal (..., 3) in levels above black of light (..., 3) behind the lens."""
    exposed = np.clip(light * np.asarray(gain, dtype=np.float32), 0, sensor.white)
    return np.asarray(np.float32(sensor.span) * exposed**sensor.gamma)


def photograph(
    light: F32, sensor: Sensor, exposure: Exposure, rng: np.random.Generator, *, half: bool = False
) -> U8:
    """Turn linear light (H, W, 3) into RGB; with `half`, every other column is read and doubled."""
    behind = _through_lens(light, sensor)
    gain = metered(behind, sensor, exposure) if exposure.automatic else exposure.gain
    if not half:
        return _digitize(signal_of(behind, sensor, gain), sensor, rng)
    read = _digitize(signal_of(behind[:, ::2], sensor, gain), sensor, rng)
    return np.asarray(np.repeat(read, 2, axis=1)[:, : light.shape[1]])


def metered(behind: F32, sensor: Sensor, exposure: Exposure) -> tuple[float, float, float]:
    """Choose the gain that brings the mean signal of this one picture to the target, within its limits."""
    measured, factor = behind[::4, ::4], 1.0
    for _ in range(6):
        red, green, blue = (factor * gain for gain in exposure.gain)
        mean = float(signal_of(measured, sensor, (red, green, blue)).mean())
        target_factor = factor * (sensor.target / max(mean, 1e-3)) ** (1 / sensor.gamma)
        factor = min(max(target_factor, sensor.least_gain), sensor.most_gain)
    red, green, blue = (factor * gain for gain in exposure.gain)
    return red, green, blue


def _digitize(signal: F32, sensor: Sensor, rng: np.random.Generator) -> U8:
    rows, columns = signal.shape[:2]
    sd = np.sqrt(np.float32(sensor.read_noise**2) + np.float32(sensor.shot_noise) * signal)
    noise = sd * rng.standard_normal((rows, columns, 3), dtype=np.float32)
    noise += np.float32(sensor.row_noise) * rng.standard_normal((rows, 1, 1), dtype=np.float32)
    levels = np.rint(signal + np.asarray(sensor.black, dtype=np.float32) + noise)
    return np.asarray(np.clip(levels, sensor.lowest, sensor.highest), dtype=np.uint8)


def covered(sensor: Sensor, size: tuple[int, int], rng: np.random.Generator) -> U8:
    """Take a picture with the lens covered: black level and noise alone; `size` is rows, columns."""
    return _digitize(np.zeros((*size, 3), dtype=np.float32), sensor, rng)


# Slow drift of gain and white balance within a session: smooth, seeded, within its bound.

PERIODS = (140.0, 61.0)  # updates of a slow and a less slow swing; no ratio of small numbers
SHARES = (0.7, 0.3)  # of the bound that each may take


def swings(seed: int, number: int, count: int) -> list[float]:
    """Return `count` smooth functions of the update, each within -1 and 1."""
    phases = stream(Domain.SIMULATOR, seed, 0, SimPurpose.LIGHT_DRIFT).uniform(0, 2 * np.pi, (count, 2))
    waves = np.sin(2 * np.pi * number / np.array(PERIODS) + phases)
    return [float(value) for value in waves @ np.array(SHARES)]


def drifted(exposure: Exposure, conditions: Conditions, seed: int, number: int) -> Exposure:
    """Return the exposure at one update: all colors drift together, and red and blue each separately."""
    common, red, blue = swings(seed, number, 3)
    gain = 1 + conditions.drift * common
    shares = (1 + conditions.tint * red, 1.0, 1 + conditions.tint * blue)
    r, g, b = (before * gain * share for before, share in zip(exposure.gain, shares, strict=True))
    return Exposure((r, g, b), exposure.automatic)
