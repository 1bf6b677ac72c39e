"""Motion models: how particles move when the robot reports a movement, and motion outliers.

Maurice's skid-steer model (thesis 3.2) for robots that state its parameters, the odometry model of
Probabilistic Robotics for all others. Turns beyond three standard deviations (thesis 3.6) need a mixture of
two Gaussians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..values import (
    F32,
    F64,
    INCH_M,
    SHARE,
    Belief,
    Bool,
    Grid,
    MeasuredMovement,
    called,
    is_own,
    made,
    name_of,
    number,
    own_part,
    wrap,
)

MOST_CONSTANT = 1e6  # of a header's constants; larger ones lead to poses beyond float32


class MotionModel(Protocol):
    """Moves every particle by its own noisy version of what the robot measured."""

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """Return new poses (N, 3) after one movement.

        `motion` is (3,) forward_m, left_m, turn_rad as measured; `noise` (N, 3) holds standard normals.
        """
        ...


@dataclass(frozen=True, slots=True)
class FloorDrift:
    """How the heading drifts on one floor while driving straight, counter-clockwise.

    One part is in proportion to the distance, the other the same for every straight, however long, as in the
    thesis (3.2).
    """

    bias_rad_per_m: float = 0.0  # mean drift; backward clockwise
    sd_rad_per_m: float = 0.0  # its standard deviation from movement to movement
    bias_rad: float = 0.0  # the same, a straight
    sd_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class MauriceParameters:
    """Maurice's motion constants; the numbers are those of thesis 3.2 unless marked."""

    turn_gain: float = 1 / 1.3695  # actual / measured rotation: skidding wheels turn more than the body
    turn_bias_rad: float = float(np.deg2rad(0.2681))  # mean residual of one turn
    turn_sd_rad: float = float(np.deg2rad(4.916))  # sd of that residual
    straight_bias_m: float = -0.6978 * INCH_M  # actual minus encoder distance; inches are inferred
    straight_sd_m: float = 0.6356 * INCH_M  # sd of that
    # by floor, "" for all others; 1.1 degrees per meter is ours, as the thesis's figure 10 cannot be read
    drift: Mapping[str, FloorDrift] = field(
        default_factory=lambda: {"": FloorDrift(0.0, float(np.deg2rad(1.1)))}
    )
    turn_from_rad: float = float(np.deg2rad(0.5))  # a smaller measured rotation is no turn (ours)
    straight_from_m: float = 0.001  # a shorter measured distance is no movement (ours)


@dataclass(frozen=True, eq=False)
class MauriceMotion:
    """The thesis's model: noise once per movement, the drift of a straight applied when it is over.

    A turn gets the gain and the measured residual, a straight the encoders' error and the floor's drift. A
    movement that is both is a turn followed by a straight. Backward a straight falls short as well, and
    drifts to the other side: the robot goes back on the arc that it came by.
    """

    parameters: MauriceParameters
    grid: Grid  # knows the floor under each particle

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """See `MotionModel.move`; columns of `noise`: length, drift, turn."""
        p = self.parameters
        forward, left, turn = (float(v) for v in motion)
        distance_m = float(np.hypot(forward, left))
        heading = poses[:, 2] + np.float32(p.turn_gain * turn)
        if abs(turn) >= p.turn_from_rad:
            heading += noise[:, 2] * np.float32(p.turn_sd_rad) + np.float32(p.turn_bias_rad)
        if distance_m < p.straight_from_m:
            return _poses(poses[:, 0], poses[:, 1], wrap(heading))
        length = noise[:, 0] * np.float32(p.straight_sd_m) + np.float32(distance_m + p.straight_bias_m)
        course = heading + np.float32(np.arctan2(left, forward))
        drift = self._drift(poses[:, :2], origin, distance_m if forward >= 0 else -distance_m, noise[:, 1])
        moved = (poses[:, 0] + length * np.cos(course), poses[:, 1] + length * np.sin(course))
        return _poses(*moved, wrap(heading + drift))

    def _drift(self, xy: F32, origin: F64, distance_m: float, noise: F32) -> F32:
        """Return the drift (N,) in radians over a distance (below 0 backward) by the floor under each."""
        per_m, per_straight = self._by_floor
        bias, sd = per_m * distance_m + per_straight * math.copysign(1, distance_m)
        bias, sd = bias.astype(np.float32), sd.astype(np.float32)
        if len(bias) == 1:
            return np.asarray(bias[0] + sd[0] * noise, np.float32)
        floor = self._floor_of.take(self.grid.cells_of(xy, origin))
        drift: F32 = sd.take(floor)
        drift *= noise
        drift += bias.take(floor)
        return drift

    @cached_property
    def _by_floor(self) -> F64:
        """Bias and sd of the drift (2, 2, floors): in radians per meter, and per straight."""
        others = self.parameters.drift.get("", FloorDrift())
        drifts = [self.parameters.drift.get(name) or others for name in self.grid.floors]
        values = [[(f.bias_rad_per_m, f.sd_rad_per_m), (f.bias_rad, f.sd_rad)] for f in drifts]
        return np.array(values).transpose(1, 2, 0)

    @cached_property
    def _floor_of(self) -> NDArray[np.intp]:
        """The floor (cells + 1,) of every cell; the last stands for outside, -1."""
        return np.append(self.grid.floor.ravel(), 0).astype(np.intp)


