"""Sensors that give any pose a log-likelihood: the seam for everything but pictures compared with references.

A channel measures a picture and is compared with the library's references. A pose sensor needs none: it
reads what it wants from a frame (the picture, numbers by name), and knows what it would read at any pose.
Their nats add up with those of the channels (`sensor.model`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np

from .arrays import F32, F64, U8, Bool
from .geometry import wrap
from .nearest import nearest_apart
from .session import Frame

BESIDE_GAP_PX = 6  # between two pictures
POSE_SENSORS = ("landmarks", "keypoints", "laser")  # ours, as keys of `sensor.weights`


@dataclass(frozen=True, slots=True)
class PoseSpread:
    """How far the poses that one pose stands for lie from it: standard deviations.

    >>> from maurice_mcl import PoseSpread
    >>> PoseSpread(position_m=0.05)
    PoseSpread(position_m=0.05, heading_rad=0.0)
    """

    position_m: float = 0.0  # along each axis
    heading_rad: float = 0.0


EXACT = PoseSpread()
LEAST_CLOUD = 50  # poses; fewer are no cloud, and each stands for itself
MOST_APART = PoseSpread(2.5, 1.2)  # a likelihood that is spread farther tells nothing
# In the middle of a normal cloud of N poses, neighbors are this times N^(-1/3) standard deviations apart.
NEIGHBOR_SDS = 2.5
NORMAL_SD = 1.4826  # of a normal distribution, by its median absolute deviation
WIDE_M = 0.2  # a cloud that searches: some of its poses may be much denser than most
# Of poses that are 1 apart on average, this share has a neighbor nearer than this.
DENSEST_SHARE, DENSEST_SPACING = 0.05, 0.23
MEDIAN_SAMPLE = 500  # poses are enough for a median


def spread_between(poses: F32) -> PoseSpread:
    """Return how far the poses (N, 3) of a cloud are from their neighbors: what each of them stands for.

    Where a sensor is sharper than that, no particle may be near enough to the truth to be told apart by it.
    A few poses far from the others do not count: widths are medians. In a cloud that searches, the densest
    poses count.
    """
    if len(poses) < LEAST_CLOUD:
        return EXACT
    some = poses[:: max(len(poses) // MEDIAN_SAMPLE, 1)].T.copy()
    heading = some[2]
    some[2] = wrap(heading - np.arctan2(np.sin(heading).sum(), np.cos(heading).sum()))
    share = NORMAL_SD * NEIGHBOR_SDS / len(poses) ** (1 / 3)
    off_x, off_y, turned = _medians(np.abs(some - _medians(some)[:, None])).tolist()
    position_m, heading_rad = share * math.sqrt(off_x * off_y), share * turned
    if position_m > WIDE_M:
        # how much nearer to each other than 1 the densest poses are, e.g. proposed ones
        apart = nearest_apart(poses / np.array([position_m, position_m, heading_rad or 1.0]))
        near = min(float(np.quantile(apart, DENSEST_SHARE)) / DENSEST_SPACING, 1.0)
        position_m, heading_rad = position_m * near, heading_rad * near
    return PoseSpread(min(position_m, MOST_APART.position_m), min(heading_rad, MOST_APART.heading_rad))


def _medians(rows: F32) -> F32:
    """Return the median of each row (n, N); of an even number the greater one."""
    half = rows.shape[1] // 2
    medians: F32 = np.partition(rows, half, axis=1)[:, half]
    return medians


@dataclass(frozen=True, slots=True, eq=False)
class PoseProposal:
    """Where a sensor alone would put the robot: a mixture of J normal distributions.

    >>> import numpy as np
    >>> from maurice_mcl import PoseProposal
    >>> proposal = PoseProposal(np.array([[1.0, 2.0, 0.5]]), np.diag([0.01, 0.01, 0.003])[None], np.ones(1))
    >>> proposal.covariances.shape
    (1, 3, 3)
    """

    poses: F64  # (J, 3) x_m, y_m, heading_rad in the map's frame
    covariances: F64  # (J, 3, 3)
    weights: F64  # (J,) sum to one
    from_one_object: Bool | None = None  # (J,) a single object speaks for it, which may have been moved
    believed: float = 0.0  # probability, by earlier readings, that the robot is at one of the places

    def only(self, kept: Bool) -> PoseProposal:
        """Return the modes that a flag (J,) keeps, at least one of them."""
        weights = self.weights[kept]
        return replace(
            self,
            believed=self.believed * float(weights.sum() / self.weights.sum()),
            poses=self.poses[kept],
            covariances=self.covariances[kept],
            weights=weights / weights.sum(),
            from_one_object=None,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ShownMarks:
    """Points, lines or paths in one of the views of `Shown`.

    >>> import numpy as np
    >>> from maurice_mcl import ShownMarks
    >>> beacon = ShownMarks("beacon", "map", np.array([[[2.0, 1.0]]], np.float32))  # a point: P = 1
    >>> beacon.strips.shape
    (1, 1, 2)
    """

    name: str  # what they are: "matched landmarks"
    view: str  # the title of a picture of `Shown`, "map", or "space"
    # (K, P, 2) pixels (right, down), or meters in the map's frame, (K, P, 3) in space; P = 1: points
    strips: F32 | F64
    agrees: Bool | None = None  # (K,) which of them agree with the estimate; None: not judged
    # whose they are, "truth" or "estimate", or what of a laser, "short", "beyond", "unknown": for their color
    of: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """A picture with that of a reference to its right, which is read when both are drawn.

    Marks in the reference's picture, which is reduced if it is large, are `right_px` to the right of where
    they are in it.
    """

    image: U8  # (H, W, 3) RGB
    reference: int

    @property
    def right_px(self) -> int:
        """The first column of the reference's picture."""
        return int(self.image.shape[1]) + BESIDE_GAP_PX


