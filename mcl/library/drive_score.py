"""A drive whose true poses are known: how well the library explains its pictures.

The gain is the log of the likelihood at the truth over its mean at other poses: what pictures add, in nats,
to knowing the pose as well as these are spread. Zero is knowing nothing, and below zero they mislead. The
poses are around the truth, within one, three and ten times the radius *right*, and the library's own: along
a path of references a picture tells little nearby, and much farther out. A library's own pictures cannot
show this: they are compared with each other, and those of one survey err alike. So do the pictures that a
robot takes in a row at one place, which a filter multiplies: together they are one observation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..sensor.ahead import KnownDescriptors, measured
from ..sensor.model import SensorModel
from ..values.arrays import F64, U8
from ..values.geometry import rotated, wrap, wrap_angle
from ..values.plain import plain
from ..values.randomness import Domain, stream
from .left_out import WIDENINGS

PICTURES_A_PLACE, MOST_PICTURES = 4, 64  # read at one place, and of a whole drive
LEAST_PICTURES = 24  # of known place in free space, below which nothing is concluded
COMPARED_POSES = 256  # poses that the truth is compared with, of each spread
SPREADS = (1.0, 3.0, 10.0)  # of them, times the radius *right*; then come the library's own poses
HEADING_SD_RAD = float(np.radians(20))  # of the poses around the truth, and the turn that leaves a place
LEAST_GAIN_NATS = 0.05  # nats a picture, below which a sensor is not worth what it misleads
MUTED = 1e4  # a widening by which a likelihood says nothing, however many pictures are multiplied


@dataclass(frozen=True, slots=True, eq=False)
class DrivePicture:
    """A picture of a drive, read on demand, and where it was taken."""

    read: Callable[[], U8 | None]  # (H, W, 3) RGB; None: it cannot be read
    truth: F64  # (3,) in the map's frame
    motions: F64 = field(default_factory=lambda: np.empty((0, 3)))  # (M, 3) since the one before


@dataclass(frozen=True, slots=True)
class DriveScore:
    """What the pictures of a drive say about a library and a sensor's scales."""

    pictures: int  # that were compared, of known place in free space
    gain: float  # mean nats per picture over knowing the pose to within the radius *right*; nan without any
    far_gain: float = np.nan  # the most over knowing it less well, down to not at all; nan without any
    widening: float = 1.0  # of the likelihood, so that it does not mislead; 1: it does not
    tells: bool = True  # whether it is worth using with that widening; if not, it is `MUTED`

    @property
    def muted(self) -> DriveScore:
        """The score of a camera that is not worth using."""
        return replace(self, widening=MUTED, tells=False)

    @property
    def concludes(self) -> bool:
        """Whether enough pictures were compared to say anything."""
        return self.pictures >= LEAST_PICTURES

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        return plain(self) | {"is_bad": not self.tells}


def stays(poses: F64, right_m: float) -> list[range]:
    """Divide true poses (n, 3) of a drive into stays, each within a radius and a turn of where it began."""
    ranges, first = list[range](), 0
    for k, pose in enumerate(poses):
        away, turned = pose[:2] - poses[first, :2], abs(wrap_angle(pose[2] - poses[first, 2]))
        if np.hypot(*away) > right_m or turned > HEADING_SD_RAD:
            ranges.append(range(first, k))
            first = k
    return [*ranges, range(first, len(poses))] if len(poses) else []


@dataclass(frozen=True, slots=True, eq=False)
class _Stay:
    """Some pictures of a stay at one place, compared."""

    rows: F64  # (T, N) log-likelihoods, at the truth first
    pictures: int  # of the stay, compared or not

    def gains(self, widening: float = 1.0) -> F64:
        """Return the gain (S,) by spread of all its pictures together, as one observation."""
        return _gains(self.rows.mean(axis=0) * (self.pictures / widening))