@dataclass(frozen=True, slots=True)
class OdometryParameters:
    """Noise of the odometry model, as variances (Probabilistic Robotics, table 5.6, first edition)."""

    turn_from_turn: float = 0.02  # rad^2 of turn per rad^2 of turn (alpha 1)
    turn_from_way: float = 0.02  # rad^2 of turn per m^2 driven (alpha 2)
    way_from_way: float = 0.02  # m^2 per m^2 driven (alpha 3)
    way_from_turn: float = 0.0005  # m^2 per rad^2 of turn (alpha 4)
    way_from_m: float = 0.01  # the direction of a shorter movement counts as no turn (as in AMCL)


def turns_of(motion: F64, way_from_m: float) -> tuple[float, float]:
    """Return the turns in rad before and after the straight of a movement (3,), as far as they make noise.

    A robot may drive forward or backward: the smaller of both turns counts (AMCL treats both alike, too). The
    direction of a straight shorter than `way_from_m` counts as no turn.
    """
    forward, left, turn = (float(v) for v in motion)
    if math.hypot(forward, left) < way_from_m:
        return 0.0, turn
    first = math.atan2(left, forward)
    pairs = [(first + half, turn - first - half) for half in (0.0, -math.pi, math.pi)]
    return min(pairs, key=lambda pair: math.hypot(*pair))


@dataclass(frozen=True, slots=True)
class OdometryMotion:
    """Turn, translate, turn (Probabilistic Robotics, section 5.4); valid for any robot, but less sharp.

    The noise of the turns is that of `turns_of`: driving backward counts as small turns.
    """

    parameters: OdometryParameters = OdometryParameters()

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """See `MotionModel.move`; columns of `noise`: first turn, length, second turn."""
        p = self.parameters
        forward, left, turn = (float(v) for v in motion)
        distance_m = float(np.hypot(forward, left))
        first = float(np.arctan2(left, forward)) if distance_m > 0 else 0.0
        second = turn - first
        a, b = turns_of(motion, p.way_from_m)
        first_sd = math.sqrt(p.turn_from_turn * a**2 + p.turn_from_way * distance_m**2)
        distance_sd = math.sqrt(p.way_from_way * distance_m**2 + p.way_from_turn * (a**2 + b**2))
        second_sd = math.sqrt(p.turn_from_turn * b**2 + p.turn_from_way * distance_m**2)
        course = poses[:, 2] + (np.float32(first) + noise[:, 0] * np.float32(first_sd))
        length = np.float32(distance_m) + noise[:, 1] * np.float32(distance_sd)
        heading = course + (np.float32(second) + noise[:, 2] * np.float32(second_sd))
        moved = (poses[:, 0] + length * np.cos(course), poses[:, 1] + length * np.sin(course))
        return _poses(*moved, wrap(heading))


@dataclass(frozen=True, slots=True)
class OmniParameters:
    """Noise of AMCL's model for robots that drive in any direction, as variances."""

    turn_from_turn: float = 0.02  # rad^2 of turn per rad^2 of turn (Nav2's alpha 1; ROS 1's 4)
    turn_from_way: float = 0.02  # rad^2 of turn per m^2 driven (alpha 2)
    way_from_way: float = 0.02  # m^2 ahead per m^2 driven (alpha 3)
    way_from_turn: float = 0.0005  # m^2 ahead and aside per rad^2 of turn (4; 1)
    side_from_way: float = 0.02  # m^2 aside per m^2 driven (alpha 5)


