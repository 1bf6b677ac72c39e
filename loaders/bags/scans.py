"""Scans of a planar laser in bag messages, and where the transforms say that the laser sits.

Ranges are read as REP 117 has them: infinity means that nothing was hit within the laser's reach, minus
infinity and NaN say nothing, and neither does 0, which many drivers write.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maurice_mcl.values import F64, LaserScan

from ..reading.recording import Scan, scan_fault
from .messages import MESSAGE_ERRORS, SCANS, TRANSFORMS, FrameTree, Link, MessageError, links_of, matrix_of
from .readers import OneTopic, Timed, first_messages, time_s
from .source import BagSource, Message, Topic
from .topics import PoseTopic, of_robot, readable

BASES = ("base_link", "base_footprint")
TILTED_RAD = math.radians(5)  # a laser that is tilted by less is called level
REACH_M = 30.0  # of a laser whose messages state none, as Foxglove's
END_STEPS = 3  # by which the last beam may be elsewhere than a message says
LONGEST_SWEEP_S = 1.0  # of one scan; times between beams that make it longer are wrong
MOST_STATIC = 1000  # messages of static transforms that are examined ...
MOST_MOVING = 200  # ... and of others, among which some publish what is fixed


def scan_of(message: Any, place: F64) -> LaserScan:
    """Return the scan of a message of `SCANS`, of a laser whose frame is at `place` (4, 4) on the robot.

    Beams of a laser that is mounted upside down run clockwise. MessageError for angles or a reach that no
    laser has.
    """
    if hasattr(message, "start_angle"):  # Foxglove's
        count, first = len(message.ranges), float(message.start_angle)
        step = (float(message.end_angle) - first) / max(count - 1, 1)
        least_m, most_m = 0.0, REACH_M
        place = place @ matrix_of(message.pose) if hasattr(message, "pose") else place
    else:
        first, step = float(message.angle_min), float(message.angle_increment)
        least_m, most_m = float(message.range_min), float(message.range_max)
        most_m = most_m if 0 < most_m < math.inf else REACH_M
    ranges_m = np.array(message.ranges, np.float32)  # a null of rosbridge becomes NaN
    ranges_m[ranges_m <= 0] = np.nan
    side = -1.0 if upside_down(place) else 1.0
    scan = LaserScan(ranges_m, side * first, side * step, least_m, most_m, mount_of(place))
    if fault := scan_fault(scan):
        raise MessageError(fault)
    return scan


def upside_down(place: F64) -> bool:
    """Return whether a laser at `place` (4, 4) on the robot looks at its beams from below."""
    return bool(place[2, 2] < 0)


def mount_of(place: F64) -> F64:
    """Return the pose (3,) in the plane of a laser at `place` (4, 4) on the robot."""
    return np.array([place[0, 3], place[1, 3], math.atan2(place[1, 0], place[0, 0])])


def sweep_s(message: Any) -> float:
    """Return the seconds from a scan's first beam, of which its stamp is, to its last; 0 where unknown."""
    sweep = float(getattr(message, "time_increment", 0.0)) * max(len(message.ranges) - 1, 0)
    return sweep if 0 < sweep <= LONGEST_SWEEP_S else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ScanReader(OneTopic):
    """Converts a topic's messages to scans, at the time of their middle beam."""

    types: ClassVar[Collection[str]] = SCANS
    place: F64  # (4, 4) of the laser's frame on the robot

    def records(self, message: Message, number: int, *, recorded: bool) -> Iterator[Timed]:
        """Yield the scan of one message."""
        if self.accepts(message):
            content = message.decode()
            later_s = 0.0 if recorded else sweep_s(content) / 2
            t_s = time_s(content, message.log_ns, recorded=recorded) + later_s
            yield Scan(t_s, scan_of(content, self.place))


# Where the laser sits.


def laser_of(bag: BagSource, topic: str, odometry: PoseTopic | None) -> tuple[F64, str]:
    """Return the place (4, 4) of a topic's laser on the robot, and a remark on it."""
    first, tree = first_of(bag, topic), FrameTree(links_in(bag, of_robot(bag.topics, topic)))
    place, remark = placed(tree, frame_of(first), _robot_frame(bag, odometry))
    return place, remark + _ends(first)


def _ends(message: Any) -> str:
    """Return a remark on a scan whose beams end elsewhere than its `angle_max` says, if it does."""
    if not (hasattr(message, "angle_max") and len(message.ranges)):
        return ""
    step, count = float(message.angle_increment), len(message.ranges)
    header_end, last_beam = float(message.angle_max), float(message.angle_min) + step * (count - 1)
    if abs(last_beam - header_end) <= END_STEPS * abs(step):
        return ""
    ends = f"its {count} beams end at {math.degrees(last_beam):.0f} deg by angle_increment, which is used"
    return f"; {ends}, and at {math.degrees(header_end):.0f} deg by angle_max"


def placed(tree: FrameTree, frame: str, robot: str = "") -> tuple[F64, str]:
    """Return the place (4, 4) of a frame on the robot, whose own is `robot` or of a usual name; a remark."""
    base = base_above(tree, frame, robot)
    place = None if base is None else tree.place(base, frame)
    if base is None or place is None:
        where = f"no transform from {robot or BASES[0]} to {frame or 'its frame'} is there"
        return np.eye(4), f"laser at the robot's center and facing forward: {where}"
    x_m, y_m, yaw = mount_of(place)
    turned = ", upside down" if upside_down(place) else ""
    tilt = math.acos(min(1.0, abs(float(place[2, 2]))))
    tilted = f"; it is tilted by {math.degrees(tilt):.0f} deg and taken as level" if tilt > TILTED_RAD else ""
    at = f"laser {x_m:.2f} m ahead and {y_m:.2f} m left of {base}, turned {math.degrees(yaw):.0f} deg{turned}"
    return place, f"{at}, by the transforms to {frame}{tilted}"


def base_above(tree: FrameTree, frame: str, robot: str = "") -> str | None:
    """Return the robot's frame, `robot` or one of a usual name, if a frame is known to be on it."""
    above = (frame, *tree.above(frame))
    usual = [name for base in BASES for name in above if name.rpartition("/")[2] == base]
    return next((name for name in (robot, *usual) if name in above), None)


def links_in(bag: BagSource, topics: Sequence[Topic], *, static_only: bool = False) -> Iterator[Link]:
    """Yield the first transforms of some topics; static ones come last, as they are to be trusted."""
    for topic in sorted(readable(topics, TRANSFORMS), key=lambda topic: "static" in topic.name):
        moving = 0 if static_only else MOST_MOVING
        for _, content in first_messages(bag, topic.name, MOST_STATIC if "static" in topic.name else moving):
            with suppress(*MESSAGE_ERRORS):
                yield from links_of(content)


def first_of(bag: BagSource, topic: str) -> Any:
    """Return the first message of a topic; None for one that cannot be decoded."""
    return next((content for _, content in first_messages(bag, topic, 1)), None)


def frame_of(message: Any) -> str:
    """Return the frame that a message is in, without a leading slash; "" where it names none."""
    return str(getattr(getattr(message, "header", message), "frame_id", "")).lstrip("/")


def _robot_frame(bag: BagSource, odometry: PoseTopic | None) -> str:
    if odometry is None or odometry.frames is not None:
        return "" if odometry is None or odometry.frames is None else odometry.frames[1]
    return str(getattr(first_of(bag, odometry.topic), "child_frame_id", "")).lstrip("/")
