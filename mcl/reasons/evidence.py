"""The evidence of an update and of an episode: the numbers that tell causes of a failure apart."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from ..filter.localizer import ALL_ZERO, LEFT_MAP, Localizer
from ..filter.motion import MotionModel
from ..scoring.episodes import Episode
from ..scoring.lost_signal import KNOWS_ABOVE, evidence_by_channels
from ..scoring.metrics import StepScore, score_step
from ..scoring.modes import NearTruth, near_truth
from ..sensor.laser.fit import ScanFit, ScanFits
from ..sensor.laser.sensor import LASER, Laser
from ..values import F32, F64, INCH_M, NO_PICTURE, Frame, Moment, StepRecord, first_word, is_kidnapping, wrap
from .causes import Failure, Value, driven
from .surroundings import LightFit, PlaceFit, Surroundings, UsualFit, layout_fit, mean_level

MOVED_LEAST = 0.01  # m or rad, from which on the next picture must differ


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
    estimate_m: float = 0.0  # the estimate moved
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
    later: Callable[[], dict[str, Any]] | None = None  # returns surprise and scan, if not known yet

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
    surroundings: Surroundings | None = None  # made at the first update, unless runs over a drive share them
    scans: ScanFits | None = None  # over a map in place of references
    _before: Moment | None = None
    _estimate: F64 | None = None  # of the update before
    _floor: str = ""  # that the log told last
    _tilt_deg: float | None = None

    def see(self, moment: Moment, record: StepRecord, knows: float | None) -> UpdateEvidence:
        """Return the evidence of the next update; `knows` is what the lost signal says of it."""
        before, self._before = self._before, moment
        last_estimate, self._estimate = self._estimate, record.estimate.pose
        if self.localizer is not None and before is None:
            lost_m, library = record.estimate.radii.lost_m, self.localizer.library
            self.surroundings = self.surroundings or Surroundings(self.localizer.sensor, lost_m)
            if library.is_map and library.occupancy is not None:
                laser = library.sensors.get(LASER)
                most_m = laser.parameters.laser_max_range if isinstance(laser, Laser) else -1.0
                self.scans = ScanFits(library.occupancy, library.poses, has_filter=True, max_range_m=most_m)
        frame, truth, score = moment.frame, moment.truth, score_step(record.estimate, moment.truth)
        floor, self._floor = self._floor, _floor_after(moment.events, self._floor)
        self._tilt_deg = _tilt_after(moment.events, self._tilt_deg)
        comparison = record.sighting.comparison
        cost, likely = comparison.by_channels.cost, comparison.log_likelihood
        compared = len(likely) > 0  # with the library: a localizer without a camera has none to blame
        motions, last = frame.motions, None if before is None or truth is None else before.truth
        broken, lost_m = bool(np.isnan(likely).any()), record.estimate.radii.lost_m
        evidence = UpdateEvidence(
            step=frame.step,
            after_s=None if before is None else frame.time_s - before.frame.time_s,
            repeated=before is not None and compared and _moved(motions) and _same(frame, before.frame),
            events=moment.events,
            tilt_deg=self._tilt_deg,
            floor=floor,
            broken=broken,
            zero=ALL_ZERO in record.events,
            cloud_left=LEFT_MAP in record.events,
            score=score,
            lost_m=lost_m,
            size=record.weighted.size,
            inside=int((record.sighting.entries >= 0).sum()),
            ess=record.effective_sample_size,
            spread_nats=_ahead_of_most(likely) if compared else float("nan"),
            best=-float(cost.min()) if len(cost) else float("nan"),
            cloud=evidence_by_channels(record),
            gray=mean_level(frame.image),
            knows=knows,
            driven_m=driven(motions),
            estimate_m=_apart_m(record.estimate.pose, last_estimate),
            near=None if truth is None else near_truth(record, truth),
            moved_m=None if last is None or truth is None else float(np.hypot(*(truth - last)[:2])),
            began_together=before is None and self.scans is not None and _sd_m(record) < lost_m,
            later=None if broken else self._later(record, last, truth, score),
        )
        surroundings = self.surroundings
        if truth is None or broken or self.scans is not None or surroundings is None:
            return evidence
        return replace(
            evidence,
            outside=surroundings.is_outside(truth),
            reference_m=surroundings.to_reference_m(truth),
            fit=surroundings.fit(comparison, truth, record.estimate.pose),
            alike=layout_fit(surroundings, frame.image, truth, comparison.descriptors),
        )

    def _later(
        self, record: StepRecord, before: F64 | None, truth: F64 | None, score: StepScore
    ) -> Callable[[], dict[str, Any]]:
        """Return what finds the fields that cost much; it keeps the scan alone."""
        scan, motions, estimate = record.frame.scan, record.frame.motions, record.estimate.pose
        sensed = (part for part in record.sighting.comparison.sensed if part.name == LASER)
        unread = next((replace(part, reading=None, cost=np.zeros(0, np.float32)) for part in sensed), None)
        frame = replace(record.frame, image=NO_PICTURE)
        localizer, scans, is_off = self.localizer, self.scans, score.localized is False

        def told() -> dict[str, Any]:
            pose = estimate if truth is None else truth
            laser = None if unread is None else replace(unread, reading=unread.sensor.read(frame))
            fit = None if scans is None or scan is None else scans.lay(scan, laser, pose, estimate, is_off)
            if truth is None:
                return {"scan_here": fit}
            if before is None or localizer is None or localizer.motion is None:
                return {"scan": fit}
            moved = surprise(localizer.motion, localizer.library.origin, before, truth, motions)
            return {"scan": fit, "surprise": moved}

        return told


def _apart_m(pose: F64, other: F64 | None) -> float:
    return 0.0 if other is None else float(np.hypot(*(pose - other)[:2]))


def _sd_m(record: StepRecord) -> float:
    """Return the standard deviation of a cloud's places; RViz spreads them by 0.5 m an axis."""
    return float(np.hypot(*record.predicted.poses[:, :2].std(axis=0)))


