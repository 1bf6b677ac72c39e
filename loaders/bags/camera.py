"""What a bag says of its camera: size and view by its calibration, where it looks by its transforms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

from maurice_mcl.session import Camera

from ..errors import InputError
from ..formats._poses import forward_axis, leaning, planar
from .messages import TRANSFORMS, FrameTree, known_type, links_of
from .readers import MESSAGE_ERRORS
from .source import BagSource
from .topics import readable

CALIBRATIONS = ("sensor_msgs/CameraInfo", "foxglove.CameraCalibration")
BASES = ("base_link", "base_footprint")
MOST_STATIC = 1000  # messages of static transforms that are looked at
STEEP_RAD = math.radians(60)  # a camera that looks further up or down has no yaw worth the name


def camera_of(bag: BagSource, image: str | None) -> tuple[Camera | None, str]:
    """Describe the camera of a topic of pictures, and say where it looks, as far as the bag knows.

    None and "" where it knows nothing.
    """
    if image is None:
        return None, ""
    camera, frame = _calibrated(bag, image), _frame_of(bag, image)
    for base in BASES if frame else ():
        yaw_rad = _yaw(bag, base, frame)
        if yaw_rad is not None:
            said = f"camera yaw {math.degrees(yaw_rad):.1f} deg by the static transform {base} to {frame}"
            return replace(camera or Camera(image), yaw_rad=yaw_rad), said
    return camera, ""


def _calibrated(bag: BagSource, image: str) -> Camera | None:
    """Read size and angle of view from the calibration beside the pictures."""
    place = image.removesuffix("/compressed").rpartition("/")[0]
    for topic in bag.topics:
        if known_type(topic.type) in CALIBRATIONS and topic.name.rpartition("/")[0] == place:
            for message in _decoded(bag, topic.name, 1):
                try:
                    return _camera(image, message)
                except MESSAGE_ERRORS:
                    break
    return None


def _camera(name: str, calibration: Any) -> Camera:
    matrix = calibration.k if hasattr(calibration, "k") else calibration.K
    width, height, focal = int(calibration.width), int(calibration.height), float(matrix[0])
    view = 2 * math.atan2(width / 2, focal) if focal > 0 and width > 0 else None
    return Camera(name, width or None, height or None, view)


def _frame_of(bag: BagSource, image: str) -> str:
    """Give the frame that the first picture names."""
    for message in _decoded(bag, image, 1):
        named = getattr(message, "header", message)
        return str(getattr(named, "frame_id", "")).lstrip("/")
    return ""


def _yaw(bag: BagSource, base: str, frame: str) -> float | None:
    """Give where a frame looks in the base that static transforms join it to; optical frames look along z."""
    tree = FrameTree()
    for topic in readable(bag.topics, TRANSFORMS):
        if "static" in topic.name:
            for message in _decoded(bag, topic.name, min(MOST_STATIC, topic.count)):
                try:
                    for link in links_of(message):
                        tree.add(link)
                except MESSAGE_ERRORS:
                    continue
    place = tree.place(base, frame)
    if place is None:
        return None
    turned = place[:3, :3]
    axis = "z" if "optical" in frame else forward_axis([turned])
    return None if leaning(turned, axis) > STEEP_RAD else float(planar(place[:3, 3], turned, axis)[2])


def _decoded(bag: BagSource, topic: str, most: int) -> Iterator[Any]:
    """Give the first messages of a topic; those that cannot be decoded are told of when they are read."""
    for message in islice(bag.messages({topic}), most):
        try:
            yield message.decode()
        except (InputError, *MESSAGE_ERRORS):
            continue
