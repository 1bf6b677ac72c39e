"""Places where a robot may be as well: a filter that jumps believes one, and keeps none of the others.

A cloud that has moved to one place says nothing of where it came from, nor of other places that the same
reading fits. They are followed by odometry for as long as what is read speaks for them, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from ..values import F64, Sensed, StepRecord, compose, wrap_angle

NEAR_RAD = math.radians(45)  # and within the radius *right*: the same place
SCANS_WORTH = 0.5  # of a reading's nats: those of one wall share their errors
ALONG_M = np.arange(-6, 7) * 0.5  # a corridor looks alike both ways: turned, a little ahead or behind
MOST_NATS = 10.0  # by which one place is behind another; farther behind it is no rival
MOST_PLACES = 8  # rivals that are followed


@dataclass(frozen=True, slots=True)
class RivalPlace:
    """A pose that the robot may have, and by how many nats what was read since speaks for it."""

    pose: F64  # (3,) in the map's frame
    nats: float = 0.0

    def is_near(self, pose: F64, right_m: float) -> bool:
        """Whether a pose (3,) is the same place."""
        dx, dy, turn = self.pose - pose
        return math.hypot(dx, dy) < right_m and abs(wrap_angle(float(turn))) < NEAR_RAD


@dataclass(slots=True)
class RivalPlaces:
    """Follows the estimates of one run; the first place is the estimate's own."""

    places: tuple[RivalPlace, ...] = ()

    def see(self, record: StepRecord, part: Sensed) -> float:
        """Process the next update; return the probability of the estimate among the places, 0 to 1."""
        pose, right_m = record.estimate.pose, record.estimate.radii.right_m
        moved = [
            RivalPlace(reduce(compose, record.frame.motions, place.pose), place.nats) for place in self.places
        ]
        same = next((place for place in moved if place.is_near(pose, right_m)), None)
        others = [place for place in moved if not place.is_near(pose, right_m)]
        nats = same.nats if same is not None else moved[0].nats if moved else 0.0
        if same is None and moved:  # it jumped: before this reading no place was likelier than another
            others += [RivalPlace(there, nats) for there in _elsewhere(part, pose)]
        self.places = _read(part, RivalPlace(pose, nats), others, right_m)
        return self.share

    @property
    def share(self) -> float:
        """The probability of the estimate among the places."""
        return 1 / sum(math.exp(place.nats) for place in self.places) if self.places else 1.0


def _elsewhere(part: Sensed, pose: F64) -> list[F64]:
    """Return where the robot may be instead: turned, and where a sensor proposed if it was asked."""
    proposal = part.__dict__.get("proposal")  # to ask for it would cost much
    turned = [compose(pose, np.array([along_m, 0.0, math.pi])) for along_m in ALONG_M]
    return turned if proposal is None else [*turned, *proposal.poses]


def _read(
    part: Sensed, own: RivalPlace, others: Sequence[RivalPlace], right_m: float
) -> tuple[RivalPlace, ...]:
    """Return places with what a reading says of them, their nats beside the own; none far behind."""
    if not others:
        return (RivalPlace(own.pose),)
    least = own.nats + SCANS_WORTH * part.settled(own.pose)[1]
    read = [(part.settled(place.pose), place.nats - least) for place in others]
    rivals = [RivalPlace(pose, min(nats + SCANS_WORTH * now, MOST_NATS)) for (pose, now), nats in read]
    places = [RivalPlace(own.pose)]
    for place in sorted(rivals, key=lambda place: -place.nats):
        if place.nats > -MOST_NATS and not any(other.is_near(place.pose, right_m) for other in places):
            places.append(place)
    return tuple(places[: 1 + MOST_PLACES])