def _ahead_of_most(likely: F32) -> float:
    """Return how far the best of some log-likelihoods (L,) is ahead of the middle one."""
    return float(likely.max() - np.median(likely)) if likely.any() else 0.0


def _moved(motions: F64) -> bool:
    return len(motions) > 0 and float(np.abs(motions).max()) > MOVED_LEAST


def _same(frame: Frame, before: Frame) -> bool:
    """Return whether two pictures are equal; not those of one color, which stand for none."""
    image = frame.image
    if image is NO_PICTURE or image.size == 0:
        return False
    return np.array_equal(image, before.image) and not (image == image[0, 0]).all()


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


# How far a true movement is from what a motion model makes of odometry.

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
        return max(("forward", "left", "turn"), key=lambda name: abs(getattr(self, name)))


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


# One episode with the evidence before and during it: what the rules of a diagnosis look at.

NEAR_SHARE = 0.5  # share of the weight near the truth that counts as having it
BEFORE_UPDATES, AFTER_UPDATES = 3, 1  # before the last one that held the truth, and after the first lost one
FIRST_UPDATES = 10  # of an episode, whose pictures are looked at
AWAY_UPDATES, AWAY_SHARE = 4, 0.75  # at another place: at least so many, and this share of them
CLEAR_SHARE = 0.15  # of the spread of log-likelihoods over the library
WENT_ON = 2.0  # times the usual way between updates: farther than a robot that waits goes before the next
WAY_PERCENT = 90.0  # of the updates, whose way is shorter: a laser is used after turns on the spot, too
LEAST_SHARE = 0.5  # over the number of particles: a smaller share near the truth is none
BEGAN_UPDATES = 10  # before it is probably lost, in which that began
LOOKBACK_UPDATES = 30  # before a loss, that are looked at if the truth was never held


