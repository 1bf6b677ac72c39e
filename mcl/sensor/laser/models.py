"""Models of a laser: the nats of a reading at many poses. Ours, and the three of AMCL by its formulas."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...values.arrays import F32, F64, U8, Bool
from ...values.occupancy import OccupancyMap
from .field import Field, distances_m
from .parameters import LaserParameters
from .rays import Rays
from .reading import LaserReading

# Ours. Fitted to the first halves of four CARMEN logs, maps from every other of their scans.
SIGMA_M = 0.1
OUTLIER = 0.1  # worth of a beam that ends nowhere near what the map has, relative to the best
UNKNOWN_NATS = -0.5  # of a beam that ends where nobody has been: neither right nor wrong
INDEPENDENT_BEAMS = 30.0  # beams of a scan share their errors: more of them count no more than these

CONVERGED_M = 0.5  # AMCL skips beams only where all particles are this near to their mean, along each axis
MOST_FIELDS = 8  # that are kept

FieldKey = tuple[str, float, float]  # model, standard deviation in meters, reach in meters


@dataclass(frozen=True, eq=False)
class LaserMap:
    """A map as the models need it; each part is made when first asked for."""

    occupancy: OccupancyMap
    parameters: LaserParameters
    fields: dict[FieldKey, Field] = field(default_factory=dict)

    @cached_property
    def distances(self) -> Field:
        """How far each cell is from the nearest occupied one, in meters."""
        most_m, occupancy = self.parameters.laser_likelihood_max_dist, self.occupancy
        return Field(distances_m(occupancy, most_m), 0.0, 1.0, most_m, occupancy.cell_m, occupancy.corner)

    @cached_property
    def rays(self) -> Rays:
        """Rays that end as AMCL's: at occupied and unknown cells, and at the map's edge."""
        return Rays.of(self.occupancy, unknown_blocks=True)

    def field(self, model: str, sd_m: float, max_m: float) -> Field:
        """Return the field of a model for errors of `sd_m`, and a laser that reaches `max_m`."""
        key = (model, sd_m, max_m)
        known = self.fields.get(key)
        if known is None:
            if len(self.fields) >= MOST_FIELDS:
                self.fields.clear()
            known = self.fields[key] = self._field(model, sd_m, max_m)
        return known

    def _field(self, model: str, sd_m: float, max_m: float) -> Field:
        if model == "calibrated":
            worth = worth_of(self.distances.values, self.occupancy.unknown, sd_m)
            return Field.of(worth, UNKNOWN_NATS, self.occupancy)
        near = _near(self.distances.values, sd_m)
        value_of = _cubed if model == "likelihood_field" else np.log
        pz = np.asarray(self.parameters.z_hit * near + self.parameters.z_rand / max_m, np.float32)
        worth = np.asarray(value_of(pz), np.float32)
        outside = self.pz(self.parameters.laser_likelihood_max_dist, sd_m, max_m)
        return Field.of(worth, float(value_of(np.float64(outside))), self.occupancy)

    def pz(self, distance_m: float, sd_m: float, max_m: float) -> float:
        """Return AMCL's likelihood of a beam that ends at a distance from the nearest occupied cell."""
        p = self.parameters
        return float(p.z_hit * np.exp(-0.5 * (distance_m / sd_m) ** 2) + p.z_rand / max_m)


def worth_of(distances: F32 | U8, unknown: Bool, sd_m: float) -> F32:
    """Return our nats (H, W), <= 0, of a beam by how far the cell where it ends is from what is occupied."""
    worth: F32 = np.log(_near(distances, sd_m) * np.float32(1 - OUTLIER) + np.float32(OUTLIER))
    worth[unknown] = np.maximum(worth[unknown], np.float32(UNKNOWN_NATS))
    return worth


def _near(distances: F32 | U8, sd_m: float) -> F32:
    near: F32 = np.exp(np.square(distances) / np.float32(-2 * sd_m**2))
    return near