@dataclass(frozen=True, slots=True, eq=False)
class MovedThing:
    """What a sensor saw elsewhere than the library has it: K points that agree with each other."""

    places: F64  # (K, 2) x_m, y_m where the library has them
    shift_m: F64  # (2,) by which they moved


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What a sensor wants people to see of one frame.

    >>> from maurice_mcl import Shown
    >>> Shown("the beacon is 1.20 m away").words
    'the beacon is 1.20 m away'
    """

    words: str  # a sentence: "14 of 60 landmarks agree"; with `lengths_m` each {} is one of them
    pictures: Mapping[str, U8 | Beside] = field(default_factory=dict)  # title to (H, W, 3) RGB
    marks: tuple[ShownMarks, ...] = ()
    lengths_m: tuple[float, ...] = ()  # written in the units that people read
    moved: tuple[MovedThing, ...] = ()

    def text(self, say: Callable[[float], str]) -> str:
        """Return the words, with lengths written by `say`."""
        return self.words.format(*map(say, self.lengths_m)) if self.lengths_m else self.words


class PoseSensor(Protocol):
    """A sensor model that gives any pose a log-likelihood.

    Any class with these members is one, and one that inherits from this needs `name`, `read` and
    `log_likelihood` alone; hand it to `maurice_mcl.make_localizer(..., sensors=[...])`. A
    reading may be any value: only the sensor itself looks into it. Some attributes may be
    left out: `pictures`, the titles of the pictures it shows; `in_space`, true for one with marks in space;
    `proposes`, true for one whose `propose` returns poses; `summary`, one line for tables;
    `smooths`, true for one that is asked for a particle's nats with the spread to its neighbors;
    `weighs_references`, false for one that need not say how well a library's references agree; `verify`, of
    one that weighs these and no poses: `verify(reading, log_likelihood)` returns what each costs (L,) beside
    what channels say of it. One that
    proposes may define `shown_with(reading, poses, proposal)`, which takes the place of `shown` and need
    not find the proposal again, and `explains(reading, poses, weights, origin)`: true where a cloud explains
    the reading, None where it may, so that nothing is proposed; and `confirmed(reading, proposal, earlier)`:
    what is left of a proposal by what was read before, for which `support(reading, pose)` says by how many
    nats a reading speaks for an estimate. Where a cloud does not explain a reading, particles follow
    `movement(reading, motion, earlier)`. Without channels the lost signal reads `against(reading, pose)`, the
    share of a reading that speaks against an estimate, and `settled(reading, pose)`, the pose around a given
    one that a reading fits best, and its nats.

        >>> import numpy as np, maurice_mcl as mcl
        >>> class Beacon:
        ...     name = "beacon"
        ...     def read(self, frame): return frame.readings.get("range")
        ...     def log_likelihood(self, reading, poses, origin, spread=None):
        ...         away = np.hypot(poses[:, 0] + origin[0], poses[:, 1] + origin[1])
        ...         return np.maximum(-0.5 * ((away - reading) / 0.1) ** 2, -8).astype(np.float32)
        ...     def propose(self, reading): return None
        ...     def shown(self, reading, poses): return mcl.Shown(f"the beacon is {reading:.2f} m away")
        >>> localizer = mcl.make_localizer(mcl.tiny_library(), sensors=[Beacon()])
        >>> list(localizer.sensor.sensors)
        ['beacon']
    """

    @property
    def name(self) -> str:
        """Its name in `sensor.weights`, tables and panels."""
        ...

    def read(self, frame: Frame) -> Any | None:
        """Return what a frame holds for this sensor, or None: then it says nothing about any pose.

        Nothing here depends on the particles: frames are read ahead of the filter, on another thread.
        """
        ...

    def log_likelihood(self, reading: Any, poses: F32, origin: F64, spread: PoseSpread = EXACT) -> F32:
        """Return nats (N,) for poses (N, 3) relative to `origin` (2,): at most 0, perfect agreement; finite.

        A bound from below keeps one bad reading from ruling the truth out. With `spread`, every pose stands
        for those around it.
        """
        ...

    def propose(self, reading: Any) -> PoseProposal | None:
        """Return where this reading alone would put the robot; None if it cannot tell, as by default."""
        return None

    def shown(self, reading: Any, poses: Mapping[str, F64]) -> Shown:
        """Return what to show, with poses (3,) in the map's frame: "estimate", and "truth" where known."""
        return Shown(f"{self.name} read {reading}".replace("{", "(").replace("}", ")"))


