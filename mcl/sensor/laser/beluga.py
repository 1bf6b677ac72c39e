"""Beluga's three models of a laser, by its formulas: it has AMCL's parameters and is not AMCL.

What a beam hits has a normal distribution with an area of `z_hit`, where AMCL's has that height: with a
standard deviation of 0.2 m twice as much. Off the map any range is as likely as another. `laser_max_range`
divides by itself, not by the laser's reach. Rays begin at the robot, wherever the laser sits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...values import F32, F64
from .field import Field
from .models import LaserMap, Model, cubed, near_to, widened
from .parameters import BELUGAS
from .reading import LaserReading

FIELD, PROB, BEAM = BELUGAS
LEAST = float(np.finfo(np.float32).tiny)  # of a weight: none becomes 0


def likelihood_field(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return the log (N,) of 1 + the sum of pz^3, not relative to anything."""
    total = _field(map_, FIELD, cubed, *_widths(map_, reading, spread_m)).sums(reading.ends, poses, origin)
    return np.log1p(total)


def likelihood_field_prob(
    map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float
) -> F32:
    """Return the log (N,) of the product of pz, not relative to anything."""
    return _field(map_, PROB, np.log, *_widths(map_, reading, spread_m)).sums(reading.ends, poses, origin)


def beam(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
    """Return the log (N,) of the sum of pz^3 by ray casting; each part of the mixture has an area of 1."""
    p, (sd_m, max_m), measured = map_.parameters, _widths(map_, reading, spread_m), _ranges(reading)
    robots = np.column_stack([poses[:, :2] + origin, poses[:, 2]])
    expected = map_.rays.cast(robots, np.arctan2(reading.ends[:, 1], reading.ends[:, 0]), max_m)
    within = (_erf((max_m - expected) / sd_m) + _erf(expected / sd_m)) / 2  # of the normal distribution
    near = p.z_hit * _normal(measured - expected, sd_m) / within
    up_to = np.maximum(-np.expm1(-p.lambda_short * expected), LEAST)  # of the exponential one
    short = p.z_short * p.lambda_short * np.exp(-p.lambda_short * measured) / up_to
    total = cubed(near + short * (measured < expected) + _anywhere(map_, measured, max_m)).sum(axis=1)
    return np.asarray(np.log(total + LEAST), np.float32)


def _best_of_field(map_: LaserMap, reading: LaserReading, spread_m: float) -> float:
    return math.log1p(len(reading.ends) * cubed(_best_pz(map_, reading, spread_m)))


def _best_of_prob(map_: LaserMap, reading: LaserReading, spread_m: float) -> float:
    return len(reading.ends) * math.log(_best_pz(map_, reading, spread_m))


def _best_of_beam(map_: LaserMap, reading: LaserReading, spread_m: float) -> float:
    """Return a bound: half of a normal distribution is within reach, a wall right behind what is short."""
    p, (sd_m, max_m), measured = map_.parameters, _widths(map_, reading, spread_m), _ranges(reading)
    short = p.z_short * p.lambda_short / np.maximum(np.expm1(p.lambda_short * measured), LEAST)
    best = 2 * p.z_hit * _normal(0.0, sd_m) + short + _anywhere(map_, measured, max_m)
    return float(np.log(cubed(best.astype(np.float64)).sum() + LEAST))


def _relative(weigh: Model, best: Callable[[LaserMap, LaserReading, float], float]) -> Model:
    """Return a model that gives nats relative to a bound of what there could be."""

    def nats(map_: LaserMap, reading: LaserReading, poses: F32, origin: F64, spread_m: float) -> F32:
        weights = weigh(map_, reading, poses, origin, spread_m)
        return np.asarray(weights - np.float32(best(map_, reading, spread_m)), np.float32)

    return nats


BELUGAS_MODELS: Mapping[str, Model] = {
    FIELD: _relative(likelihood_field, _best_of_field),
    PROB: _relative(likelihood_field_prob, _best_of_prob),
    BEAM: _relative(beam, _best_of_beam),
}


def pz(map_: LaserMap, distance_m: Any, sd_m: float, max_m: float) -> Any:
    """Return the density, per meter, of a beam that ends at a distance from the nearest occupied cell."""
    return map_.parameters.z_hit * _normal(distance_m, sd_m) + map_.parameters.z_rand / max_m


def _field(map_: LaserMap, name: str, value_of: Callable[[Any], Any], sd_m: float, max_m: float) -> Field:
    """Return the field of a value of pz. Unknown cells are as any others, or as what is off the map."""

    def make() -> Field:
        walls, worth, anywhere = map_.walls, pz(map_, map_.walls.meters, sd_m, max_m), 1 / max_m
        if map_.parameters.model_unknown_space:
            walls = walls.apart_from(map_.occupancy.unknown)
            worth = np.append(worth, np.float32(max(anywhere, float(worth[-1]))))
        return Field.of([(walls, value_of(worth))], float(value_of(anywhere)), map_.occupancy)

    return map_.kept((name, sd_m, max_m), make)


def _widths(map_: LaserMap, reading: LaserReading, spread_m: float) -> tuple[float, float]:
    """Return the standard deviation of hits, and the range within which any other is as likely."""
    reach_m = map_.parameters.laser_max_range
    return widened(map_.parameters.sigma_hit, spread_m), reach_m if reach_m > 0 else reading.max_m


def _best_pz(map_: LaserMap, reading: LaserReading, spread_m: float) -> float:
    sd_m, max_m = _widths(map_, reading, spread_m)
    return max(float(pz(map_, 0.0, sd_m, max_m)), 1 / max_m)


def _ranges(reading: LaserReading) -> F32:
    """Return how far from the robot beams end (K,)."""
    return np.hypot(reading.ends[:, 0], reading.ends[:, 1]).astype(np.float32)


def _anywhere(map_: LaserMap, measured: F32, max_m: float) -> F32:
    p = map_.parameters
    return np.where(measured < max_m, p.z_rand / max_m, p.z_max).astype(np.float32)


def _normal(off_m: Any, sd_m: float) -> Any:
    """Return the density of a normal distribution, per meter."""
    return near_to(off_m, sd_m) / (sd_m * math.sqrt(2 * math.pi))


def _erf(deviations: F32) -> Any:
    """Return twice the share of a normal distribution between its middle and some standard deviations."""
    from scipy.special import erf  # a replay with other models needs none of it

    return erf(deviations * np.float32(math.sqrt(0.5)))
