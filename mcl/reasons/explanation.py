"""Explaining an update: why one reference is believed, and where another one loses.

The log-likelihood of a reference is divided among channels, and each channel's part among the elements of its
descriptor, so that all parts add up to what the filter used, in nats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..sensor.distances import contributions
from ..sensor.model import BLENDS, SensorModel
from ..values import F32, F64, I32, Comparison, StepRecord, angle_between
from .place import rank_of

TRUTH, ESTIMATE, WINNER, ASKED = "truth", "estimate", "winner", "asked"  # who is explained


@dataclass(frozen=True, slots=True, eq=False)
class ChannelExplanation:
    """One reference by one channel."""

    channel: str
    distance_by: str  # key of maurice_mcl.sensor.distances.DISTANCES
    distance: float  # D, absolute
    calibrated: float  # D over the channel's scale, nats at weight 1
    quality: float  # 0 to 1, relative to the worst reference for this very picture
    rank: int  # 1: no reference is nearer; equals share the better rank
    loses: float  # nats this channel subtracts from the log-likelihood; all channels add up to minus it
    sample: F32  # (D,) what was measured in the picture
    reference: F32  # (D,) what was measured at the reference
    contributions: F32  # (D,) what each element adds to the distance, see maurice_mcl.sensor.distances

    @property
    def nats(self) -> F32:
        """Divide what this channel loses among its elements (D,): >= 0, they sum to `loses`."""
        total = float(self.contributions.sum(dtype=np.float64))
        return self.contributions * np.float32(self.loses / total if total > 0 else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class EntryExplanation:
    """Why one library entry has its likelihood."""

    entry: int
    pose: F64  # (3,) as surveyed, in the map's frame
    channels: tuple[ChannelExplanation, ...]  # as the comparison has them
    quality: float  # blended, 0 to 1
    log_likelihood: float
    rank: int  # 1: no entry is likelier; equals share the better rank
    entries: int  # L: ranks count up to it
    behind: float  # nats by which the winner is likelier; 0 for the winner itself
    verified: float = 0.0  # nats that verification takes from it, beside what channels do

    def lost_to(self, winner: EntryExplanation) -> F64:
        """Return what each channel (C,) costs this entry against another; with `verified`, the total gap."""
        pairs = zip(self.channels, winner.channels, strict=True)
        return np.array([mine.loses - best.loses for mine, best in pairs])

    def costliest(self, winner: EntryExplanation) -> ChannelExplanation:
        """Return the channel that costs this entry most against another; of equals, the first."""
        return self.channels[int(self.lost_to(winner).argmax())]


@dataclass(frozen=True, slots=True)
class PoseOffset:
    """How far one pose is from another."""

    apart_m: float
    turned_rad: float  # unsigned, at most pi


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """A pose and the reference that it is compared with."""

    who: str  # TRUTH, ESTIMATE, WINNER or ASKED
    pose: F64  # (3,) that the reference is nearest to; of the winner and an entry asked for, its own
    entry: EntryExplanation | None  # None: the pose lies outside free space
    weighed: float | None  # log-likelihood of a particle at that pose; -inf outside; None: not requested
    from_truth: PoseOffset | None  # of the pose; None: the truth is not known
    from_estimate: PoseOffset  # of the pose
    sensed: Mapping[str, float] = field(default_factory=dict)  # of `weighed`, the nats of each pose sensor


@dataclass(frozen=True, slots=True, eq=False)
class StepExplanation:
    """One update's references side by side: the truth's (where it is known), the estimate's, the winner."""

    step: int
    channels: tuple[str, ...]
    shown: tuple[Explained, ...]  # in the order truth, estimate, winner; what was asked for comes first

    @property
    def winner(self) -> EntryExplanation:
        """The entry of the best quality."""
        return next(e.entry for e in self.shown if e.who == WINNER and e.entry is not None)

    def of(self, who: str) -> Explained | None:
        """Return what is explained of `who`, or None."""
        return next((explained for explained in self.shown if explained.who == who), None)