LINKED_NATS = -1.0  # a point of a reading: worse, and the robot was carried since the one before
DOUBTFUL_NATS = -0.98  # it was carried, or its wheels slipped
FITTING_NATS = -0.8  # better: nothing happened between them
TRUSTED_NATS = 10.0  # that speak for an estimate: with less the robot may as well be elsewhere


@dataclass(frozen=True, eq=False)
class Earlier:
    """What a sensor read in an earlier frame, and where the filter thought to be."""

    motions: F64  # (M, 3) from there to the next frame
    link: float  # nats a point by which what the sensor read next fits what it had read, along them
    reading: Any | None
    estimate: F64  # (3,) in the map's frame
    trust: float = 0.0  # nats by which what was read up to then speaks for the estimate


# What a sensor read before, the latest first, by its name: asked for only where a sensor looks back.
ReadBefore: TypeAlias = Callable[[str], Sequence[Earlier]]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredMovement:
    """How the robot moved since the frame before, as a sensor measures it."""

    motion: F64  # (3,) forward_m, left_m, turn_rad
    covariance: F64  # (3, 3)
    link: float  # nats a point, <= 0, by which the reading fits those before, along the movement

    @property
    def is_linked(self) -> bool:
        """Whether the reading fits those before: else the robot was carried, or all that it sees is new."""
        return self.link > LINKED_NATS


@dataclass(frozen=True, eq=False)
class Sensed:
    """What one pose sensor read in a frame, and how well each of the library's L references agrees."""

    sensor: PoseSensor
    reading: Any
    weight: float  # multiplies its nats
    cost: F32  # (L,) nats, >= 0, at weight 1, for the neighborhood of each reference

    @property
    def name(self) -> str:
        """The name of the sensor."""
        return self.sensor.name

    def is_explained(self, poses: F32, weights: F64, origin: F64) -> bool | None:
        """Return whether a cloud (N, 3) explains the reading; None where the map cannot tell."""
        explains = getattr(self.sensor, "explains", None)
        explained: bool | None = explains is not None and explains(self.reading, poses, weights, origin)
        return explained

    def support(self, pose: F64) -> float:
        """Return by how many nats the reading speaks for a pose (3,); 0 for a sensor that does not say."""
        support = getattr(self.sensor, "support", None)
        return 0.0 if support is None else float(support(self.reading, pose))

    @property
    def tells_against(self) -> bool:
        """Whether the sensor says how much of a reading speaks against a pose."""
        return hasattr(self.sensor, "against")

    def against(self, pose: F64) -> float | None:
        """Return the share of the reading that speaks against a pose (3,); None where none can tell."""
        says = getattr(self.sensor, "against", None)
        against: float | None = says and says(self.reading, pose)
        return against

    def settled(self, pose: F64) -> tuple[F64, float]:
        """Return the pose (3,) around a given one that the reading fits best, and its nats."""
        settle = getattr(self.sensor, "settled", None)
        settled: tuple[F64, float] = (pose, 0.0) if settle is None else settle(self.reading, pose)
        return settled

    def movement(self, motion: F64, earlier: ReadBefore) -> MeasuredMovement | None:
        """Return the movement that the readings tell of, where wheels measured `motion` (3,)."""
        movement = getattr(self.sensor, "movement", None)
        if movement is None:
            return None
        measured: MeasuredMovement | None = movement(self.reading, motion, earlier(self.name))
        return measured

    def confirmed(self, earlier: ReadBefore) -> PoseProposal | None:
        """Return what is left of the proposal by what was read before."""
        confirmed = getattr(self.sensor, "confirmed", None)
        if confirmed is None or self.proposal is None:
            return self.proposal
        proposal: PoseProposal | None = confirmed(self.reading, self.proposal, earlier(self.name))
        return proposal

    @cached_property
    def proposal(self) -> PoseProposal | None:
        """Where this reading alone would put the robot: found when a filter asks for it."""
        return self.sensor.propose(self.reading)

    def shown(self, poses: Mapping[str, F64]) -> Shown:
        """Return what the sensor shows of its reading; arguments as for `PoseSensor.shown`."""
        shown_with = getattr(self.sensor, "shown_with", None)
        if shown_with is None:
            return self.sensor.shown(self.reading, poses)
        shown: Shown = shown_with(self.reading, poses, self.proposal)
        return shown
