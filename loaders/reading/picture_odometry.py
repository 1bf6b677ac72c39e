"""Odometry from pictures for recordings that have none: a movement between one picture and the next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.sensor.visual_odometry import (
    MatchedPoints,
    PicturePoints,
    RelativeMotion,
    camera_tilt,
    match_points,
    picture_points,
    relative_motion,
    tells_tilt,
)
from maurice_mcl.values import F64, Camera, SessionInfo

from ..errors import InputError, PictureError, ReadingNotes
from .options import Reading
from .recording import Motion, OdometryPose, Picture, Record, Recording, checked

FROM_PICTURES = "odometry from pictures"  # in the session's name: every table and picture says it
FEWEST_STEPS = 3  # lengths that the floor has to tell, for their median to be taken
LEAST_TURN_RAD = 1e-9  # a turn of exactly zero would say that the pictures tell nothing
KEPT_TURN_RAD = math.radians(
    8
)  # turned by more than this, a standing robot is seen from the picture it has now
LEAST_UNSEEN_TURN_RAD = 0.05
FEWEST_SHARED = 20  # matches; with fewer, a picture is compared with a later one
TILT_MOVES = 40  # pairs of pictures between which the robot moved, of which the best show the camera's tilt


@dataclass(frozen=True, slots=True)
class _Lens:
    fov_rad: float
    height_m: float | None
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class PictureOdometry:
    """The movements (3,) before every picture but the first, and how they were found."""

    motions: tuple[F64, ...]
    measured: int  # how many of them the pictures tell
    standing: int  # in how many of those the robot stood or turned in place
    step_m: float  # of a movement whose length is unknown
    by_floor: int  # lengths that the floor told
    tilt_rad: float
    unseen_turn_rad: float | None  # sd of the turns that no picture tells; None: they may be any

    @property
    def statement(self) -> str:
        """What everybody has to know who sees a result."""
        lengths = f"{self.by_floor} lengths by the floor, the others near {self.step_m:.2g} m"
        tilt_deg = round(math.degrees(self.tilt_rad))
        tilt = f"camera tilted {'down' if tilt_deg < 0 else 'up'} by {abs(tilt_deg)} degrees, as fits best"
        found = f"{FROM_PICTURES}: {self.measured} of {len(self.motions)} movements found"
        if self.standing:
            found += f" (in {self.standing} the robot stood, turned in place or moved too little to be seen)"
        if self.measured < len(self.motions):
            found += ", the others are unknown"
        return f"{found}; {lengths}; {tilt}"


class WithPictureOdometry:
    """A recording without odometry, with a movement before every picture but the first.

    Where two pictures have too little in common the movement's turn is exactly zero, which the motion model
    "pictures" takes for unknown. Where the robot stood or turned in place, its length is zero.
    """

    def __init__(self, recording: Recording, options: Reading) -> None:
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
        standing = (
            f"{FROM_PICTURES}: turn and direction by matched points, lengths by the floor or a typical step"
        )
        notes, name = (*info.notes, standing), f"{info.name} ({FROM_PICTURES})"
        turn = self.odometry.unseen_turn_rad
        motion = {"model": "pictures"} | ({"unseen_turn_sd_rad": turn} if turn else {})
        return replace(info, name=name, notes=notes, motion=motion)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, each picture after its movement."""
        found, number = self.odometry, 0
        notes.warning(found.statement)
        for record in self._bare.records(notes):
            if isinstance(record, Picture):
                if number:
                    yield Motion(record.t_s, found.motions[number - 1])
                number += 1
            yield record

    @cached_property
    def odometry(self) -> PictureOdometry:
        """The movements; all pictures are read for them. InputError where lengths are unknown."""
        tilt_rad = camera_tilt(list(islice(self._moves(), TILT_MOVES)))
        motions_seen = self._found(tilt_rad)
        steps = [seen.step_m for seen in motions_seen if seen is not None and seen.step_m]
        moved = any(seen is None or seen.step_m != 0 for seen in motions_seen)
        usual_m = self._usual_m(steps, _pictures_a_movement(motions_seen)) if moved else 0.0
        known = [seen for seen in motions_seen if seen is not None]
        ways = [_way_m(seen, usual_m) for seen in known]
        # a robot that often stands may also stand where no picture tells
        unseen_m = float(np.mean([*ways, usual_m]))
        motions = tuple(_motion(seen, usual_m, unseen_m, self._lens.yaw_rad) for seen in motions_seen)
        standing, turn_rad = ways.count(0.0), self._unseen_turn_rad([abs(seen.turn_rad) for seen in known])
        return PictureOdometry(motions, len(known), standing, usual_m, len(steps), tilt_rad, turn_rad)

    def _unseen_turn_rad(self, turns: Sequence[float]) -> float | None:
        """Return the sd of turns that pictures do not tell, where those they tell are far from the limit."""
        most = float(np.quantile(turns, 0.9)) if turns else math.inf
        return max(2 * most, LEAST_UNSEEN_TURN_RAD) if most < self._lens.fov_rad / 3 else None

    def _found(self, tilt_rad: float) -> list[RelativeMotion | None]:
        """Return the movement before every picture but the first; None where pictures tell nothing.

        A robot that stands is seen from the same earlier picture until it has moved: of many small movements
        none is large enough to be seen, and all of them together are.
        """
        found, turned = list[RelativeMotion | None](), 0.0
        since: PicturePoints | None = None
        for number, points in enumerate(self._points()):
            motion = None
            if since is not None and points is not None:
                matched = match_points(since, points).tilted(tilt_rad)
                motion = relative_motion(matched, self._lens.height_m)
            if number:
                found.append(None if motion is None else _after_turn(motion, turned))
            stands = motion is not None and motion.step_m == 0 and abs(motion.turn_rad) < KEPT_TURN_RAD
            if motion is not None and stands:
                turned = motion.turn_rad
            else:
                since, turned = points, 0.0
        return found

    def _moves(self) -> Iterator[MatchedPoints]:
        """Match pictures with those before between which the robot moved."""
        since: PicturePoints | None = None
        for points in self._points():
            if since is None or points is None:
                since = points
                continue
            matched = match_points(since, points)
            moved = tells_tilt(matched)
            if moved:
                yield matched
            if moved or len(matched.before) < FEWEST_SHARED:
                since = points

    def _usual_m(self, steps: Sequence[float], pictures: float) -> float:
        if self._options.picture_step_m:
            return self._options.picture_step_m * pictures
        if len(steps) >= FEWEST_STEPS:
            return float(np.median(steps))
        known = f"found {len(steps)} movements whose length the floor tells"
        if self._lens.height_m is None:
            known = "found no height of the camera, so pictures tell no length"
        advice = "give a typical one with --reading picture_step_m=0.3, or camera_height_m=0.25"
        raise InputError(self.path, f"{known}; {advice}")

    def _points(self) -> Iterator[PicturePoints | None]:
        """Read all pictures; None where one cannot be read."""
        for record in checked(self._bare, ReadingNotes(keep_going=True)):
            if isinstance(record, Picture):
                try:
                    yield picture_points(record.read(), self._lens.fov_rad)
                except PictureError:
                    yield None


