"""The evidence of one update: the few numbers that the causes of a failure are told apart by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..filter.localizer import ALL_ZERO, LEFT_MAP, Localizer
from ..filter.motion import MotionModel
from ..scoring.episodes import EpisodeFinder
from ..scoring.lost_signal import evidence_by_channels
from ..scoring.metrics import StepScore
from ..scoring.near_truth import NearTruth, near_truth
from ..sensor.laser.fit import ScanFit, ScanFits
from ..sensor.laser.sensor import LASER
from ..values import F32, F64, INCH_M, Frame, Moment, StepRecord, first_word, is_kidnapping, wrap
from .incidents import driven
from .surroundings import LightFit, PlaceFit, Surroundings, layout_fit, mean_level

MOVED_LEAST = 0.01  # m or rad, from which on the next picture must differ
DRAWS, KEPT = 200, 32  # particles that stand for the model; movements with noise of their own
TOGETHER = (0.1, 0.1, float(np.radians(2)))  # m, m, rad: standard deviations of a cloud that found itself
TRUTH_M, TRUTH_RAD = INCH_M, float(np.radians(2))  # accuracy of a true pose


@dataclass(frozen=True, slots=True)
class Surprise:
    """A true movement beside the model's, in the frame of the movement's end, in standard deviations."""

    forward: float
    left: float
    turn: float
    growth: float = 0.0  # nats by which the movement widens a cloud that had found itself

    @property
    def largest(self) -> float:
        """The largest of the three, without its sign."""
        return max(abs(self.forward), abs(self.left), abs(self.turn))

    @property
    def axis(self) -> str:
        """Which of the three that is."""
        sizes = {"forward": abs(self.forward), "left": abs(self.left), "turn": abs(self.turn)}
        return max(sizes, key=lambda name: sizes[name])


@lru_cache(1)
def _noise() -> F32:
    """Standard normals (KEPT, DRAWS, 3): the same for every movement, so that nothing depends on chance."""
    return np.random.default_rng(1).standard_normal((KEPT, DRAWS, 3)).astype(np.float32)


def surprise(model: MotionModel, origin: F64, before: F64, after: F64, motions: F64) -> Surprise:
    """Compare the true movement between two poses (3,) with what a model makes of motions (M, 3)."""
    start = before - np.append(origin, 0.0)
    poses: F32 = np.tile(start.astype(np.float32), (DRAWS, 1))
    for number, motion in enumerate(motions):
        poses = model.move(poses, origin, motion, _noise()[number % KEPT])
    ends = poses.astype(np.float64)
    mean = ends.mean(axis=0)
    heading = float(np.arctan2(np.sin(ends[:, 2]).mean(), np.cos(ends[:, 2]).mean()))
    spread = ends - mean
    spread[:, 2] = wrap(ends[:, 2] - heading)
    off = after - np.append(origin, 0.0) - mean
    off[2:] = wrap(after[2:] - heading)
    c, s = np.cos(heading), np.sin(heading)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    sd = np.sqrt((spread @ turned.T).var(axis=0) + np.square([TRUTH_M, TRUTH_M, TRUTH_RAD]))
    forward, left, turn = (turned @ off / sd).tolist()
    growth = float(np.log1p(spread.var(axis=0) / np.square(TOGETHER)).sum() / 2)
    return Surprise(forward, left, turn, growth)


@dataclass(frozen=True, slots=True)
class UpdateEvidence:
    """One update; None where it is not known: without truth, library, or motion model.

    Light and elements, which cost much, are added only around a loss, by `KeptPictures`.
    """

    step: int
    after_s: float | None  # since the picture before
    repeated: bool  # whether the robot moved and the picture compared is the one before, to the last pixel
    events: tuple[str, ...]  # of the log
    tilt_deg: float | None  # out of the plane, as the log told last; None: level, or not told
    floor: str  # that the robot was on when it set off, if the log or the map tells it
    broken: bool  # whether a likelihood was no number
    zero: bool  # whether all weights were zero
    cloud_left: bool  # whether the whole cloud would have left the map
    score: StepScore
    lost_m: float  # an error above it is lost
    size: int  # particles
    inside: int  # of them in free space
    ess: float  # effective sample size
    spread_nats: float  # log-likelihood from the library's middle reference to its best one
    best: float  # nats: how well the library's best reference explains the picture, by channels
    cloud: float  # nats: how well the cloud as a whole does, by channels
    gray: float  # mean level of the picture
    knows: float | None = None  # probability that the estimate is right, without truth
    outside: bool | None = None  # whether the truth lies off the map
    moved_m: float | None = None  # the truth since the picture before
    driven_m: float = 0.0  # odometry says
    surprise: Surprise | None = None  # of the true movement, to the motion model
    near: NearTruth | None = None  # the cloud around the truth
    reference_m: float | None = None  # from the truth to the nearest reference
    fit: PlaceFit | None = None  # of the picture at the truth
    alike: float | None = None  # correlation of how light its 12 x 9 parts are with those of the references
    light: LightFit | None = None  # of the picture, brightened or darkened
    began_together: bool = False  # whether it is the first, and its cloud was together before the picture
    scan: ScanFit | None = None  # of a robot that has a laser, and a map in place of references
    scan_here: ScanFit | None = None  # the same at the estimate, where no truth is known
    elements: F32 | None = None  # (D,) what those of the costliest channel cost the true place

    @property
    def kidnapped(self) -> bool:
        """Whether the log says that the robot was carried."""
        return any(map(is_kidnapping, self.events))

    @property
    def share_near(self) -> float:
        """The share of the weight near the truth, after the picture."""
        return 0.0 if self.near is None else self.near.shares[1]


@dataclass(slots=True)
class EvidenceFinder:
    """Follows one run; keeps the update before."""

    localizer: Localizer | None = None
    surroundings: Surroundings | None = None
    scans: ScanFits | None = None  # over a map in place of references
    _before: Moment | None = None
    _floor: str = ""  # that the log told last
    _tilt_deg: float | None = None

    def see(self, moment: Moment, record: StepRecord, episodes: EpisodeFinder) -> UpdateEvidence:
        """Return the evidence of the next update, which `episodes` have seen."""
        before, self._before = self._before, moment
        if self.localizer is not None and self.surroundings is None:
            self.surroundings = Surroundings(self.localizer.sensor, record.estimate.radii.lost_m)
            library = self.localizer.library
            if library.is_map and library.occupancy is not None:
                self.scans = ScanFits(library.occupancy, library.poses)
        frame, truth = moment.frame, moment.truth
        floor, self._floor = self._floor, _floor_after(moment.events, self._floor)
        self._tilt_deg = _tilt_after(moment.events, self._tilt_deg)
        comparison = record.sighting.comparison
        cost, likely = comparison.by_channels.cost, comparison.log_likelihood
        compared = len(likely) > 0  # with the library: a localizer without a camera has none to blame
        motions = frame.motions
        evidence = UpdateEvidence(
            step=frame.step,
            after_s=None if before is None else frame.time_s - before.frame.time_s,
            repeated=before is not None and compared and _moved(motions) and _same(frame, before.frame),
            events=moment.events,
            tilt_deg=self._tilt_deg,
            floor=floor,
            broken=bool(np.isnan(likely).any()),
            zero=ALL_ZERO in record.events,
            cloud_left=LEFT_MAP in record.events,
            score=episodes.score,
            lost_m=record.estimate.radii.lost_m,
            size=record.weighted.size,
            inside=int((record.sighting.entries >= 0).sum()),
            ess=record.effective_sample_size,
            spread_nats=float(likely.max() - np.median(likely)) if len(likely) else float("nan"),
            best=-float(cost.min()) if len(cost) else float("nan"),
            cloud=evidence_by_channels(record),
            gray=mean_level(frame.image),
            knows=episodes.signal.knows,
            driven_m=driven(motions),
        )
        if truth is not None:
            return self._with_truth(evidence, before, truth, moment, record)
        here = None if evidence.broken else self._scan(evidence, record, record.estimate.pose)
        return replace(evidence, scan_here=here)

    def _with_truth(
        self, evidence: UpdateEvidence, before: Moment | None, truth: F64, moment: Moment, record: StepRecord
    ) -> UpdateEvidence:
        """Add what only the truth (3,) tells."""
        last = None if before is None else before.truth
        moved_m = None if last is None else float(np.hypot(*(truth - last)[:2]))
        evidence = replace(evidence, near=near_truth(record, truth), moved_m=moved_m)
        surroundings = self.surroundings
        if surroundings is None or evidence.broken:
            return evidence
        surprising = None if last is None else self._surprise(last, truth, moment.frame.motions)
        if self.scans is not None:
            sd_m = float(np.hypot(*record.predicted.poses[:, :2].std(axis=0)))
            together = before is None and sd_m < record.estimate.radii.cluster_m
            scan = self._scan(evidence, record, truth)
            return replace(evidence, surprise=surprising, scan=scan, began_together=together)
        return replace(
            evidence,
            outside=surroundings.is_outside(truth),
            surprise=surprising,
            reference_m=surroundings.to_reference_m(truth),
            fit=surroundings.fit(record.sighting.comparison, truth, record.estimate.pose),
            alike=layout_fit(surroundings, moment.frame.image, truth),
        )

    def _scan(self, evidence: UpdateEvidence, record: StepRecord, truth: F64) -> ScanFit | None:
        """Return how the scan fits; None where there is none, or it says nothing."""
        scan, sensed = record.frame.scan, record.sighting.comparison.sensed
        laser = next((part for part in sensed if part.name == LASER), None)
        if self.scans is None or scan is None:
            return None
        reading = self.scans.read(scan)
        if reading is None or laser is None:
            return self.scans.unanswered(scan, truth)

        def own(poses: F64) -> F32:
            origin = poses[0, :2].copy()
            relative = (poses - np.append(origin, 0.0)).astype(np.float32)
            return laser.sensor.log_likelihood(laser.reading, relative, origin)

        is_off = evidence.score.correct is False
        return self.scans.fit(reading, truth, record.estimate.pose, own, is_off)

    def _surprise(self, before: F64, after: F64, motions: F64) -> Surprise | None:
        localizer = self.localizer
        if localizer is None or localizer.motion is None:
            return None
        return surprise(localizer.motion, localizer.library.origin, before, after, motions)


def _moved(motions: F64) -> bool:
    return len(motions) > 0 and float(np.abs(motions).max()) > MOVED_LEAST


def _same(frame: Frame, before: Frame) -> bool:
    """Return whether two pictures are equal; not those of one color, which stand for none."""
    image = frame.image
    if image.shape != before.image.shape or not image.size or (image == image[0, 0]).all():
        return False
    return bool(np.array_equal(image, before.image))


def _tilt_after(events: tuple[str, ...], last: float | None) -> float | None:
    """Return the tilt in degrees after events: "tilted 22 deg out of the plane", "level again"."""
    for text in events:
        word, _, rest = text.partition(" ")
        number = rest.split(" ", 1)[0]
        if word == "tilted" and number.isdecimal():
            last = float(number)
        elif text == "level again":
            last = None
    return last


def _floor_after(events: tuple[str, ...], last: str) -> str:
    floors = [text.split(" ", 1)[1] for text in events if first_word(text) == "floor" and " " in text]
    return floors[-1] if floors else last
