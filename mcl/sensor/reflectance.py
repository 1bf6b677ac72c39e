"""Reflectance sensors that look down on a printed floor: a pose sensor that needs no camera.

Each probe says how light the spot under it is. Where the spot is depends on the pose, and how light the floor
is there says the print: black and white are two levels of the reading, with normal noise about both. Near an
edge of the print the reading may be either, which the print's variance about the point tells.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64
from ..floor import FloorImage, bilinear, blur
from ..pose_sensor import EXACT, PoseSpread, Shown, ShownMarks
from ..session import Frame

NAME = "reflectance"
SPOT_M = 0.006  # sd of the spot that a probe sees, and of the errors of its place and of the print
OUTLIERS = 0.05  # share of readings that say nothing: dust, glare, a lifted robot
SHARPNESS = 0.2  # of one reading: those a few millimeters apart err alike, and are not five looks but one
LEVEL = 1.4  # blurs differ by at least this factor, so that few are kept
LEAST_SD = 0.02  # of white minus black
SURE_SD = 0.1  # the same: levels are known no better, as they change with dust, light and the floor's color


@dataclass(frozen=True, slots=True)
class Probe:
    """One sensor: the name of its reading, its place on the robot, what it reads on black and white.

    >>> import maurice_mcl as mcl
    >>> mcl.Probe("left", x_m=0.072, y_m=0.011, black=120, white=780).sd
    0.1
    """

    name: str
    x_m: float  # forward of the robot's center
    y_m: float  # left of it
    black: float = 0.0
    white: float = 1.0
    sd: float = 0.1  # of the reading, as a share of white minus black


@dataclass(frozen=True, slots=True, eq=False)
class Reflectances:
    """What the probes of one frame read, as shares between black (0) and white (1); NaN: no reading."""

    shares: F32  # (P,)


@dataclass(frozen=True, slots=True, eq=False)
class _Print:
    values: F32  # (H, W, 2) how light the print is as a spot sees it, and its variance within the spot
    off: F32  # (2,) both where nothing is known


@dataclass(frozen=True, slots=True, eq=False)
class Reflectance:
    """Probes over a printed floor as a pose sensor, which gives any pose a log-likelihood.

    >>> import numpy as np, maurice_mcl as mcl
    >>> floor = mcl.FloorImage(np.array([[0, 1]] * 2, np.float32).repeat(9, 1), 0.01, np.zeros(3))
    >>> sensor = mcl.Reflectance(floor, (mcl.Probe("left", 0.0, 0.0, black=100, white=900),))
    >>> frame = mcl.Frame(1, 0.0, np.zeros((0, 3)), np.zeros((1, 1, 3), np.uint8), "", {"left": 880.0})
    >>> poses = np.array([[0.03, 0.01, 0], [0.15, 0.01, 0]], np.float32)
    >>> sensor.log_likelihood(sensor.read(frame), poses, np.zeros(2)).round(1).tolist()
    [-1.0, -0.0]
    """

    floor: FloorImage
    probes: tuple[Probe, ...]
    outliers: float = OUTLIERS
    spot_m: float = SPOT_M
    sharpness: float = SHARPNESS  # multiplies the nats of each reading
    said: str = ""  # how the levels came to be, for people
    _prints: dict[int, _Print] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """The key of `sensor.weights`."""
        return NAME

    def read(self, frame: Frame) -> Reflectances | None:
        """Return what the probes of a frame read; None without any reading of theirs."""
        found = [frame.readings.get(probe.name, math.nan) for probe in self.probes]
        if all(math.isnan(value) for value in found):
            return None
        levels = zip(found, self.probes, strict=True)
        shares = [(value - one.black) / (one.white - one.black) for value, one in levels]
        return Reflectances(np.array(shares, np.float32))

    def log_likelihood(
        self, reading: Reflectances, poses: F32, origin: F64, spread: PoseSpread = EXACT
    ) -> F32:
        """Return the log-likelihood (N,) of poses (N, 3) relative to `origin` (2,), in nats; 0 at most."""
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        total = np.zeros(len(poses), np.float32)
        for probe, share in zip(self.probes, reading.shares, strict=True):
            if not np.isnan(share):
                x = poses[:, 0] + cos * np.float32(probe.x_m) - sin * np.float32(probe.y_m)
                y = poses[:, 1] + sin * np.float32(probe.x_m) + cos * np.float32(probe.y_m)
                found = self._print(self._blur_m(probe, spread))
                total += self._nats(probe, share, found, *self.floor.pixels_of(x, y, origin))
        return total

    def propose(self, reading: Reflectances) -> None:
        """Propose nothing: one reading fits half of the floor."""
        return

    def spots(self, pose: F64) -> F64:
        """Return where the probes are (P, 2) when the robot is at a pose (3,) of the map."""
        at = np.array([[one.x_m, one.y_m] for one in self.probes])
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        return np.asarray(pose[:2] + at @ np.array([[cos, sin], [-sin, cos]]), np.float64)

    def shown(self, reading: Reflectances, poses: Mapping[str, F64]) -> Shown:
        """Return what the probes read against the floor at the given poses, and the probes on the map."""
        marks = tuple(
            ShownMarks(f"probes at the {name}", "map", self.spots(pose).astype(np.float32)[:, None])
            for name, pose in poses.items()
        )
        return Shown("; ".join(self.in_words(reading, poses)), marks=marks)

    def in_words(self, reading: Reflectances, poses: Mapping[str, F64]) -> list[str]:
        """Return what each probe reads, and what the floor is at the given poses: a line a probe."""
        lines = []
        floor = {name: self.floor.at(self.spots(pose)) for name, pose in poses.items()}
        for number, (probe, share) in enumerate(zip(self.probes, reading.shares, strict=True)):
            if np.isnan(share):
                lines.append(f"{probe.name} reads nothing")
                continue
            there = [f"at the {name} is {_said(light[number])}" for name, light in floor.items()]
            lines.append(
                f"{probe.name} reads {share:.2f}" + (f", the floor {', '.join(there)}" if there else "")
            )
        return lines

    def _blur_m(self, probe: Probe, spread: PoseSpread) -> float:
        lever_m = math.hypot(probe.x_m, probe.y_m)
        return math.hypot(self.spot_m, spread.position_m, spread.heading_rad * lever_m)

    def _print(self, sd_m: float) -> _Print:
        """Return the print under a spot of about this size; few are kept."""
        step = round(math.log(max(sd_m, self.spot_m) / self.spot_m) / math.log(LEVEL))
        found = self._prints.get(step)
        if found is None:
            found = self._prints[step] = _blurred(self.floor, self.spot_m * LEVEL**step)
        return found

    def _nats(self, probe: Probe, share: np.float32, found: _Print, column: F32, row: F32) -> F32:
        """Return log p(share) (N,) less that of a perfect reading on an even floor."""
        light, variance = bilinear(found.values, column, row, found.off).T
        # nothing is blacker than black or whiter than white: there the level was wrong
        share, sd = np.clip(share, np.float32(0), np.float32(1)), max(probe.sd, SURE_SD)
        noise = np.float32(sd**2)
        spread = noise + variance
        normal = np.sqrt(noise / spread) * np.exp(np.float32(-0.5) * (share - light) ** 2 / spread)
        # outliers are even over the levels and as far again, relative to the peak of the normal distribution
        even = np.float32(self.outliers / (1 - self.outliers) * sd * math.sqrt(2 * math.pi) / 2)
        return np.asarray(np.float32(self.sharpness) * np.log((normal + even) / (1 + even)), np.float32)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a file."""
        numbers = [[one.x_m, one.y_m, one.black, one.white, one.sd] for one in self.probes]
        return {
            "floor": self.floor.values,
            "place": np.array([self.floor.resolution_m, *self.floor.origin]),
            "names": np.array([one.name for one in self.probes]),
            "probes": np.array(numbers),
            "model": np.array([self.outliers, self.spot_m, self.sharpness]),
            "said": np.array(self.said),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Reflectance:
        """Return the sensor of `to_arrays`. ValueError names what is missing or does not fit."""
        wanted = {"floor": 2, "place": 1, "names": 1, "probes": 2, "model": 1, "said": 0}
        for name, axes in wanted.items():
            if name not in arrays or arrays[name].ndim != axes:
                raise ValueError(f"found no {name} of {axes} axes")
        names, numbers, place = arrays["names"], arrays["probes"], arrays["place"]
        if numbers.shape != (len(names), 5) or place.shape != (4,) or arrays["model"].shape != (3,):
            raise ValueError("found arrays that do not fit together")
        floor = FloorImage(np.asarray(arrays["floor"], np.float32), float(place[0]), np.array(place[1:]))
        rows = zip(names, numbers.tolist(), strict=True)
        probes = tuple(Probe(str(name), *row) for name, row in rows)
        outliers, spot_m, sharpness = (float(v) for v in arrays["model"])
        return cls(floor, probes, outliers, spot_m, sharpness, str(arrays["said"]))


def _said(light: float) -> str:
    return "unknown" if math.isnan(light) else f"{light:.2f}"


def _blurred(floor: FloorImage, sd_m: float) -> _Print:
    known = floor.values[~np.isnan(floor.values)]
    mean, variance = (float(known.mean()), float(known.var())) if known.size else (0.5, 0.25)
    light = np.where(np.isnan(floor.values), np.float32(mean), floor.values)
    square = np.where(np.isnan(floor.values), np.float32(mean**2 + variance), light**2)
    sd = sd_m / floor.resolution_m
    light = blur(light, sd)
    values = np.stack([light, np.maximum(blur(square, sd) - light**2, 0)], axis=-1)
    return _Print(values, np.array([mean, variance], np.float32))


# The levels of a probe, from what it read: two normal distributions, and an even one for the edges between.

ROUNDS = 60
APART = 4.0  # the levels lie at least so many of their sds apart, else there is only one
LEAST_SHARE = 0.02  # of the readings on either level
MOST_FITTED = 20_000


@dataclass(frozen=True, slots=True)
class Levels:
    """What a probe reads on black and on white, and how much it varies about them."""

    black: float
    white: float
    sd: float  # as a share of white minus black
    white_share: float  # of the readings


def fit_levels(values: Sequence[float] | F64) -> Levels:
    """Find the two levels of a probe's readings (n,); higher is white. ValueError where they show only one.

    >>> import numpy as np
    >>> from maurice_mcl.sensor.reflectance import fit_levels
    >>> levels = fit_levels(np.array([98, 102, 101, 100, 899, 901, 905, 100] * 9))
    >>> round(levels.black), round(levels.white)
    (100, 902)
    """
    found: F64 = np.asarray(values, np.float64)
    found = found[np.isfinite(found)]
    found = found[:: max(1, len(found) // MOST_FITTED)]
    low, high = (float(v) for v in np.quantile(found, (0.02, 0.98))) if len(found) else (0.0, 0.0)
    if len(found) < 10 or high <= low:
        raise ValueError(f"found {len(found)} readings that show no two levels")
    levels, sds, shares = np.array([low, high]), np.full(2, (high - low) / 6), np.array([0.45, 0.45])
    for _ in range(ROUNDS):
        at = (found[:, None] - levels) / sds
        normal = shares * np.exp(-0.5 * at**2) / (sds * math.sqrt(2 * math.pi))
        total = normal.sum(axis=1, keepdims=True) + (1 - shares.sum()) / (high - low)
        mine = normal / total
        weight = np.maximum(mine.sum(axis=0), 1e-9)
        levels = (mine * found[:, None]).sum(axis=0) / weight
        least = LEAST_SD / 2 * max(abs(levels[1] - levels[0]), 1e-9)
        sds = np.maximum(np.sqrt((mine * (found[:, None] - levels) ** 2).sum(axis=0) / weight), least)
        shares = np.clip(weight / len(found), 0.01, 0.98) * 0.99
    between = float(levels[1] - levels[0])
    if between < APART * sds.max() or weight.min() < LEAST_SHARE * len(found):
        raise ValueError(f"found readings about {np.median(found):.4g} that show no two levels")
    sd = max(float(math.sqrt(np.mean(sds**2))) / between, LEAST_SD)
    return Levels(float(levels[0]), float(levels[1]), sd, float(weight[1] / weight.sum()))