@dataclass(frozen=True, eq=False)
class Story:
    """The updates of one run and one of its episodes; the other numbers are indexes of updates."""

    updates: Sequence[UpdateEvidence]  # from the run's first
    episode: Episode
    since: int = 0  # of the first update after the failure before
    spacing_m: float = float("nan")  # of the library's places
    usual: UsualFit | None = None  # of the library's own pictures; None: not known
    levels: F64 | None = None  # (L, 3) how light the references are; None: not known

    @cached_property
    def lost(self) -> int:
        """The first update that was off."""
        return self._index(self.episode.onset)

    @cached_property
    def end(self) -> int:
        """The last update of the episode."""
        return self._index(self.episode.last)

    def _index(self, step: int) -> int:
        return min(bisect_left(self.updates, step, key=lambda u: u.step), len(self.updates) - 1)

    @property
    def since_last(self) -> range:
        """The updates from the failure before to the end of the episode."""
        return range(self.since, self.end + 1)

    @cached_property
    def last_near(self) -> int | None:
        """The index of the last update before the loss at which the cloud held the truth; None: never."""
        good = [k for k in range(self.since, self.lost) if self.updates[k].share_near >= NEAR_SHARE]
        return good[-1] if good else None

    @cached_property
    def began(self) -> int:
        """The update at which a doubt began: after it last knew where it was."""
        began = self.lost
        while began > max(self.lost - BEGAN_UPDATES, 1) and not knows_where(self.updates[began - 1]):
            began -= 1
        return began

    @cached_property
    def doubted(self) -> range:
        """The updates at which what made a run doubtful shows, without truth: since one before it began."""
        return range(max(self.began - 1, 0), self.lost + 1)

    @cached_property
    def window(self) -> range:
        """The updates at which a cause must show: from shortly before it was lost until it was."""
        if self.last_near is None:
            first = max(self.since, self.lost - LOOKBACK_UPDATES)
        else:
            first = max(self.since, self.last_near - BEFORE_UPDATES)
        return range(first, min(self.lost + AFTER_UPDATES, self.end) + 1)

    @cached_property
    def nearby(self) -> range:
        """The updates whose pictures are judged: the window, and the first of the episode."""
        return range(self.window.start, min(self.lost + LOOKBACK_UPDATES, self.end) + 1)

    @cached_property
    def moves(self) -> range:
        """The updates whose movements are looked at; of a search, until it held the truth last."""
        if self.last_near is not None:
            return self.window
        shares = [self.updates[k].share_near for k in self.since_last]
        most = max(shares, default=0.0)
        if most < NEAR_SHARE / 2:
            return self.window
        last = max(k for k, share in enumerate(shares, self.since) if share >= most / 2)
        return range(self.window.start, min(max(last + BEFORE_UPDATES, self.window.stop), self.end + 1))

    @property
    def nats_lost(self) -> tuple[float, float]:
        """Nats of the weight near the truth that moving away from it took, and that pictures against it took.

        From the last update that held the truth to the first that was off, and one more.
        """
        first = self.window.start if self.last_near is None else self.last_near
        motion, pictures = 0.0, 0.0
        for before, now in pairwise(self.updates[first : self.window.stop]):
            if before.near is None or now.near is None:
                continue
            least = LEAST_SHARE / now.size
            shares = (before.near.shares[2], *now.near.shares[:2])
            near, moved, weighting = (float(np.log(max(share, least))) for share in shares)
            motion, pictures = motion + near - moved, pictures + moved - weighting
        return motion, pictures

    @cached_property
    def fits_truth(self) -> bool:
        """Whether the pictures of the episode fit the true place clearly better than that of the estimate."""
        away = [
            update
            for update in self.updates[self.lost : self.end + 1]
            if update.fit is not None and update.fit.estimate_behind
        ]
        if len(away) < AWAY_UPDATES:
            return False
        behind = np.array([update.fit.estimate_behind for update in away if update.fit])
        spread = float(np.median([update.spread_nats for update in away]))
        return float((behind < 0).mean()) >= AWAY_SHARE and float(np.median(behind)) < -CLEAR_SHARE * spread

    @cached_property
    def pictures(self) -> range:
        """The updates whose pictures may have led it astray: since it held the truth last."""
        first = self.window.start if self.last_near is None else max(self.last_near, self.since)
        return range(first, min(self.lost + FIRST_UPDATES, self.end) + 1)

    def where(self, indexes: range, holds: Callable[[UpdateEvidence], bool]) -> list[UpdateEvidence]:
        """Return the updates of a range for which something holds."""
        return [self.updates[k] for k in indexes if holds(self.updates[k])]

    @cached_property
    def usual_s(self) -> float:
        """The median time between pictures."""
        return median(update.after_s for update in self.updates if update.after_s is not None)

    def waited(self, update: UpdateEvidence) -> float:
        """Return the time before an update over the usual; 0 for scans of a robot that stood still."""
        usual_m = float(np.percentile([update.driven_m for update in self.updates], WAY_PERCENT))
        if not update.spread_nats > 0 and update.driven_m < WENT_ON * usual_m:
            return 0.0
        return (update.after_s or 0.0) / self.usual_s if self.usual_s > 0 else 0.0

    @cached_property
    def usual_speed(self) -> float:
        """The median speed of the true path in m/s, from picture to picture."""
        known = [
            update.moved_m / update.after_s
            for update in self.updates
            if update.moved_m is not None and update.after_s and update.after_s < 2 * self.usual_s
        ]
        return median(known)

    def failure(self, kind: str, first: int, **evidence: Value) -> Failure:
        """Return the failure of a kind, whose cause shows first at a step."""
        return Failure(kind, first, self.episode, evidence)


def knows_where(update: UpdateEvidence) -> bool:
    """Return whether the lost signal says that a run knows where it is."""
    return (update.knows or 0.0) > KNOWS_ABOVE


def median(values: Iterable[float]) -> float:
    """Return the median of values; nan of none."""
    known = list(values)
    return float(np.median(known)) if known else float("nan")
