"""Models of a laser: the nats of a reading at many poses. Ours, and the three of AMCL by its formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ...values import F32, F64, Bool, OccupancyMap, compose
from .field import Distances, Field, Worth, sums_of
from .parameters import LaserParameters
from .rays import Rays
from .reading import LaserReading

# Ours. Chosen on the first halves of four CARMEN logs (intel, aces, freiburg-079, orebro), with maps of every
# other of their scans. On the second halves, with maps of the first, the squared error of a single scan is on
# average 0.7 to 1.1 times what the likelihood says.
SIGMA_M = 0.1
OUTLIER = 0.1  # worth of a beam that ends nowhere near what the map has, relative to the best
LASTING_OUTLIER = 0.25  # the same where many scans are asked: many of them see what the map lacks
SCAN_OUTLIER_NATS = 24.0  # a pose costs no more: a scan may show what the map does not have
UNKNOWN_NATS = -0.5  # of a beam that ends where nobody has been: neither right nor wrong
INDEPENDENT_BEAMS = 60.0  # beams of a scan share their errors: more of them count no more than these

# A cloud explains a scan where its best poses fit so well, of the beams that end where the map is known. At
# the true pose 99 of 100 scans of those logs are worth -0.34 a beam or more; of random poses 1 in 500 is.
EXPLAINED_NATS, BEST_SHARE = -0.45, 0.03
FITS_NATS = -0.3  # a beam, at a pose that is proposed: where nobody has been, some other place fits a little
LEAST_KNOWN = 0.5  # share of the beams: where most end in unknown space, the map cannot tell another place
THROUGH_M, MOST_THROUGH = 0.4, 0.25  # behind a wall by more than noise; share of the beams
TOGETHER_M = 2.0  # standard deviation of a cloud's places
SAMPLED = 200  # particles of a cloud

CONVERGED_M = 0.5  # AMCL skips beams only where all particles are this near to their mean, along each axis
MOST_FIELDS = 16  # that are kept


@dataclass(frozen=True, eq=False)
class LaserMap:
    """A map as the models need it; each part is made when first asked for."""

    occupancy: OccupancyMap
    parameters: LaserParameters
    fields: dict[tuple[str, float, float], Field] = field(default_factory=dict)

    @cached_property
    def walls(self) -> Distances:
        """How far each cell is from the nearest occupied one."""
        most_m = self.parameters.laser_likelihood_max_dist
        return Distances.to(self.occupancy.occupied, self.occupancy.cell_m, most_m)

    @cached_property
    def edges(self) -> Distances:
        """How far each cell is from the nearest unknown one."""
        most_m = self.parameters.laser_likelihood_max_dist
        return Distances.to(self.occupancy.unknown, self.occupancy.cell_m, most_m)

    @cached_property
    def distances(self) -> Field:
        """How far each cell is from the nearest occupied one, in meters."""
        return Field.of([(self.walls, self.walls.meters)], float(self.walls.meters[-1]), self.occupancy)

    @cached_property
    def unknown(self) -> Field:
        """1 where a cell (H, W) is unknown, and beyond the map; else 0."""
        cells = self.occupancy.unknown.astype(np.uint8)
        return Field(cells, 0.0, 1.0, 1.0, self.occupancy.cell_m, self.occupancy.corner)

    @cached_property
    def places(self) -> int:
        """How many places with headings a scan can tell apart: a square meter and 24 degrees are one."""
        return max(round(float(np.count_nonzero(self.occupancy.free)) * self.occupancy.cell_m**2 * 15), 1)

    @cached_property
    def rays(self) -> Rays:
        """Rays that end as AMCL's: at occupied and unknown cells, and at the map's edge."""
        return Rays.of(self.occupancy, unknown_blocks=True)

    @cached_property
    def open_rays(self) -> Rays:
        """Rays that only occupied cells end."""
        return Rays.of(self.occupancy)

    def through_walls(self, reading: LaserReading, pose: F64) -> Bool:
        """Which beams (B,) pass through walls at a pose (3,) in the map's frame."""
        laser, angles = compose(pose, reading.scan.mount), reading.angles_rad - reading.scan.mount[2]
        expected = self.open_rays.cast(laser[None], angles, reading.max_m)[0]
        return np.asarray(reading.hits & (reading.ranges_m > expected + THROUGH_M))

    def field(self, model: str, sd_m: float, max_m: float = 0.0) -> Field:
        """Return the field of a model for errors of `sd_m`, and AMCL's for a laser that reaches `max_m`."""
        return self.kept((model, sd_m, max_m), lambda: self._field(model, sd_m, max_m))

    def kept(self, key: tuple[str, float, float], make: Callable[[], Field]) -> Field:
        """Return a field that is kept by a name, a standard deviation and a reach, made where it is not."""
        if (known := self.fields.get(key)) is not None:
            return known
        if len(self.fields) >= MOST_FIELDS:
            del self.fields[next(iter(self.fields))]  # the one that was made first
        self.fields[key] = make()
        return self.fields[key]

    def _field(self, model: str, sd_m: float, max_m: float) -> Field:
        outside = self.parameters.laser_likelihood_max_dist
        if model == "calibrated":
            return Field.of(worth_of(self.walls, self.edges, sd_m), UNKNOWN_NATS, self.occupancy)
        if model == "lasting":
            lasting = worth_of(self.walls, self.edges, sd_m, LASTING_OUTLIER)
            return Field.of(lasting, UNKNOWN_NATS, self.occupancy)
        value_of = cubed if model == "likelihood_field" else np.log
        worth = self.walls, value_of(self.pz(self.walls.meters, sd_m, max_m))
        return Field.of([worth], float(value_of(self.pz(outside, sd_m, max_m))), self.occupancy)

    def pz(self, distance_m: Any, sd_m: float, max_m: float) -> Any:
        """Return AMCL's likelihood of a beam that ends at a distance from the nearest occupied cell."""
        return self.parameters.z_hit * near_to(distance_m, sd_m) + self.parameters.z_rand / max_m


