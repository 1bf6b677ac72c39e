"""How well a library explains the pictures of a drive whose true poses are known.

The gain of a picture is the log of its likelihood at the truth over its mean likelihood at poses around the
truth: what it adds, in nats, to knowing the pose to within the radius *right*. Zero is knowing nothing, and
below zero it misleads. A library's own pictures cannot show this: they are compared with each other, and
those of one survey err alike. Neighboring pictures of a drive err together, too, so that scales are fitted
on groups of them, each as one observation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..sensor.ahead import KnownDescriptors, measured
from ..sensor.model import SensorModel
from ..values import F64, U8, Domain, rotated, stream, wrap
from .left_out import WIDENINGS

PICTURES_A_GROUP, MOST_GROUPS = 4, 16  # pictures in a row, and how many times that over a drive
LEAST_PICTURES = 24  # of known place in free space, below which nothing is concluded
COMPARED_POSES = 256  # poses that the truth is compared with
HEADING_SD_RAD = float(np.radians(20))  # of those poses
LEAST_GAIN_NATS = 0.05  # nats a picture, below which a sensor is not worth what it misleads


@dataclass(frozen=True, slots=True, eq=False)
class DrivePicture:
    """A picture of a drive, read when it is asked for, and where it was taken."""

    read: Callable[[], U8 | None]  # (H, W, 3) RGB; None: it cannot be read
    truth: F64  # (3,) in the map's frame


@dataclass(frozen=True, slots=True)
class DriveScore:
    """What the pictures of a drive say about a library and a sensor's scales."""

    pictures: int  # that were compared, of known place in free space
    gain: float  # mean nats per picture over knowing the pose to within the radius *right*; nan without any
    widening: float = 1.0  # of the likelihood, so that it does not mislead; 1: it does not
    tells: bool = True  # whether it is worth using with that widening; if not, it is the largest: no use

    @property
    def is_bad(self) -> bool:
        """Whether enough pictures were compared to say that they are not worth using as they are."""
        return self.pictures >= LEAST_PICTURES and self.gain < LEAST_GAIN_NATS

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        return asdict(self) | {"gain": self.gain if self.pictures else None, "is_bad": self.is_bad}


def spread_groups(count: int) -> list[list[int]]:
    """Return the numbers, from 0, of some runs of pictures in a row, spread over `count`."""
    size, groups = PICTURES_A_GROUP, min(MOST_GROUPS, -(-count // PICTURES_A_GROUP))
    firsts = np.linspace(0, max(count - size, 0), groups).round().astype(int)
    return [list(range(first, min(first + size, count))) for first in firsts.tolist() if first < count]


def score_drive(
    sensor: SensorModel,
    groups: Sequence[Sequence[DrivePicture]],
    right_m: float,
    known: KnownDescriptors | None = None,
) -> DriveScore:
    """Score groups of pictures in a row of a drive, by a sensor's channels.

    One picture of each group is enough where they agree with the library; otherwise all are compared.
    """
    offsets = _offsets(right_m)

    def rows_of(pictures: Iterable[DrivePicture]) -> F64:
        rows = [_log_likelihoods(sensor, picture, offsets, known) for picture in pictures]
        return np.array([row for row in rows if row is not None and np.isfinite(row[0])])

    quick = rows_of(group[0] for group in groups)
    if len(quick) >= min(len(groups), MOST_GROUPS) / 2 and (gain := _mean_gain([quick])) >= LEAST_GAIN_NATS:
        return DriveScore(len(quick), gain)
    rows = [group for group in map(rows_of, groups) if len(group)]
    pictures = sum(map(len, rows))
    if not pictures:
        return DriveScore(0, np.nan)
    score = DriveScore(pictures, _mean_gain(rows))
    if not score.is_bad:
        return score
    gains = [np.mean([_gain(group.sum(axis=0) / k) for group in rows]) for k in WIDENINGS.tolist()]
    best = int(np.argmax(gains))
    tells = best < len(gains) - 1 and bool(gains[best] >= LEAST_GAIN_NATS * PICTURES_A_GROUP)
    return replace(score, widening=float(f"{WIDENINGS[best if tells else -1]:.3g}"), tells=tells)


def _mean_gain(groups: Sequence[F64]) -> float:
    """Return the mean gain of pictures (T, N) of several groups, each group counted alike."""
    return float(np.mean([np.mean([_gain(row) for row in group]) for group in groups]))


def _offsets(right_m: float) -> F64:
    """Return poses (COMPARED_POSES, 3) about the origin, which is the first of them."""
    sd = [right_m, right_m, HEADING_SD_RAD]
    offsets = stream(Domain.COMPARE, 0).standard_normal((COMPARED_POSES, 3)) * sd
    offsets[0] = 0
    return np.asarray(offsets, np.float64)


def _log_likelihoods(
    sensor: SensorModel, picture: DrivePicture, offsets: F64, known: KnownDescriptors | None
) -> F64 | None:
    """Return the channels' log-likelihood (N,) at the truth, which is first, and at poses around it."""
    image = picture.read()
    if image is None:
        return None
    origin = sensor.library.origin
    x, y, heading = picture.truth - [*origin, 0.0]
    ahead, aside = rotated(offsets[:, 0], offsets[:, 1], heading)
    poses = np.column_stack([x + ahead, y + aside, wrap(heading + offsets[:, 2])]).astype(np.float32)
    comparison = sensor.compare(measured(image, sensor.weights, known)[0])
    return sensor.references.at(comparison.of_references, poses, origin).astype(np.float64)


def _gain(row: F64) -> float:
    """Return the log of the likelihood (N,) at the first pose over its mean; poses outside do not count."""
    inside = row[np.isfinite(row)]
    return float(row[0] - inside.max() - np.log(np.exp(inside - inside.max()).mean()))