def _pictures_a_movement(motions: Sequence[RelativeMotion | None]) -> float:
    """Return after how many pictures a robot is seen to have moved, in the median; one if it never is."""
    counts, since = list[int](), 1
    for record in motions:
        if record is not None and record.step_m == 0:
            since += 1
            continue
        counts += [since] if record is not None else []
        since = 1
    return float(np.median(counts)) if counts else 1.0


def _after_turn(relative: RelativeMotion, turned_rad: float) -> RelativeMotion:
    """Return a movement as seen after a turn that was told before."""
    turn, direction = relative.turn_rad - turned_rad, relative.direction_rad - turned_rad
    return replace(relative, turn_rad=turn, direction_rad=direction)


def _way_m(relative: RelativeMotion, usual_m: float) -> float:
    if not relative.step_m:
        return usual_m if relative.step_m is None else 0.0
    return math.sqrt(usual_m * relative.step_m)


def _motion(relative: RelativeMotion | None, usual_m: float, unseen_m: float, yaw_rad: float) -> F64:
    """Return the movement (3,) in the robot's frame."""
    if relative is None:
        return np.array([unseen_m, 0.0, 0.0])
    way, ahead = _way_m(relative, usual_m), relative.direction_rad + yaw_rad
    return np.array([way * math.cos(ahead), way * math.sin(ahead), relative.turn_rad or LEAST_TURN_RAD])


def _lens_of(recording: Recording, options: Reading) -> _Lens:
    cameras = recording.info.cameras
    named = [camera for camera in cameras if camera.name == options.camera]
    camera = (named or list(cameras) or [Camera("camera")])[0]
    fov_rad = options.camera_fov_rad or camera.horizontal_fov_rad
    if not fov_rad:
        fault = "found no field of view of the camera, which odometry_from_pictures needs"
        raise InputError(recording.path, f"{fault}; give it with --reading camera_fov_deg=60")
    if not 0 < fov_rad < math.pi * 0.95:
        fault = f"found a camera's field of view of {math.degrees(fov_rad):g} degrees"
        raise InputError(recording.path, f"{fault}, expected 1 to 170; see --reading camera_fov_deg=60")
    return _Lens(fov_rad, options.camera_height_m or camera.height_m, camera.yaw_rad)


def odometry_from_pictures(recording: Recording, options: Reading) -> WithPictureOdometry:
    """Add odometry to a recording. InputError if it has its own, or no pictures, or an unknown camera."""
    kinds = Counter(type(record) for record in checked(recording, ReadingNotes(keep_going=True)))
    if kinds[OdometryPose] or kinds[Motion]:
        fault = "found odometry that was measured, so none is made from pictures"
        raise InputError(recording.path, f"{fault}; leave odometry_from_pictures out")
    if not kinds[Picture]:
        raise InputError(recording.path, "found no pictures, and odometry_from_pictures needs them")
    return WithPictureOdometry(recording, options)