@lru_cache(maxsize=4)
def laser_map(occupancy: OccupancyMap, parameters: LaserParameters) -> LaserMap:
    """Return what the models need of a map: the filter and those who judge it share it."""
    return LaserMap(occupancy, parameters)


def worth_of(walls: Distances, edges: Distances, sd_m: float, outlier: float = OUTLIER) -> list[Worth]:
    """Return our nats, <= 0, of a beam by how far from walls it ends, and from unknown cells.

    A beam that ends in a free cell beside unknown ones may be a wall's that was seen only from far away.
    """
    unknown = (math.exp(UNKNOWN_NATS) - outlier) / (1 - outlier)  # a cell as near to unknown ones
    near = (walls, near_to(walls.meters, sd_m)), (edges, unknown * near_to(edges.meters, sd_m))
    return [(apart, np.log(like * (1 - outlier) + outlier)) for apart, like in near]


def calibrated(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return nats (N,) that are worth what they say; unknown space is neutral."""
    lookup = map_.field("calibrated", widened(SIGMA_M, spread_m))
    return lookup.sums(reading.ends, poses, origin) * _share(reading)


def in_unknown_space(reading: LaserReading) -> np.float32:
    """Return the nats of `calibrated` at a pose from which all beams end in unknown space."""
    return np.float32(UNKNOWN_NATS * len(reading.ends)) * _share(reading)


def bounded(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return the nats (N,) of `calibrated` as a filter takes them: no single scan rules a pose out."""
    likelihood = np.exp(calibrated(map_, reading, poses, origin, spread_m))
    likelihood += np.float32(math.exp(-SCAN_OUTLIER_NATS))
    return np.log(likelihood, out=likelihood)  # `np.logaddexp`, five times as fast


def explained(map_: LaserMap, reading: LaserReading, poses: F32, weights: F64, origin: F64) -> bool | None:
    """Return whether a cloud (N, 3) is where the scan may be from; weights are (N,).

    None where the map cannot tell: the cloud is together where most beams end in unknown space, and they do
    not pass through walls.
    """
    stride = -(-len(poses) // SAMPLED)
    poses, weights = poses[::stride], weights[::stride]
    fields, beams = (map_.field("calibrated", SIGMA_M), map_.unknown), len(reading.ends)
    total, unknown = sums_of(fields, reading.ends, poses, origin)
    weights = weights / weights.sum()
    off = poses[:, :2] - weights @ poses[:, :2]
    together = float(weights @ np.square(off).sum(axis=1)) < TOGETHER_M**2
    if together and float(weights @ unknown) > (1 - LEAST_KNOWN) * beams:
        pose = (poses[weights.argmax()] + [*origin, 0.0]).astype(np.float64)
        return None if float(map_.through_walls(reading, pose).sum()) < MOST_THROUGH * beams else False
    worth = _worth_known(total, unknown, beams)
    best = np.argsort(-worth)
    share = np.cumsum(weights[best])
    return float(worth[best[np.searchsorted(share, BEST_SHARE)]]) > EXPLAINED_NATS


def _worth_known(total: F32, unknown: F32, beams: int) -> F32:
    """Return the nats (N,) a beam of those that end where the map is known, from the sums of all beams."""
    worth = (total - np.float32(UNKNOWN_NATS) * unknown) / np.maximum(beams - unknown, 1)
    worth[unknown > (1 - LEAST_KNOWN) * beams] = UNKNOWN_NATS  # the few others may agree by chance
    return np.asarray(worth, np.float32)


def fitting(map_: LaserMap, reading: LaserReading, poses: F64) -> Bool:
    """Return at which poses (N, 3) in the map's frame the scan fits so well that the robot may be there."""
    return np.asarray(worth_at(map_, reading, poses) > FITS_NATS)


def worth_at(map_: LaserMap, reading: LaserReading, poses: F64) -> F32:
    """Return the nats (N,) a beam at poses (N, 3) in the map's frame, of beams that end where it is known."""
    origin = poses[0, :2].copy()
    local = (poses - [*origin, 0.0]).astype(np.float32)
    total = map_.field("calibrated", SIGMA_M, 0.0).sums(reading.ends, local, origin)
    unknown = map_.unknown.sums(reading.ends, local, origin)
    return _worth_known(total, unknown, len(reading.ends))


def nats_of_beams(map_: LaserMap, reading: LaserReading, ends: F64) -> F32:
    """Return our nats (K,) of the beams that hit something, which end at (K, 2) in the map's frame."""
    return map_.field("calibrated", SIGMA_M).at(ends) * _share(reading)


def likelihood_field(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return AMCL's: the log of 1 + the sum of pz^3, relative to the best that there could be."""
    wide = widened(map_.parameters.sigma_hit, spread_m), reading.max_m
    total = map_.field("likelihood_field", *wide).sums(reading.ends, poses, origin)
    return np.log1p(total) - np.float32(np.log1p(reading.hits.sum() * cubed(map_.pz(0.0, *wide))))


def likelihood_field_prob(
    map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float
) -> F32:
    """Return AMCL's sum of log pz, without beams that few of a converged cloud's particles agree with."""
    p, ends = map_.parameters, reading.ends
    wide = widened(p.sigma_hit, spread_m), reading.max_m
    lookup, best = map_.field("likelihood_field_prob", *wide), np.log(map_.pz(0.0, *wide))
    if not (p.do_beamskip and (np.abs(poses - poses.mean(axis=0))[:, :2] <= CONVERGED_M).all()):
        return lookup.sums(ends, poses, origin) - np.float32(len(ends) * best)
    nats = lookup.each(ends, poses, origin)
    kept = (nats > np.log(map_.pz(p.beam_skip_distance, *wide))).mean(axis=0) > p.beam_skip_threshold
    if reading.size - kept.sum() >= reading.size * p.beam_skip_error_threshold:
        kept[:] = True  # the cloud may have converged to a wrong place
    return np.asarray((nats[:, kept] - np.float32(best)).sum(axis=1), np.float32)


def beam(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return AMCL's by ray casting: the log of 1 + the sum of pz^3, relative to a bound of it."""
    p, measured = map_.parameters, reading.ranges_m
    mount_x, mount_y, mount_rad = reading.scan.mount
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    places = poses[:, :2] + np.stack([c * mount_x - s * mount_y, s * mount_x + c * mount_y], axis=1) + origin
    lasers = np.column_stack([places, poses[:, 2] + mount_rad])
    beyond = measured - map_.rays.cast(lasers, reading.angles_rad - mount_rad, reading.max_m)
    short = np.asarray(p.z_short * p.lambda_short * np.exp(-p.lambda_short * measured), np.float32)
    rest = np.where(reading.hits, p.z_rand / reading.max_m, p.z_max).astype(np.float32)
    near = near_to(beyond, widened(p.sigma_hit, spread_m))
    total = cubed(np.float32(p.z_hit) * near + rest + short * (beyond < 0)).sum(axis=1)
    return np.asarray(np.log1p(total) - np.log1p(cubed(p.z_hit + rest + short).sum()), np.float32)


Model = Callable[[LaserMap, LaserReading, F32, F64, float], F32]
MODELS: Mapping[str, Model] = {
    "calibrated": bounded,
    "likelihood_field": likelihood_field,
    "likelihood_field_prob": likelihood_field_prob,
    "beam": beam,
}


def _share(reading: LaserReading) -> np.float32:
    return np.float32(min(1.0, INDEPENDENT_BEAMS / reading.hits.sum()))


def widened(sd_m: float, spread_m: float) -> float:
    """Add a spread to a standard deviation, rounded to half octaves: each width has a field of its own."""
    octaves = math.log2(math.hypot(sd_m, spread_m) / sd_m)
    return sd_m * 2 ** (round(2 * octaves) / 2)


def near_to(off_m: Any, sd_m: float) -> Any:
    """Return a normal distribution, 1 in its middle."""
    return np.exp(off_m * off_m * (-0.5 / sd_m**2))


def cubed(values: Any) -> Any:
    """Return third powers."""
    return values * values * values
