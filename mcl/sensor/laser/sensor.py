"""The pose sensor `Laser`: any pose is as likely as the scan fits the map there."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, reduce
from typing import ClassVar

import numpy as np

from ...errors import InputError
from ...values import (
    EXACT,
    F32,
    F64,
    Earlier,
    Frame,
    MeasuredMovement,
    OccupancyMap,
    PoseProposal,
    PoseSpread,
    Shown,
    compose,
)
from .beams import BeamJudgment, judge, shown
from .beluga import BELUGAS_MODELS
from .field import MOST_CELLS
from .history import agreeing
from .matching import Matcher
from .models import (
    MODELS,
    SCAN_OUTLIER_NATS,
    LaserMap,
    Model,
    calibrated,
    explained,
    fitting,
    in_unknown_space,
    laser_map,
)
from .odometry import movement_by_scans
from .parameters import LaserParameters
from .reading import LaserReading, read_scan

BY_NAME: Mapping[str, Model] = {**MODELS, **BELUGAS_MODELS}
ALONE_SHARE = 0.97  # of a scan's likelihood: where it fits badly, a place stands out all the same
NOTED_SHARE = 0.08  # of the beams against a pose: with as many, poses around it are tried, too
# Offsets (A, 3) around an estimate, less than 0.32 m and 5 degrees: while a scan is full of people nothing
# corrects the cloud, which drifts a few decimeters, and is not lost for that.
_STEPS_M, _TURNS = np.arange(-3, 4) * 0.1, np.radians(np.arange(-4, 5, 2))
OFFSETS = np.stack(np.meshgrid(_STEPS_M, _STEPS_M, _TURNS), axis=-1).reshape(-1, 3)
OFFSETS = OFFSETS[np.hypot(OFFSETS[:, 0], OFFSETS[:, 1]) < 0.32]


@dataclass(frozen=True, eq=False)
class Laser:
    """A sensor model of a planar laser on an occupancy grid; see `maurice_mcl.PoseSensor`."""

    occupancy: OccupancyMap
    parameters: LaserParameters = field(default_factory=LaserParameters)
    name: ClassVar[str] = "laser"  # the key of `sensor.weights`
    proposes: ClassVar[bool] = True
    weighs_references: ClassVar[bool] = False  # it weighs every particle at its own pose

    def __post_init__(self) -> None:
        height, width = self.occupancy.cells.shape
        if max(height, width) > MOST_CELLS:
            found = f"found a map of {width} x {height} cells, expected at most {MOST_CELLS} along an axis"
            raise InputError(None, f"{found}; give it larger cells")

    @property
    def smooths(self) -> bool:
        """Whether a particle stands for the poses between it and its neighbors: for AMCL it does not."""
        return self.parameters.model == "calibrated"

    @property
    def summary(self) -> str:
        """One line for tables."""
        height, width = self.occupancy.cells.shape
        return f"{self.parameters.model}, {width} x {height} cells of {self.occupancy.cell_m:g} m"

    def read(self, frame: Frame) -> LaserReading | None:
        """Return the beams to compare; None without a scan, and where too few beams hit something."""
        return None if frame.scan is None else read_scan(frame.scan, self.parameters)

    def log_likelihood(
        self, reading: LaserReading, poses: F32, origin: F64, spread: PoseSpread = EXACT
    ) -> F32:
        """Return the nats (N,) of poses (N, 3): at most 0, where every beam ends at what the map has."""
        # of the ends of beams
        spread_m = math.hypot(spread.position_m, spread.heading_rad * reading.range_m)
        nats = BY_NAME[self.parameters.model](self._map, reading, poses, origin, spread_m)
        return np.minimum(nats, np.float32(0))

    def propose(self, reading: LaserReading) -> PoseProposal | None:
        """Return where on the map the scan fits best; None where too few beams tell."""
        return self._matcher.propose(reading.ends, reading.scan.mount)

    def confirmed(
        self, reading: LaserReading, proposal: PoseProposal, earlier: Sequence[Earlier]
    ) -> PoseProposal | None:
        """Return the places of a proposal where the robot may be by the scans before, too."""
        if not earlier:
            fits = fitting(self._map, reading, proposal.poses) | (proposal.weights > ALONE_SHARE)
            return proposal.only(fits) if fits.any() else None
        here = reduce(compose, earlier[0].motions, earlier[0].estimate)
        scans = [Earlier(np.zeros((0, 3)), 0.0, reading, here), *earlier]
        agreement = agreeing(self._map, proposal, here, scans)
        if not agreement.shares.any():
            return None
        weighted = replace(proposal, weights=agreement.shares, believed=agreement.believed)
        return weighted.only(agreement.shares > 0)

    def explains(self, reading: LaserReading, poses: F32, weights: F64, origin: F64) -> bool | None:
        """Return whether a cloud (N, 3) explains the scan; None where the map cannot tell."""
        return explained(self._map, reading, poses, weights, origin)

    def support(self, reading: LaserReading, pose: F64) -> float:
        """Return by how many nats a reading speaks for a pose (3,), rather than for unknown space."""
        turned = np.array([[0.0, 0.0, pose[2]]], np.float32)
        return float(calibrated(self._map, reading, turned, pose[:2], 0.0)[0] - in_unknown_space(reading))

    def movement(
        self, reading: LaserReading, motion: F64, earlier: Sequence[Earlier]
    ) -> MeasuredMovement | None:
        """Return how the robot moved by this scan and those before."""
        return movement_by_scans(reading.scan.points(), motion, earlier)

    def against(self, reading: LaserReading, pose: F64) -> float | None:
        """Return the share of the beams that speak against a pose (3,), and all around it.

        None where most end in unknown space.
        """
        share = self.judged(reading, pose).against
        if share is None or share < NOTED_SHARE:
            return share
        settled = self.judged(reading, self.settled(reading, pose)[0]).against
        return share if settled is None else min(share, settled)

    def settled(self, reading: LaserReading, pose: F64) -> tuple[F64, float]:
        """Return the pose (3,) around a given one that a reading fits best, and its nats, by our model."""
        poses, origin = pose + OFFSETS, pose[:2].copy()
        nats = calibrated(self._map, reading, (poses - [*origin, 0.0]).astype(np.float32), origin, 0.0)
        best = int(nats.argmax())
        return poses[best], max(float(nats[best]), -SCAN_OUTLIER_NATS)

    def shown(self, reading: LaserReading, poses: Mapping[str, F64]) -> Shown:
        """Return the scan on the map, which beams disagree with the estimate and how, and how many agree."""
        nats = {name: self.nats_at(reading, pose) for name, pose in poses.items()}
        return shown(reading, self.judged(reading, poses["estimate"]), poses, nats)

    def nats_at(self, reading: LaserReading, pose: F64) -> float:
        """Return the nats of one pose (3,) in the map's frame."""
        turned = np.array([[0.0, 0.0, pose[2]]], np.float32)
        return float(self.log_likelihood(reading, turned, pose[:2])[0])

    def judged(self, reading: LaserReading, pose: F64) -> BeamJudgment:
        """Return what each beam says at a pose (3,) in the map's frame; panels ask again and again."""
        for known, where, judgment in self._judgments:
            if known is reading and np.array_equal(where, pose):
                return judgment
        judgment = judge(self._map, self._map.open_rays, reading, pose)
        self._judgments.append((reading, pose.copy(), judgment))
        return judgment

    @cached_property
    def _judgments(self) -> deque[tuple[LaserReading, F64, BeamJudgment]]:
        """The last ones: of an estimate and the truth, of some runs that share the laser."""
        return deque(maxlen=8)

    @cached_property
    def _matcher(self) -> Matcher:
        return Matcher(self.occupancy)

    @cached_property
    def _map(self) -> LaserMap:
        return laser_map(self.occupancy, self.parameters)


LASER = Laser.name


@lru_cache(maxsize=8)
def laser_of(occupancy: OccupancyMap, parameters: LaserParameters) -> Laser:
    """Return the laser over a map: runs with the same parameters share it, with its fields."""
    return Laser(occupancy, parameters)