@dataclass(frozen=True, slots=True)
class OmniMotion:
    """Noise along and across the movement, and of the turn, as AMCL's omnidirectional model has it."""

    parameters: OmniParameters = OmniParameters()

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """See `MotionModel.move`; columns of `noise`: along the movement, across it, turn."""
        p = self.parameters
        forward, left, turn = (float(v) for v in motion)
        distance_m = math.hypot(forward, left)
        along_sd = math.sqrt(p.way_from_way * distance_m**2 + p.way_from_turn * turn**2)
        across_sd = math.sqrt(p.side_from_way * distance_m**2 + p.way_from_turn * turn**2)
        turn_sd = math.sqrt(p.turn_from_turn * turn**2 + p.turn_from_way * distance_m**2)
        course = poses[:, 2] + np.float32(math.atan2(left, forward))
        cos, sin = np.cos(course), np.sin(course)
        along, across = (
            np.float32(distance_m) + noise[:, 0] * np.float32(along_sd),
            noise[:, 1] * np.float32(across_sd),
        )
        heading = poses[:, 2] + np.float32(turn) + noise[:, 2] * np.float32(turn_sd)
        moved = poses[:, 0] + along * cos - across * sin, poses[:, 1] + along * sin + across * cos
        return _poses(*moved, wrap(heading))


def _poses(x: F32, y: F32, heading: F32) -> F32:
    poses = np.empty((3, len(x)), np.float32)  # column by column
    poses[0], poses[1], poses[2] = x, y, heading
    return poses.T


Parameters = TypeVar("Parameters", MauriceParameters, OdometryParameters, OmniParameters)


def from_header(kind: type[Parameters], values: Mapping[str, Any]) -> Parameters:
    """Read the object under robot.motion in a session header; ValueError names a field that is wrong."""
    known = sorted(f.name for f in fields(kind))
    entries = {name: value for name, value in values.items() if name != "model"}
    for name in entries:
        if name not in known:
            raise ValueError(f"robot.motion.{name} is not known; known are {', '.join(known)}")
    constants: dict[str, Any] = {
        name: _floors(value) if name == "drift" else _number(f"robot.motion.{name}", value)
        for name, value in entries.items()
    }
    return kind(**constants)


def _floors(value: Any) -> dict[str, FloorDrift]:
    if not isinstance(value, Mapping):
        raise ValueError(f"robot.motion.drift must name floors, found {value!r}")
    return {str(floor): _drift(floor, spec) for floor, spec in value.items()}


def _drift(floor: str, spec: Any) -> FloorDrift:
    names = [f.name for f in fields(FloorDrift)]
    if not isinstance(spec, Mapping) or set(spec) - set(names):
        names_in_words = f"{', '.join(names[:-1])} and {names[-1]}"
        raise ValueError(f"robot.motion.drift.{floor} must hold {names_in_words}, found {spec!r}")
    return FloorDrift(
        **{key: _number(f"robot.motion.drift.{floor}.{key}", value) for key, value in spec.items()}
    )


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise ValueError(f"{name} must be a finite number, found {value!r}")
    if abs(value) > MOST_CONSTANT:  # compares whole numbers of any length
        raise ValueError(f"{name} must be a number up to 1e6 in size, found {value!r:.60}")
    if value < 0 and "bias" not in name.rsplit(".", 1)[1]:
        raise ValueError(f"{name} must not be negative, found {value!r}")
    return float(value)


# Share of a measured standard deviation that particles spread by: errors of successive movements
# cancel, as each is measured against ten frames. With all of it a cloud spreads ten times too far.
SPREAD_SHARE = 0.2


def measured_motion(poses: F32, movement: MeasuredMovement, noise: F32) -> F32:
    """Return poses (N, 3) after a movement that a sensor measured, with standard normals (N, 3)."""
    spread = (SPREAD_SHARE * np.linalg.cholesky(movement.covariance)).astype(np.float32)
    forward, left, turn = (movement.motion.astype(np.float32) + noise @ spread.T).T
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = cos * forward - sin * left, sin * forward + cos * left
    return _poses(poses[:, 0] + x, poses[:, 1] + y, wrap(poses[:, 2] + turn))


