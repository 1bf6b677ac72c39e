"""Dead reckoning: how far off a drive's odometry alone would have been, from the same known start.

The pose is moved by the motion model without its noise: what a filter without sensors estimates, without a
second filter. A sensor that does worse than this should not have been used.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..filter.localizer import Localizer
from ..values import F32, F64, Moment, StepRecord
from .comparison import ErrorDifference, difference_of
from .metrics import FIRST_SCORED, score_step

CAMERA, SENSORS = "camera", "sensors"  # what a run had besides odometry
WORSE_FACTOR = 1.1  # times the error of odometry alone, from which on a run is worse


@dataclass(frozen=True, slots=True)
class OdometryAlone:
    """What a run would have had without its sensors, over the same updates."""

    error_mean_m: float
    error_final_m: float
    against: ErrorDifference  # the run's position error minus this
    sensors: str = CAMERA  # what it would have been without: CAMERA or SENSORS

    @property
    def is_better(self) -> bool:
        """Whether the sensors made it worse: by more than a tenth, with 95 % confidence on this drive."""
        interval = self.against.interval
        sure = interval is not None and interval[0] > 0
        return sure and self.against.mean > (WORSE_FACTOR - 1) * self.error_mean_m


@dataclass(slots=True, eq=False)
class DeadReckoning:
    """Moves one pose by the motion model along a drive, and compares its error with a run's."""

    localizer: Localizer
    start: F64  # (3,) in the map's frame
    _pose: F32 = field(init=False)  # (1, 3) relative to the library's origin
    _updates: int = 0
    _errors_m: list[float] = field(default_factory=list)
    _against_m: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pose = (self.start - [*self.localizer.library.origin, 0.0]).astype(np.float32)[None]

    @classmethod
    def of(cls, localizer: Localizer | None, start: F64 | None) -> DeadReckoning | None:
        """Return it for a run whose start and motion model are known; else None."""
        if localizer is None or localizer.motion is None or start is None:
            return None
        return cls(localizer, start)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update of the run."""
        motion, origin = self.localizer.motion, self.localizer.library.origin
        assert motion is not None, "see `of`"
        for movement in moment.frame.motions:
            self._pose = motion.move(self._pose, origin, movement, np.zeros((1, 3), np.float32))
        self._updates += 1
        of_run = score_step(record.estimate, moment.truth).position_error_m
        if moment.truth is None or of_run is None or self._updates < FIRST_SCORED:
            return
        self._errors_m.append(float(np.hypot(*(self._pose[0, :2] + origin - moment.truth[:2]))))
        self._against_m.append(of_run - self._errors_m[-1])

    def result(self) -> OdometryAlone | None:
        """Return the errors so far; None where no truth was known."""
        against = difference_of(np.array(self._against_m))
        if against is None:
            return None
        sensor = self.localizer.sensor
        sees = bool(sensor.weights) or any(
            getattr(pose_sensor, "pictures", ()) for pose_sensor in sensor.sensors.values()
        )
        mean_m, final_m = float(np.mean(self._errors_m)), self._errors_m[-1]
        return OdometryAlone(mean_m, final_m, against, CAMERA if sees else SENSORS)
