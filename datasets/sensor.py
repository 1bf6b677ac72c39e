"""From light to numbers: lens faults, exposure, tone curve, black level and noise of a small color camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.typing import F32, U8


@dataclass(frozen=True, slots=True)
class Sensor:
    """A camera like the CMUcam2's. Black level and noise are set by the thesis's covered-lens histogram.

    Figure 14 peaks at about 80 of 256: with 8 levels a bin, that is noise of 10 levels around 28.
    """

    black: tuple[float, float, float] = (27.8, 27.2, 28.6)  # level of each channel in the dark
    read_noise: float = 9.6  # sd in levels of each pixel and channel
    row_noise: float = 1.2  # sd in levels of whole rows: cheap power supply
    shot_noise: float = 0.35  # variance in levels a level of signal
    span: float = 212.0  # levels from black to white
    gamma: float = 1 / 2.0  # tone curve of the sensor
    lowest: int = 16  # the CMUcam2 keeps its values within 16 ...
    highest: int = 240  # ... and 240
    blur_px: float = 0.75  # sd of the lens's blur
    vignette: float = 0.35  # light lost in the corners


@dataclass(frozen=True, slots=True)
class Exposure:
    """Settings that stay fixed for one outing: survey and session each have their own."""

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)  # light gain of R, G, B, white balance included


def draw_exposure(rng: np.random.Generator, gain_sd: float = 0.03, balance_sd: float = 0.012) -> Exposure:
    """Draw the light and white balance of an outing: a few percent in all, one percent between colors."""
    common = 1 + gain_sd * float(rng.standard_normal())
    red, green, blue = common * (1 + balance_sd * rng.standard_normal(3))
    return Exposure((float(red), float(green), float(blue)))


def falloff(rows: int, columns: int, lost: float) -> F32:
    """Give how much light reaches each pixel (H, W): 1 in the middle, 1 - `lost` in the corners."""
    y = np.linspace(-1, 1, rows)[:, None]
    x = np.linspace(-1, 1, columns)[None, :]
    return (1 - lost * (x**2 + y**2) / 2).astype(np.float32)


def photograph(light: F32, sensor: Sensor, exposure: Exposure, rng: np.random.Generator) -> U8:
    """Turn linear light (H, W, 3) into the picture (H, W, 3) RGB that the camera hands over."""
    rows, columns = light.shape[:2]
    through = (
        cv2.GaussianBlur(light, (0, 0), sensor.blur_px) * falloff(rows, columns, sensor.vignette)[..., None]
    )
    exposed = np.clip(through * np.asarray(exposure.gain, dtype=np.float32), 0, None)
    signal = sensor.span * np.minimum(exposed, 1.3) ** sensor.gamma
    return digitize(np.asarray(signal, dtype=np.float32), sensor, rng)


def digitize(signal: F32, sensor: Sensor, rng: np.random.Generator) -> U8:
    """Add black level and noise to a signal (H, W, 3) in levels, and cut it to the sensor's range."""
    rows, columns = signal.shape[:2]
    sd = np.sqrt(np.float32(sensor.read_noise**2) + np.float32(sensor.shot_noise) * signal)
    noise = sd * rng.standard_normal((rows, columns, 3), dtype=np.float32)
    noise += np.float32(sensor.row_noise) * rng.standard_normal((rows, 1, 1), dtype=np.float32)
    levels = np.rint(signal + np.asarray(sensor.black, dtype=np.float32) + noise)
    return np.asarray(np.clip(levels, sensor.lowest, sensor.highest), dtype=np.uint8)


def covered(sensor: Sensor, size: tuple[int, int], rng: np.random.Generator) -> U8:
    """Take a picture with the lens covered: black level and noise alone; `size` is rows, columns."""
    return digitize(np.zeros((*size, 3), dtype=np.float32), sensor, rng)
