"""The truth along one drive, and how well its pictures fit there: what a map of failures is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import Comparison, Moment, OccupancyMap

from .stretches import mapped_share


@dataclass(slots=True)
class TruthRanks:
    """The rank of the truth's reference in every picture, for each of some sensor models."""

    sensors: Mapping[int, SensorModel]  # by their id
    ranks: dict[int, list[float]] = field(default_factory=dict)

    def add(self, moment: Moment, pictures: Sequence[Compared]) -> None:
        """Process the next moment, compared with each sensor model's library."""
        for (key, sensor), picture in zip(self.sensors.items(), pictures, strict=True):
            self.ranks.setdefault(key, []).append(rank_of_truth(sensor, picture.comparison, moment))

    def columns(self, sensor: SensorModel, moments: Sequence[Moment]) -> dict[str, Any]:
        """Return what a row tells of the truth, update by update."""
        truths = [moment.truth for moment in moments]
        places = [(np.nan, np.nan) if truth is None else truth[:2].tolist() for truth in truths]
        x, y = zip(*places, strict=True) if places else ((), ())
        return {"true_x_m": list(x), "true_y_m": list(y), "truth_rank": self.ranks.get(id(sensor), [])}


def mapped_shares(occupancy: OccupancyMap | None, moments: Sequence[Moment]) -> list[float] | None:
    """Return of every update's beams the share that ends where the map is known; None without a map."""
    if occupancy is None:
        return None
    return [mapped_share(occupancy, moment.frame.scan, moment.truth) for moment in moments]


def rank_of_truth(sensor: SensorModel, comparison: Comparison, moment: Moment) -> float:
    """Return the rank, from 1, of the reference nearest the truth; NaN where it is not known."""
    likely = comparison.log_likelihood
    if moment.truth is None or not len(likely):
        return np.nan
    origin = sensor.library.origin
    pose = (moment.truth - np.append(origin, 0.0)).astype(np.float32)
    (entry,) = sensor.references.entries(pose[None], origin)
    return np.nan if entry < 0 else float((likely > likely[entry]).sum() + 1)