def explain_all(
    comparison: Comparison, sensor: SensorModel, entries: Sequence[int]
) -> tuple[EntryExplanation, ...]:
    """Explain library entries. Raises IndexError for an unknown one."""
    for entry in entries:
        if not 0 <= entry < sensor.library.size:
            raise IndexError(f"no entry {entry}; there are 0 to {sensor.library.size - 1}")
    by_channel = list(zip(*_channels(comparison, sensor, list(entries)), strict=True))
    likely, winner = comparison.log_likelihood, int(comparison.quality.argmax())
    verified = _verified(comparison, sensor, entries)
    return tuple(
        EntryExplanation(
            entry=entry,
            pose=sensor.library.poses[entry],
            channels=by_channel[k],
            quality=float(comparison.quality[entry]),
            log_likelihood=float(likely[entry]),
            rank=rank_of(likely, entry),
            entries=len(likely),
            behind=float(likely[winner] - likely[entry]),
            verified=float(verified[k]),
        )
        for k, entry in enumerate(entries)
    )


def explain_step(
    record: StepRecord,
    sensor: SensorModel,
    truth: F64 | None,
    asked: F64 | int | None = None,
    *,
    weigh: bool = False,
) -> StepExplanation:
    """Explain the references of an update that matter, and one more that was asked for.

    That is the one nearest to a pose (3,) in the map's frame, or an entry of the library by its number.
    With `weigh`, each pose is also weighted like a particle there, at the cost of weighting all particles.
    """
    comparison = record.sighting.comparison
    poses = _poses(record, sensor, truth, asked)
    entries = nearest_entries(sensor, np.stack(list(poses.values())))
    nearest = dict(zip(poses, entries.tolist(), strict=True))
    if isinstance(asked, int):
        nearest[ASKED] = asked  # the nearest reference may be another of the same pose
    nearest[WINNER] = int(comparison.quality.argmax())
    nats_of_poses: list[float | None] = [None] * len(poses)
    sensed: list[dict[str, float]] = [{}] * len(poses)
    if weigh:
        at = _relative(sensor, np.stack(list(poses.values())))
        nats_of_poses = list(sensor.at(comparison, at).log_likelihood.astype(float).tolist())
        sensed = [_sensed(comparison, sensor, pose[None]) for pose in at]
    different = sorted({entry for entry in nearest.values() if entry >= 0})
    explanations = dict(zip(different, explain_all(comparison, sensor, different), strict=True))
    shown = tuple(
        Explained(
            who=who,
            pose=pose,
            entry=explanations.get(nearest[who]),
            weighed=weight,
            from_truth=None if truth is None else offset(pose, truth),
            from_estimate=offset(pose, record.estimate.pose),
            sensed=nats,
        )
        for (who, pose), weight, nats in zip(poses.items(), nats_of_poses, sensed, strict=True)
    )
    return StepExplanation(record.frame.step, comparison.channels, shown)


def _sensed(comparison: Comparison, sensor: SensorModel, pose: F32) -> dict[str, float]:
    """Return the nats that each pose sensor gives a pose (1, 3) relative to the origin, as it is weighed."""
    origin, sharpness = sensor.library.origin, sensor.parameters.sharpness
    return {
        read.name: sharpness * read.weight * float(read.sensor.log_likelihood(read.reading, pose, origin)[0])
        for read in comparison.sensed
    }


def nearest_entries(sensor: SensorModel, poses: F64) -> I32:
    """Return the entry (K,) that each pose (K, 3) in the map's frame is compared with; -1 outside."""
    return sensor.references.entries(_relative(sensor, poses), sensor.library.origin)


def offset(pose: F64, other: F64) -> PoseOffset:
    """Return how far a pose (3,) is from another."""
    (x, y, heading), (other_x, other_y, other_heading) = pose.tolist(), other.tolist()
    return PoseOffset(float(np.hypot(x - other_x, y - other_y)), angle_between(heading, other_heading))


def _poses(
    record: StepRecord, sensor: SensorModel, truth: F64 | None, asked: F64 | int | None
) -> dict[str, F64]:
    library = sensor.library
    poses: dict[str, F64] = {}
    if asked is not None:
        poses[ASKED] = library.poses[asked] if isinstance(asked, int) else asked
    if truth is not None:
        poses[TRUTH] = truth
    poses[ESTIMATE] = record.estimate.pose
    poses[WINNER] = library.poses[int(record.sighting.comparison.quality.argmax())]
    return poses


def _relative(sensor: SensorModel, poses: F64) -> F32:
    return np.asarray(poses - np.append(sensor.library.origin, 0.0), np.float32)