def calibrated(there: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return nats (N,) that are worth what they say; unknown space is neutral."""
    sd_m = float(np.hypot(SIGMA_M, spread_m))
    nats = there.field("calibrated", sd_m, 0.0).sums(reading.ends, poses, origin)
    return nats * _share(reading)


def nats_of_beams(there: LaserMap, reading: LaserReading, ends: F64) -> F32:
    """Return the nats (K,) of the beams that hit something, which end at (K, 2) in the map's frame."""
    return there.field("calibrated", SIGMA_M, 0.0).at(ends) * _share(reading)


def _share(reading: LaserReading) -> np.float32:
    return np.float32(min(1.0, INDEPENDENT_BEAMS / reading.hits.sum()))


def likelihood_field(there: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return AMCL's: the log of 1 + the sum of pz^3, relative to the best that there could be."""
    sd_m, max_m, ends = there.parameters.sigma_hit + spread_m, reading.max_m, reading.ends
    total = there.field("likelihood_field", sd_m, max_m).sums(ends, poses, origin)
    best = len(ends) * there.pz(0.0, sd_m, max_m) ** 3
    return np.log1p(total) - np.float32(np.log1p(best))


def likelihood_field_prob(
    there: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float
) -> F32:
    """Return AMCL's sum of log pz, without beams that few of a converged cloud's particles agree with."""
    p, ends = there.parameters, reading.ends
    sd_m, max_m = p.sigma_hit + spread_m, reading.max_m
    lookup, best = there.field("likelihood_field_prob", sd_m, max_m), np.log(there.pz(0.0, sd_m, max_m))
    if not (p.do_beamskip and _converged(poses)):
        return lookup.sums(ends, poses, origin) - np.float32(len(ends) * best)
    nats = lookup.each(ends, poses, origin)
    agrees = (nats > np.log(there.pz(p.beam_skip_distance, sd_m, max_m))).mean(axis=0)
    kept = agrees > p.beam_skip_threshold
    if reading.size - kept.sum() >= reading.size * p.beam_skip_error_threshold:
        kept[:] = True  # the cloud may have converged to a wrong place
    return np.asarray((nats[:, kept] - np.float32(best)).sum(axis=1), np.float32)


def beam(there: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return AMCL's by ray casting: the log of 1 + the sum of pz^3, relative to a bound of it."""
    p, measured, max_m = there.parameters, reading.ranges_m, reading.max_m
    sd_m = np.float32(p.sigma_hit + spread_m)
    lasers = _lasers(poses, origin, reading.scan.mount)
    ahead = measured - there.rays.cast(lasers, reading.angles_rad - reading.scan.mount[2], max_m)
    short = np.asarray(p.z_short * p.lambda_short * np.exp(-p.lambda_short * measured), np.float32)
    rest = np.where(reading.hits, p.z_rand / max_m, p.z_max).astype(np.float32)
    pz = np.float32(p.z_hit) * np.exp(np.square(ahead / sd_m) * np.float32(-0.5))
    pz += rest + short * (ahead < 0)
    best = _cubed(p.z_hit + rest + short).sum(dtype=np.float64)
    return np.asarray(np.log1p(_cubed(pz).sum(axis=1)) - np.log1p(best), np.float32)


Model = Callable[[LaserMap, LaserReading, F32, F64, float], F32]
MODELS: Mapping[str, Model] = {
    "calibrated": calibrated,
    "likelihood_field": likelihood_field,
    "likelihood_field_prob": likelihood_field_prob,
    "beam": beam,
}


def _lasers(poses: F32, origin: F64, mount: F64) -> F64:
    """Return where the laser of a robot at poses (N, 3) off origin is, in the map's frame."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * mount[0] - s * mount[1] + origin[0]
    y = poses[:, 1] + s * mount[0] + c * mount[1] + origin[1]
    return np.stack([x, y, poses[:, 2] + mount[2]], axis=1).astype(np.float64)


def _converged(poses: F32) -> bool:
    return bool((np.abs(poses[:, :2] - poses[:, :2].mean(axis=0)) <= CONVERGED_M).all())


def _cubed(values: Any) -> Any:
    return values * values * values
