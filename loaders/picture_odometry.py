"""Odometry from pictures for recordings that have none: a movement between one picture and the next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.sensor.visual_odometry import (
    MatchedPoints,
    PicturePoints,
    RelativeMotion,
    camera_tilt,
    match_points,
    picture_points,
    relative_motion,
)
from maurice_mcl.session import Camera, SessionInfo

from .errors import InputError, PictureError, ReadingNotes
from .reading import ReadingOptions
from .recording import Motion, OdometryPose, Picture, Record, Recording, checked

FROM_PICTURES = "odometry from pictures"  # in the session's name: every table and picture says it
FEWEST_STEPS = 3  # lengths that the floor has to tell, for their median to be taken
STEP_SHARE = 0.35  # sd of the logarithm of a robot's steps, and of a length by the floor
LEAST_TURN_RAD = 1e-9  # a turn of exactly zero would say that the pictures tell nothing


@dataclass(frozen=True, slots=True)
class _Lens:
    fov_rad: float
    height_m: float | None
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class PictureOdometry:
    """The movements (3,) before every picture but the first, and how they were found."""

    motions: tuple[F64, ...]
    told: int  # how many of them the pictures tell
    step_m: float  # of a movement whose length is unknown
    by_floor: int  # lengths that the floor told
    tilt_rad: float

    @property
    def said(self) -> str:
        """What everybody has to know who sees a result."""
        lengths = f"{self.by_floor} lengths by the floor, the others near {self.step_m:.2g} m"
        tilt = f"camera tilted up by {math.degrees(self.tilt_rad):.0f} degrees, as fits the pictures best"
        found = f"{FROM_PICTURES}: {self.told} of {len(self.motions)} movements have a turn and a direction"
        return f"{found}, the others are unknown; {lengths}; {tilt}"


class WithPictureOdometry:
    """A recording without odometry, with a movement before every picture but the first.

    Where two pictures have too little in common the movement's turn is exactly zero, which the motion model
    "pictures" takes for unknown.
    """

    def __init__(self, recording: Recording, options: ReadingOptions) -> None:
        self._bare, self._options = recording, options
        self._lens = _lens_of(recording, options)

    @property
    def path(self) -> Path:
        """The file or folder."""
        return self._bare.path

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record; name and notes say where the odometry is from."""
        info = self._bare.info
        told = (
            f"{FROM_PICTURES}: turn and direction by matched points, lengths by the floor or a typical step"
        )
        notes, name = (*info.notes, told), f"{info.name} ({FROM_PICTURES})"
        return replace(info, name=name, notes=notes, motion={"model": "pictures"})

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, each picture after its movement."""
        found, number = self.odometry, 0
        notes.warning(found.said)
        for record in self._bare.records(notes):
            if isinstance(record, Picture):
                if number:
                    yield Motion(record.t_s, found.motions[number - 1])
                number += 1
            yield record

    @cached_property
    def odometry(self) -> PictureOdometry:
        """The movements; all pictures are read once for them. InputError where lengths are unknown."""
        pairs = self._pairs()
        tilt_rad = camera_tilt([one for one in pairs if one is not None])
        height_m = self._lens.height_m
        found = [None if one is None else relative_motion(one.tilted(tilt_rad), height_m) for one in pairs]
        found = [one if one is not None and one.tells else None for one in found]
        steps = [one.step_m for one in found if one is not None and one.step_m is not None]
        usual_m = self._usual_m(steps)
        motions = tuple(_motion(one, usual_m, self._lens.yaw_rad) for one in found)
        told = sum(one is not None for one in found)
        return PictureOdometry(motions, told, usual_m, len(steps), tilt_rad)

    def _usual_m(self, steps: Sequence[float]) -> float:
        if self._options.picture_step_m:
            return self._options.picture_step_m
        if len(steps) >= FEWEST_STEPS:
            return float(np.median(steps))
        known = f"found {len(steps)} movements whose length the floor tells"
        if self._lens.height_m is None:
            known = "found no height of the camera, so pictures tell no length"
        advice = "give a typical one with --reading picture_step_m=0.3, or camera_height_m=0.25"
        raise InputError(self.path, f"{known}; {advice}")

    def _pairs(self) -> list[MatchedPoints | None]:
        """Match each picture with the one before; None where either cannot be read."""
        pairs, before = list[MatchedPoints | None](), None
        first = True
        for record in checked(self._bare, ReadingNotes(keep_going=True)):
            if isinstance(record, Picture):
                points = _points(record, self._lens.fov_rad)
                if not first:
                    pairs.append(None if before is None or points is None else match_points(before, points))
                before, first = points, False
        return pairs


def _points(picture: Picture, fov_rad: float) -> PicturePoints | None:
    try:
        return picture_points(picture.read(), fov_rad)
    except PictureError:
        return None


def _motion(found: RelativeMotion | None, usual_m: float, yaw_rad: float) -> F64:
    """Return the movement (3,) in the robot's frame."""
    if found is None:
        return np.array([usual_m, 0.0, 0.0])
    way = usual_m if found.step_m is None else math.sqrt(usual_m * found.step_m)
    ahead = found.direction_rad + yaw_rad
    turn = found.turn_rad if found.turn_rad else LEAST_TURN_RAD
    return np.array([way * math.cos(ahead), way * math.sin(ahead), turn])


def _lens_of(recording: Recording, options: ReadingOptions) -> _Lens:
    cameras = recording.info.cameras
    named = [one for one in cameras if one.name == options.camera]
    camera = (named or list(cameras) or [Camera("camera")])[0]
    fov_rad = options.camera_fov_rad or camera.horizontal_fov_rad
    if not fov_rad:
        found = "found no field of view of the camera, which odometry_from_pictures needs"
        raise InputError(recording.path, f"{found}; give it with --reading camera_fov_deg=60")
    if not 0 < fov_rad < math.pi * 0.95:
        found = f"found a camera's field of view of {math.degrees(fov_rad):g} degrees"
        raise InputError(recording.path, f"{found}, expected 1 to 170; see --reading camera_fov_deg=60")
    return _Lens(fov_rad, options.camera_height_m or camera.height_m, camera.yaw_rad)


def odometry_from_pictures(recording: Recording, options: ReadingOptions) -> WithPictureOdometry:
    """Add odometry to a recording. InputError if it has its own, or no pictures, or an unknown camera."""
    kinds = Counter(type(record) for record in checked(recording, ReadingNotes(keep_going=True)))
    if kinds[OdometryPose] or kinds[Motion]:
        found = "found odometry that was measured, so none is made from pictures"
        raise InputError(recording.path, f"{found}; leave odometry_from_pictures out")
    if not kinds[Picture]:
        raise InputError(recording.path, "found no pictures, and odometry_from_pictures needs them")
    return WithPictureOdometry(recording, options)