class RobotMotion(NamedTuple):
    """What a robot measured of one movement, in its own frame before it.

    >>> import maurice_mcl as mcl
    >>> mcl.RobotMotion(0.5, 0.0, 0.1).turn_rad
    0.1
    """

    forward_m: float
    left_m: float
    turn_rad: float


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """A motion model of the user's, which meets poses in the map's frame: `move(poses, motion, noise)`.

    `poses` (N, 3) and the standard normals `noise` (N, 3) are float64, `motion` is a `RobotMotion`; it
    returns the new poses. What it raises, and anything but finite poses (N, 3), is an InputError.
    """

    name: str
    model: Any

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """See `MotionModel.move`."""
        offset = np.array([*origin, 0.0])
        arguments = (
            poses.astype(np.float64) + offset,
            RobotMotion(*map(float, motion)),
            noise.astype(np.float64),
        )
        moved = np.asarray(called(f"motion model {self.name}", self.model.move, *arguments))
        if moved.shape != poses.shape or moved.dtype.kind != "f" or not np.isfinite(moved).all():
            fault = f"found {moved.dtype} {moved.shape}, expected finite poses {poses.shape}"
            raise InputError(None, f"motion model {self.name}: {fault}")
        x, y, heading = (moved - offset).T.astype(np.float32)
        return _poses(x, y, wrap(heading))


def motion_settings(key: str, value: Any) -> Mapping[str, Any]:
    """Accept a table as under robot.motion of a header, or the user's model: with `move`, or its name."""
    if isinstance(value, Mapping):
        return dict(value)
    part = own_part("motion model", value) if isinstance(value, str) and is_own(value) else value
    if not callable(getattr(part, "move", None)):
        expected = "expected a table, or a motion model with a method `move`"
        raise ValueError(f"{key}: found {value!r:.60}, {expected}")
    return {"model": name_of(part)}


# by name: what reads the object under robot.motion of a header, and what makes a model of it over a map
MOTION_MODELS: Mapping[str, tuple[Callable[[Mapping[str, Any]], Any], Callable[[Any, Grid], MotionModel]]] = (
    MappingProxyType(
        {
            "maurice": (partial(from_header, MauriceParameters), MauriceMotion),
            "odometry": (
                partial(from_header, OdometryParameters),
                lambda constants, grid: OdometryMotion(constants),
            ),
            "omni": (partial(from_header, OmniParameters), lambda constants, grid: OmniMotion(constants)),
        }
    )
)


def motion_model(values: Mapping[str, Any] | None, grid: Grid) -> MotionModel:
    """Return the model that a header names, "odometry" without a header, or one of the user's.

    ValueError for an unknown name.
    """
    if not values:
        return OdometryMotion()
    name = values.get("model", "maurice")
    if isinstance(name, str) and is_own(name):
        return OwnMotion(name, made("motion model", own_part("motion model", name)))
    if not isinstance(name, str) or name not in MOTION_MODELS:
        *names, last = (f'"{known}"' for known in MOTION_MODELS)
        raise ValueError(f"robot.motion.model is {name!r}; known are {', '.join(names)} and {last}")
    read, make = MOTION_MODELS[name]
    return make(read(values), grid)


def keep_in(before: Belief, moved: Belief) -> Belief:
    """Return a moved cloud put back to where it was before: it only turns.

    A robot cannot drive out of free space. A particle that does gets the weight zero and is not resampled;
    where that would leave none, the cloud is kept in, or it would drive away from the map for good.
    """
    poses = np.column_stack([before.poses[:, :2], moved.poses[:, 2]])
    return Belief(poses, moved.log_weights, moved.origin)


# Motion outliers: occasionally a movement is off by much more than the motion model's noise.


@dataclass(frozen=True, slots=True)
class MotionOutliers:
    """How often, and how far."""

    share: Annotated[float, SHARE] = 0.0  # of particles and movements whose noise is widened, 0 to 1
    widen: Annotated[float, number(1, 1000)] = 4.0  # times the noise


def with_outliers(noise: F32, outliers: MotionOutliers, *rngs: np.random.Generator) -> F32:
    """Return standard normals (N, 3) with some rows, chosen at random, multiplied by `outliers.widen`.

    Each of the generators chooses among as many rows as the others, in order.
    """
    if outliers.share <= 0:
        return noise
    wide = np.concatenate([_are_outliers(len(noise) // len(rngs), outliers, rng) for rng in rngs])
    rows, columns = np.flatnonzero(wide), noise.T.copy()
    columns[:, rows] = columns[:, rows] * np.float64(outliers.widen)
    return columns.T


def widths(n: int, outliers: MotionOutliers, rng: np.random.Generator) -> F64:
    """Return what the noise of each of n particles is multiplied with: 1, or `outliers.widen`."""
    return np.where(_are_outliers(n, outliers, rng), outliers.widen, 1.0)


def _are_outliers(n: int, outliers: MotionOutliers, rng: np.random.Generator) -> Bool:
    """Choose some of n particles."""
    chosen: Bool = rng.random(n) < outliers.share
    return chosen