def score_drive(
    sensor: SensorModel,
    pictures: Sequence[DrivePicture],
    right_m: float,
    known: KnownDescriptors | None = None,
) -> DriveScore:
    """Score the pictures of a drive, in order, by a sensor's channels.

    A few places are enough where all agree with the library; otherwise more are compared.
    """
    offsets, compared = _offsets(right_m), dict[range, _Stay | None]()

    def compare(stay: range) -> _Stay | None:
        rows = [_log_likelihoods(sensor, pictures[k], offsets, known) for k in _some(stay, PICTURES_A_PLACE)]
        inside = [row for row in rows if row is not None and np.isfinite(row[0])]
        return _Stay(np.array(inside), len(stay)) if inside else None

    def at(some: Sequence[range]) -> list[_Stay]:
        compared.update((stay, compare(stay)) for stay in some if stay not in compared)
        return [scored for stay in some if (scored := compared[stay]) is not None]

    chosen = _chosen(stays(np.array([picture.truth for picture in pictures]), right_m))
    quick = at(_some(chosen, LEAST_PICTURES))
    if quick and (score := _score(quick)).concludes and _surely_gain(quick):
        return score
    every = at(chosen)
    if not every:
        return DriveScore(0, np.nan)
    score = _score(every)
    if not score.concludes or _gain_of(every).min() >= LEAST_GAIN_NATS:
        return score
    gains = np.array([_gain_of(every, k) for k in WIDENINGS.tolist()])  # (K, S)
    best = int(gains.mean(axis=1).argmax())
    least = LEAST_GAIN_NATS * float(np.mean([stay.pictures for stay in every]))
    tells = best < len(gains) - 1 and bool(gains[best].max() >= least)
    return replace(score, widening=float(f"{WIDENINGS[best]:.3g}")) if tells else score.muted


def _chosen(every: Sequence[range]) -> Sequence[range]:
    """Return as many stays, evenly spread, as hold no more pictures than are compared."""
    each = sum(min(len(stay), PICTURES_A_PLACE) for stay in every) / max(len(every), 1)
    return _some(every, int(MOST_PICTURES / max(each, 1)))


def _some(values: Sequence[Any], most: int) -> list[Any]:
    """Return at most `most` values, evenly spread."""
    count = min(most, len(values))
    return [values[k] for k in np.linspace(0, len(values) - 1, count).round().astype(int).tolist()]


def _gain_of(some: Sequence[_Stay], widening: float = 1.0) -> F64:
    """Return the mean gain (S,) by spread of stays, each as one observation."""
    return np.asarray(np.mean([stay.gains(widening) for stay in some], axis=0), np.float64)


def _surely_gain(some: Sequence[_Stay]) -> bool:
    """Whether stays gain enough over every spread, by a standard error more than that."""
    gains = np.array([stay.gains() for stay in some])
    error = gains.std(axis=0) / np.sqrt(len(gains))
    return bool((gains.mean(axis=0) - error).min() >= LEAST_GAIN_NATS)


def _score(some: Sequence[_Stay]) -> DriveScore:
    """Return what single pictures of some stays gain; each stay counts alike."""
    gains = [np.mean([_gains(row) for row in stay.rows], axis=0) for stay in some]
    near, *far = np.mean(gains, axis=0).tolist()
    return DriveScore(sum(len(stay.rows) for stay in some), near, max(far))


def _offsets(right_m: float) -> F64:
    """Return poses (1 + S * (COMPARED_POSES - 1), 3) about the origin: itself, then those of each spread."""
    sd = np.array([right_m, right_m, HEADING_SD_RAD])
    offsets = stream(Domain.COMPARE, 0).standard_normal((COMPARED_POSES, 3)) * sd
    wider = [offsets[1:] * [spread, spread, min(spread, 3.0)] for spread in SPREADS]
    return np.concatenate([np.zeros((1, 3)), *wider])


def _log_likelihoods(
    sensor: SensorModel, picture: DrivePicture, offsets: F64, known: KnownDescriptors | None
) -> F64 | None:
    """Return the log-likelihood (N,) at the truth, which is first, at poses around it, and at references."""
    image = picture.read()
    if image is None:
        return None
    origin = sensor.library.origin
    x, y, heading = picture.truth - [*origin, 0.0]
    ahead, aside = rotated(offsets[:, 0], offsets[:, 1], heading)
    poses = np.column_stack([x + ahead, y + aside, wrap(heading + offsets[:, 2])]).astype(np.float32)
    comparison = sensor.compare(measured(image, sensor.weights, known)[0])
    around = sensor.references.at(comparison.of_references, poses, origin)
    return np.concatenate([around, comparison.log_likelihood[: sensor.library.size]]).astype(np.float64)


def _gains(row: F64) -> F64:
    """Return the gain (S,) by spread of log-likelihoods (N,); poses outside do not count."""
    ends = 1 + (COMPARED_POSES - 1) * np.arange(1, len(SPREADS) + 1)
    parts = np.split(row[1:], ends - 1)
    return np.array([_gain(np.concatenate([row[:1], part])) for part in parts])


def _gain(row: F64) -> float:
    """Return the log of the likelihood (N,) at the first pose over its mean; poses outside do not count."""
    inside = row[np.isfinite(row)]
    return float(row[0] - inside.max() - np.log(np.exp(inside - inside.max()).mean()))
