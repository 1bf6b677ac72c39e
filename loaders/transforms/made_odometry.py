"""Odometry made from the truth, for recordings without any: for trying things out, never a measurement."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose, motion_between, wrap
from maurice_mcl.randomness import Domain, stream
from maurice_mcl.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..recording import Motion, Note, OdometryPose, Record, Recording, RecordingWrapper, TruthPose, checked

# Odometry for drives that come without: made from the steps between known poses, plus stated noise.


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """How the odometry is spoiled, so that it is not the truth itself; a plain wheeled robot's numbers."""

    way_share: float = 0.05  # sd of a straight's length, as a share of it
    turn_share: float = 0.05  # sd of a turn, as a share of it
    drift_rad_per_m: float = 0.05  # sd of the heading gained on a straight, radians a meter

    def describe(self, seed: int) -> str:
        """Return the noise in a sentence, for the header's notes."""
        return (
            f"odometry is synthetic: made from the steps between labelled poses, with noise of "
            f"{self.way_share:g} of a way, {self.turn_share:g} of a turn and "
            f"{self.drift_rad_per_m:g} rad a metre of way (standard deviations), seed {seed}"
        )


def synthetic_motions(before: F64, after: F64, noise: OdometryNoise, seed: int, step: int) -> list[F64]:
    """Return the movements (3,) that a robot would have measured from one pose (3,) to the next.

    First the straight, in the frame of `before`, then the turn on the spot; what is zero is left out.
    The noise is drawn at the address of this step.
    """
    way_noise, drift_noise, turn_noise = stream(Domain.IMPORT, seed, step).standard_normal(3)
    dx, dy = after[:2] - before[:2]
    cos, sin = np.cos(before[2]), np.sin(before[2])
    way, turn = float(np.hypot(dx, dy)), float(wrap(after[2:] - before[2:])[0])
    motions = []
    if way > 0:
        measured = np.array([dx * cos + dy * sin, dy * cos - dx * sin]) * (1 + noise.way_share * way_noise)
        motions.append(np.array([*measured, noise.drift_rad_per_m * way * drift_noise]))
    if turn != 0:
        motions.append(np.array([0.0, 0.0, turn * (1 + noise.turn_share * turn_noise)]))
    return motions


# Odometry made from the truth, for recordings that have none: for trying things out, never a measurement.

NAMED = "odometry made from the truth"  # in the session's name: every table and picture says it
MOVEMENT_M, MOVEMENT_RAD = 0.5, math.pi / 4  # errors stay the same over so much, as over a movement


@dataclass(frozen=True, slots=True, eq=False)
class MadeOdometry(RecordingWrapper):
    """A recording with an odometry pose beside every true pose, in a frame of the odometry's own."""

    seed: int
    noise: OdometryNoise = field(default_factory=OdometryNoise)

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record; name and notes say where the odometry is from."""
        info = self.measured.info
        return replace(info, name=f"{info.name} ({NAMED})", notes=(*info.notes, self.said))

    @property
    def said(self) -> str:
        """What everybody has to know who sees a result."""
        noise = self.noise
        return (
            f"ODOMETRY IS NOT MEASURED but made from the truth, with noise of {noise.way_share:g} of a way, "
            f"{noise.turn_share:g} of a turn and {noise.drift_rad_per_m:g} rad a metre of way "
            f"(standard deviations, drawn once a movement of {MOVEMENT_M:g} m or "
            f"{math.degrees(MOVEMENT_RAD):g} degrees), seed {self.seed}"
        )

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records; odometry comes before the true pose of the same time."""
        notes.warning(self.said)
        wheels = _Wheels(self.noise, self.seed)
        for record in checked(self.measured, notes):
            if isinstance(record, TruthPose):
                yield OdometryPose(record.t_s, wheels.go_to(record.pose))
            elif isinstance(record, Note) and record.text.startswith("kidnapped"):
                wheels.carried()
            yield record


def odometry_from_truth(recording: Recording, seed: int) -> MadeOdometry:
    """Add odometry to a recording. Raises InputError if it has odometry of its own, or no truth."""
    notes, truths = ReadingNotes(keep_going=True), 0
    for record in checked(recording, notes):
        if isinstance(record, OdometryPose | Motion):
            found = "found odometry that was measured, so none is made from the truth"
            raise InputError(recording.path, f"{found}; leave odometry_from_truth out")
        truths += isinstance(record, TruthPose)
    if not truths:
        said = [text for text in notes.warnings if "truth" in text]
        why = f" ({said[0]})" if said else ""
        raise InputError(recording.path, f"found no truth{why}, and odometry_from_truth needs true poses")
    return MadeOdometry(recording, seed)


class _Wheels:
    """A robot that follows the truth and measures its movements with errors."""

    def __init__(self, noise: OdometryNoise, seed: int) -> None:
        self._noise, self._seed = noise, seed
        self._at: F64 | None = None  # the true pose
        self._pose: F64 = np.zeros(3)  # by the wheels
        self._movement, self._gone_m, self._turned_rad = 0, 0.0, 0.0
        self._errors = self._drawn()

    def go_to(self, truth: F64) -> F64:
        """Return the odometry's pose (3,) when the robot has come to a true pose (3,)."""
        if self._at is not None:
            self._pose = compose(self._pose, self._measured(motion_between(self._at, truth)))
        self._at = truth
        return self._pose

    def carried(self) -> None:
        """Forget where the robot was: wheels do not see how it comes to the next true pose."""
        self._at = None

    def _measured(self, motion: F64) -> F64:
        forward, left, turn = (float(v) for v in motion)
        way = math.hypot(forward, left)
        length, drift, share = (float(v) for v in self._errors)
        along = 1 + self._noise.way_share * length
        turned = turn * (1 + self._noise.turn_share * share) + self._noise.drift_rad_per_m * way * drift
        self._gone_m, self._turned_rad = self._gone_m + way, self._turned_rad + abs(turn)
        if self._gone_m >= MOVEMENT_M or self._turned_rad >= MOVEMENT_RAD:
            self._movement, self._gone_m, self._turned_rad = self._movement + 1, 0.0, 0.0
            self._errors = self._drawn()
        return np.array([forward * along, left * along, turned])

    def _drawn(self) -> F64:
        """Draw what is wrong with this movement: length, drift, turn, in standard deviations."""
        return stream(Domain.IMPORT, self._seed, self._movement).standard_normal(3)