def _channels(
    comparison: Comparison, sensor: SensorModel, entries: list[int]
) -> list[list[ChannelExplanation]]:
    loses = _losses(comparison, sensor, entries)
    explanations = []
    for k, name in enumerate(comparison.channels):
        index, distance = sensor.library.index[name], sensor.parameters.distance_of(name)
        sample, references = comparison.descriptors[name], index.references[entries]
        adds = contributions(distance, sample, references, index)
        explanations.append(
            [
                ChannelExplanation(
                    channel=name,
                    distance_by=distance,
                    distance=float(comparison.distances[k, entry]),
                    calibrated=float(comparison.channel_cost[k, entry]),
                    quality=float(comparison.channel_quality[k, entry]),
                    rank=1 + int(np.count_nonzero(comparison.distances[k] < comparison.distances[k, entry])),
                    loses=float(loses[k, j]),
                    sample=sample,
                    reference=references[j],
                    contributions=adds[j],
                )
                for j, entry in enumerate(entries)
            ]
        )
    return explanations


def _losses(comparison: Comparison, sensor: SensorModel, entries: list[int]) -> F64:
    """Divide minus the log-likelihood of some entries among the channels: (C, K), >= 0.

    Blends are linear in their weights: a channel's part is the blend with the others at weight 0. The
    likelihood is divided in proportion, which is exact for the exponential one.
    """
    p, names = sensor.parameters, comparison.channels
    weights = np.array([p.weights[name] for name in names])
    scales = np.array([p.scale_of(name) for name in names])
    blend, rows = BLENDS[p.blend], np.eye(len(names)) * weights
    alone = [blend(comparison.distances, row, scales).distance[entries] for row in rows]
    parts = np.stack(alone).astype(np.float64)
    total = parts.sum(axis=0)
    share = np.divide(parts, total, out=np.zeros_like(parts), where=total > 0)
    left = -comparison.log_likelihood[entries].astype(np.float64) - _verified(comparison, sensor, entries)
    return np.asarray(share * np.maximum(left, 0.0))


def _verified(comparison: Comparison, sensor: SensorModel, entries: Sequence[int]) -> F64:
    """Return the nats (K,) that verification takes from some entries."""
    costs = [part.weight * part.cost[list(entries)].astype(np.float64) for part in comparison.verified]
    return np.asarray(sensor.parameters.sharpness * sum(costs, np.zeros(len(entries))))


LEAST_NATS = 0.05  # less is no reason


@dataclass(frozen=True, slots=True)
class LostRun:
    """The run of elements, within one plane of a descriptor, in which a reference loses most to another."""

    plane: int
    first: int  # element of the plane
    last: int
    nats: float  # lost there
    picture: float  # mean of these elements in the picture, in the channel's unit
    reference: float  # ... at the reference


def where_lost(mine: ChannelExplanation, best: ChannelExplanation, planes: int) -> LostRun | None:
    """Find the run of elements in which a reference loses most against another, by one channel; else None.

    Within a run, which lies in one of `planes` of equal length, the picture has more than the reference
    throughout, or less. Its sum above the mean of all elements is the largest, so that it ends where little
    is lost.
    """
    more = np.asarray(mine.nats - best.nats, np.float64)
    runs = [
        (plane, *_largest_run(row))
        for side in (mine.sample > mine.reference, mine.sample < mine.reference)
        for plane, row in enumerate((np.where(side, more, 0.0) - more.mean()).reshape(planes, -1).tolist())
    ]
    plane, first, last, _ = max(runs, key=lambda run: run[3])
    begin = plane * (len(more) // planes)
    at = slice(begin + first, begin + last + 1)
    nats = float(more[at].sum())
    if nats < LEAST_NATS:
        return None
    return LostRun(plane, first, last, nats, float(mine.sample[at].mean()), float(mine.reference[at].mean()))


def _largest_run(values: list[float]) -> tuple[int, int, float]:
    """Return the first and last element of the run with the largest sum, and that sum (Kadane)."""
    most, ends, total, first = -np.inf, (0, 0), 0.0, 0
    for k, value in enumerate(values):
        if total <= 0:
            total, first = 0.0, k
        total += value
        if total > most:
            most, ends = total, (first, k)
    return *ends, most
