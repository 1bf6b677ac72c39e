"""How one scan fits the map at the truth, at an estimate, and with the laser mounted otherwise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...values import F32, F64, LaserScan, OccupancyMap, Sensed, compose, rotated
from .beams import JUDGMENTS, judge
from .models import calibrated, laser_map
from .parameters import LaserParameters
from .reading import LaserReading, read_scan

EVEN = LaserParameters(model="likelihood_field_prob")  # beams chosen evenly, also those that hit nothing
MISFIT_NATS = float(-np.log(0.1))  # the cost of a beam that disagrees altogether
OFF_SHARE = 0.2  # of the beams disagree: the scan does not fit
NOTED_SHARE = 0.08  # with fewer a scan is not examined: with 0.4 of the beams in unknown space it is 0.09
TYPICAL_PLACES = 64
POSES_BETWEEN = 8  # the estimate and the truth, that are tried
SEEN_SHARE = 0.8  # of the reach: a wall nearer than that should have been hit
YAWS = np.radians(np.arange(-180, 180, 5.0))
MOUNTS_M = np.stack(np.meshgrid(*[np.arange(-5, 6) * 0.1] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
MOST_MOUNT_SCANS = 60  # scans

OwnModel = Callable[[F64], F32]


@dataclass(frozen=True, slots=True)
class Mounting:
    """How the laser would have to be turned on the robot for scans to fit best."""

    yaw_rad: float  # added to that of the mount
    mirrored: bool  # and its beams counted the other way around
    nats: float  # a scan, on average
    as_it_is: float  # the same without turning
    place: tuple[float, float] = (0.0, 0.0)  # or where it would have to be: ahead and left of its place, in m
    placed_nats: float = -np.inf  # a scan then, on average

    @classmethod
    def of(cls, nats: F64, by_place: F64) -> Mounting:
        """Take mean nats (2, Y) by YAWS, and (S,) by MOUNTS_M."""
        at = int(by_place.argmax())
        row, column = np.unravel_index(int(nats.argmax()), nats.shape)
        usual = float(nats[0, len(YAWS) // 2])
        turned = (float(YAWS[column]), bool(row), float(nats[row, column]), usual)
        return cls(*turned, (float(MOUNTS_M[at, 0]), float(MOUNTS_M[at, 1])), float(by_place[at]))


@dataclass(frozen=True, slots=True)
class ScanFit:
    """One scan at the true pose, beside the estimate. Nats are of the calibrated model, unless it says so."""

    off: float  # share of the beams that disagree with the map at the truth, by their nats
    ahead: float = 0.0  # nats of the truth over the estimate; 0, as all below, where all is well
    own_ahead: float = 0.0  # the same by the run's own model of the laser
    own_over_typical: float = 0.0  # nats of the truth over a typical place, by the run's own model
    skill: float = 1.0  # of the nats that a typical place lacks, the share that the truth has; by chance 0
    between: float = 0.0  # nats by which the worst pose from estimate to truth is behind the truth
    apart_m: float = 0.0  # from estimate to truth; 0: the estimate was not looked at
    rival: tuple[float, float] = (0.0, 0.0)  # x and y in m of the estimate
    short_m: float = float("nan")  # from what short beams hit to the map's wall; NaN without any
    shares: Mapping[str, float] = field(default_factory=dict)  # of the beams, by JUDGMENTS and "unseen"
    mounting: Mounting | None = None  # by the scans up to now that do not fit
    cut: float = 0.0  # share of the beams that hit something which the run's laser_max_range leaves out

    @property
    def is_compared(self) -> bool:
        """Whether the estimate was looked at, too: not where all is well, or a scan says nothing."""
        return self.apart_m > 0


@dataclass(eq=False)
class ScanFits:
    """A map, prepared for saying how scans fit it."""

    occupancy: OccupancyMap
    places: F64  # (L, 3) typical poses
    has_filter: bool = False  # a filter reads the scans: one that it cannot read is not compared
    max_range_m: float = -1.0  # the filter's laser_max_range; -1: that of the scans
    _yaws: F64 = field(default_factory=lambda: np.zeros((2, len(YAWS))))
    _placed: F64 = field(default_factory=lambda: np.zeros(len(MOUNTS_M)))
    _mounted: int = 0  # scans whose mount was tried

    def __post_init__(self) -> None:
        self._map = laser_map(self.occupancy, LaserParameters())
        self._rays = self._map.open_rays
        self._typical = self.places[:: max(len(self.places) // TYPICAL_PLACES, 1)]

    def read(self, scan: LaserScan) -> LaserReading | None:
        """Return evenly chosen beams, also those that hit nothing; None where too few hit something."""
        return read_scan(scan, EVEN)

    def lay(self, scan: LaserScan, laser: Sensed | None, pose: F64, estimate: F64, is_off: bool) -> ScanFit:
        """Say how a scan, and what the run's `laser` read in it, fits a pose (3,): see `fit`."""
        reading, cut = self.read(scan), self._cut(scan)
        if reading is None or (laser is None and self.has_filter):
            return replace(self.unanswered(scan, pose), cut=cut)

        def own(poses: F64) -> F32:
            if laser is None:  # the run's own model is not known
                return self.nats(reading, poses)
            origin = poses[0, :2].copy()
            relative = (poses - np.append(origin, 0.0)).astype(np.float32)
            return laser.sensor.log_likelihood(laser.reading, relative, origin)

        return replace(self.fit(reading, pose, estimate, own, is_off), cut=cut)

    def _cut(self, scan: LaserScan) -> float:
        """Return the share of the beams that hit something which the filter takes for misses."""
        if not 0 < self.max_range_m < scan.max_m or not scan.hits.any():
            return 0.0
        return float((scan.ranges_m[scan.hits] >= self.max_range_m).mean())

    def unanswered(self, scan: LaserScan, truth: F64) -> ScanFit:
        """Say which walls a scan should have hit, of which too few beams hit something."""
        laser = compose(truth, scan.mount)
        expected = self._rays.cast(laser[None], scan.angles_rad - scan.mount[2], scan.max_m)[0]
        missed = ~scan.hits & (expected < SEEN_SHARE * scan.max_m)
        return ScanFit(0.0, shares={"unseen": float(missed.mean())})

    def nats(self, reading: LaserReading, poses: F64) -> F32:
        """Return the nats (N,) of poses (N, 3) in the map's frame."""
        origin = poses[0, :2].copy()
        return calibrated(self._map, reading, (poses - [*origin, 0]).astype(np.float32), origin, 0.0)

    def fit(self, reading: LaserReading, truth: F64, estimate: F64, own: OwnModel, is_off: bool) -> ScanFit:
        """Say how a scan fits the truth (3,), and if it does not, or the estimate is off, what does.

        `own` returns the nats (N,) of poses (N, 3) by the run's own model.
        """
        most = -MISFIT_NATS * float(reading.hits.sum())
        off = float(self.nats(reading, truth[None])[0]) / most
        if off < NOTED_SHARE and not is_off:
            return ScanFit(off)
        between = np.linspace(truth, estimate, POSES_BETWEEN + 2)[1:-1]
        between[:, 2] = truth[2]
        poses = np.concatenate([truth[None], estimate[None], between, self._typical])
        nats, own_nats = self.nats(reading, poses).astype(np.float64), own(poses).astype(np.float64)
        lacks = nats[0] - float(np.median(nats[2 + POSES_BETWEEN :]))
        if off >= OFF_SHARE:
            self._mount(reading, truth)
        fit = ScanFit(
            off=off,
            ahead=float(nats[0] - nats[1]),
            own_ahead=float(own_nats[0] - own_nats[1]),
            own_over_typical=float(own_nats[0] - np.median(own_nats[2 + POSES_BETWEEN :])),
            skill=float(lacks / max(lacks - nats[0], 1e-9)),
            between=float(nats[0] - nats[2 : 2 + POSES_BETWEEN].min()),
            apart_m=float(np.hypot(*(truth - estimate)[:2])),
            rival=(float(estimate[0]), float(estimate[1])),
            mounting=Mounting.of(self._yaws / self._mounted, self._placed / self._mounted)
            if self._mounted
            else None,
        )
        return self._judged(fit, reading, truth)

    def _judged(self, fit: ScanFit, reading: LaserReading, truth: F64) -> ScanFit:
        """Add what each beam says at the truth: all are followed through the map."""
        judgment = judge(self._map, self._rays, reading, truth)
        shares = {name: judgment.count(name) / reading.size for name in JUDGMENTS}
        expected = judgment.expected_m < SEEN_SHARE * reading.max_m
        shares["unseen"] = float((judgment.are("miss") & expected).sum()) / reading.size
        short = judgment.are("short")
        apart = (judgment.expected_m - judgment.measured_m)[short]
        return replace(fit, shares=shares, short_m=float(np.median(apart)) if short.any() else np.nan)

    def _mount(self, reading: LaserReading, truth: F64) -> None:
        """Try the laser turned, and mirrored, at a true pose."""
        if self._mounted < MOST_MOUNT_SCANS:
            self._mounted += 1
            self._yaws += self.turned(reading, truth)
            self._placed += self.placed(reading, truth)

    def placed(self, reading: LaserReading, truth: F64) -> F64:
        """Return the nats (S,) of a scan with the laser ahead and left of its place by MOUNTS_M."""
        moves = np.column_stack(rotated(MOUNTS_M[:, 0], MOUNTS_M[:, 1], float(truth[2])))
        poses = np.column_stack([truth[:2] + moves, np.full(len(moves), truth[2])])
        return self.nats(reading, poses).astype(np.float64)

    def turned(self, reading: LaserReading, truth: F64) -> F64:
        """Return the nats (2, Y) of a scan with the laser turned by YAWS, as it is and mirrored."""
        laser, scan = compose(truth, reading.scan.mount), replace(reading.scan, mount=np.zeros(3))
        poses = np.column_stack([np.tile(laser[:2], (len(YAWS), 1)), laser[2] + YAWS])
        mirrored = replace(scan, start_rad=-scan.start_rad, step_rad=-scan.step_rad)
        readings = [self.read(seen) for seen in (scan, mirrored)]
        return np.stack([self.nats(seen, poses) for seen in readings if seen is not None])
