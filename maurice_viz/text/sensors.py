"""What pose sensors read, in sentences and in the units that people read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from maurice_mcl.sensor.landmarks.sensor import SHAPE_TOLERANCE, Landmarks
from maurice_mcl.values import F64, Arena, Frame, MovedThing, PoseSensor, Shown, StepRecord

from ..style import Scale

OUTLINE_M = 0.15  # as far from an obstacle a point is still on it
LEAST_SHARE = 0.5  # of the points of a thing, that have to be on an obstacle, so that it has its name


def say_shown(shown: Shown, arena: Arena, scale: Scale) -> str:
    """Return what a sensor says, and a sentence for each thing that moved."""
    return " ".join([shown.text(scale.say), *(say_moved(thing, arena, scale) for thing in shown.moved)])


def say_moved(moved: MovedThing, arena: Arena, scale: Scale) -> str:
    """Describe a thing: "9 others on the wardrobe agree with each other, 11.0 in from where ..."."""
    name = thing_at(moved.places, arena)
    where = f" on the {name}" if name else ""
    far = scale.say(float(np.hypot(*moved.shift_m)))
    return f"{len(moved.places)} others{where} agree with each other, {far} from where the library has them."


def thing_at(places: F64, arena: Arena) -> str | None:
    """Return the name of the obstacle that at least half of some places (K, 2) are on."""
    most, name = LEAST_SHARE, None
    for obstacle in arena.obstacles:
        share = float(np.mean(obstacle.depth_m(places) > -OUTLINE_M))
        if share >= most:
            most, name = share, obstacle.name
    return name


def say_sensors(record: StepRecord, truth: F64 | None, arena: Arena, scale: Scale) -> list[str]:
    """Return what the pose sensors of an update say, a paragraph each: "Landmarks: 14 of 60 ..."."""
    poses: Mapping[str, F64] = {"estimate": record.estimate.pose}
    poses = poses if truth is None else {**poses, "truth": truth}
    sensed = record.sighting.comparison.sensed
    return [f"{read.name.capitalize()}: {say_shown(read.shown(poses), arena, scale)}" for read in sensed]


def say_other_shape(frame: Frame, sensors: Iterable[PoseSensor]) -> str | None:
    """Return what to tell where landmarks cannot read a picture, as it is of another camera; else None."""
    height, width = frame.image.shape[:2]
    for sensor in sensors:
        if isinstance(sensor, Landmarks):
            camera = sensor.map.fit.camera
            difference = abs(width * camera.height_px - height * camera.width_px)
            if difference > SHAPE_TOLERANCE * camera.width_px * height:
                text = f"found pictures of {width} x {height}, and the landmarks are of pictures of "
                text += f"{camera.width_px} x {camera.height_px}: another shape, so landmarks say nothing"
                return f"{text}; build the library with this camera, or leave landmarks out"
    return None
