"""A bag of any kind as a recording, with the camera that its calibration and static transforms describe."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from maurice_mcl.values import F64, Camera, SessionInfo, compose, inverse, motion_between

from ..errors import InputError, ReadingNotes
from ..formats.registry import Format, chosen
from ..reading.options import Reading
from ..reading.plane import Plane, Pose, forward_axis, leaning, planar, plane_of
from ..reading.recording import OdometryPose, Record, TruthPose
from .containers import (
    looks_like_mcap,
    looks_like_rosbag1,
    looks_like_rosbag2,
    open_mcap,
    open_ros1,
    open_ros2,
    part_of,
)
from .messages import (
    MESSAGE_ERRORS,
    POSE_WITH_COVARIANCE,
    TEXT,
    TRANSFORMS,
    FrameTree,
    clock_ns,
    known_type,
    stamp_ns,
    use_recorded,
)
from .readers import (
    MOTIONS,
    READINGS,
    VECTOR,
    MotionReader,
    NoteReader,
    NumberReader,
    PictureReader,
    PoseReader,
    Reader,
    RowReader,
    first_messages,
    has_topic,
    header_of,
    in_order,
    read_bag,
    topics_of,
)
from .scans import ScanReader, base_above, first_of, frame_of, laser_of, links_in
from .source import BagSource, OpenBag, Topic
from .topics import (
    PoseTopic,
    TopicChoice,
    TopicRequest,
    choose,
    is_estimate,
    map_topics,
    not_read,
    nothing_to_read,
    number_topics,
    of_robot,
    readable,
)
from .twist import TwistReader, speed_of_still_poses

PoseKind = type[OdometryPose] | type[TruthPose]
ROLES = ("image", "scan", "odometry", "truth")
ESTIMATE = (
    "is a localizer's own estimate, not the truth: errors say how far from that estimate one is, "
    "not how far from where the robot was"
)
PEEKED = 3  # messages of a topic that are examined before reading


class BagRecording:
    """A bag as a `Recording`, opened again for each reading. InputError if it is damaged."""

    def __init__(
        self,
        path: Path,
        open_bag: OpenBag,
        options: Reading,
        *,
        beside: Collection[str] | None = None,  # topics that a caller reads itself, even if these are all
    ) -> None:
        _refuse_tables(path, options)
        self.path = path
        self.open_bag = open_bag
        self._options = options
        with open_bag(path) as bag:
            image = options.image_topic or options.camera
            wishes = TopicRequest(image, options.odometry_topic, options.truth_topic, options.scan_topic)
            self._rows = has_topic(bag, READINGS, TEXT) and options.readings is None
            edges = {(link.parent, link.child) for link in links_in(bag, bag.topics)}
            self.chosen = choose(path, bag.topics, wishes, edges)
            if not (self.chosen.topics or self._rows) and beside is None:
                raise InputError(path, nothing_to_read(bag.topics))
            first = {topic: peek(bag, topic) for topic in self.chosen.topics}
            self.recorded_times = use_recorded(first)  # why recording times are used; "" where they are not
            camera, looking = camera_of(bag, self.chosen.image)
            self._laser, mounted = np.eye(4), ""
            if self.chosen.scan is not None:
                self._laser, mounted = laser_of(bag, self.chosen.scan, self.chosen.odometry)
            self.clock_ns = clock_ns(first)  # see `read_bag`
            self._events = _events_topic(bag)
            self._motions = has_topic(bag, MOTIONS, VECTOR) and options.odometry_topic is None
            self._numbers = {} if self._rows else number_topics(path, bag.topics, options.readings)
            header = header_of(path, bag)  # of a file that we exported
            seen = self.chosen.scan or self.chosen.image or ""
            topics_of_start = start_topics(bag, seen) if first.get(seen) else []
            maps = [topic for topic in map_topics(bag.topics)[:1] if topic.count > 1 and self.chosen.scan]
            maps_said = "".join(f"its map is the last of {topic.count} at {topic.name}" for topic in maps)
            truth = self.chosen.truth
            self._doubt = ""
            if truth is not None and header is None and is_estimate(bag.topics, truth):
                self._doubt = f"{truth} {ESTIMATE}"
            own = {*self.chosen.topics, *self._numbers.values(), self._events, *(beside or ())}
            own |= {topic.name for topic in topics_of_start}
            self.not_read = not_read(bag.topics, own | _supporting(bag.topics, self.chosen))
        first_ns = first[seen][0][1] if topics_of_start else 0
        start, begins = start_in(path, open_bag, topics_of_start, self.chosen.odometry, first_ns)
        self._twist, moved = False, self.chosen.odometry
        if moved is not None and moved.frames is None and not (self._motions or header):
            speed = speed_of_still_poses(open_bag, path, moved.topic)
            self._twist = speed > 0
            adds = f"the poses of {moved} never move, and its speeds do (up to {speed:.2g} m/s or rad/s)"
            begins = "; ".join(filter(None, [begins, f"{adds}: they are added up" if speed else ""]))
        remarks = (part_of(path), self.chosen.guess, looking, mounted, maps_said, begins)
        self._guessed = "; ".join(text for text in remarks if text)
        notes = tuple(text for text in (self._guessed, self._doubt) if text)
        name = f"{path.stem} (truth: the estimate of {truth})" if self._doubt else path.stem
        cameras = (camera,) if camera else ()
        self.info = header or SessionInfo(name=name, cameras=cameras, notes=notes, start=start)
        self._ours = header is not None  # then nothing is guessed, and a time of 0 is valid
        self._planes: dict[PoseTopic, Plane] = {}

    @property
    def pictureless(self) -> bool:
        """Whether no topic of pictures is read."""
        return self.chosen.image is None

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield records of the chosen topics in time order. Late and invalid messages go to `notes`."""
        why = self.recorded_times
        clock = f"{why}: the times of recording are used for all topics" if why else ""
        planes = [
            f"{route}: {self.plane(route).remark}" if self.plane(route).remark else ""
            for route in dict.fromkeys((self.chosen.odometry, self.chosen.truth))
            if route is not None
        ]
        for text in () if self._ours else (self._guessed, self._doubt, self.not_read, clock, *planes):
            if text:
                notes.warning(text)
        passes = [self.readers(roles) for roles in self._passes()]
        read = partial(read_bag, self.path, self.open_bag, notes=notes, clock_ns=self.clock_ns)
        streams = [in_order(read(readers), notes) for readers in passes]
        # all records have a time; the types of heapq lose what they are
        yield from cast(Iterator[Record], heapq.merge(*streams, key=lambda record: record.t_s))
        for reader in (reader for readers in passes for reader in readers if isinstance(reader, PoseReader)):
            if text := str(reader.out_of_plane):
                notes.left_plane(
                    str(reader.route), reader.out_of_plane.tilt_rad, reader.out_of_plane.height_m, text
                )

    def _passes(self) -> list[tuple[str, ...]]:
        """Return the roles that are read together: one at a time where offsets would break the order."""
        if self._options.odometry_offset_s or self._options.truth_offset_s:
            return [("image", "scan"), ("odometry",), ("truth",)]
        return [ROLES]

    def readers(self, roles: Collection[str] = ROLES) -> list[Reader]:
        """Return the readers of these roles."""
        chosen, options = self.chosen, self._options
        readers: list[Reader] = []
        if "image" in roles and chosen.image:
            readers.append(PictureReader(chosen.image))
        if "scan" in roles and chosen.scan:
            readers.append(ScanReader(chosen.scan, self._laser))
        if "odometry" in roles and self._motions:
            readers.append(MotionReader(MOTIONS, options.odometry_offset_s))
        elif "odometry" in roles and chosen.odometry and self._twist:
            readers.append(TwistReader(chosen.odometry.topic, options.odometry_offset_s))
        elif "odometry" in roles and chosen.odometry:
            readers.append(self._poses(chosen.odometry, OdometryPose, options.odometry_offset_s))
        if "truth" in roles and chosen.truth:
            readers.append(self._poses(chosen.truth, TruthPose, options.truth_offset_s))
        if "image" in roles:
            readers += [NumberReader(topic, name) for name, topic in self._numbers.items()]
            readers += [RowReader(READINGS)] if self._rows else []
        if "odometry" in roles and self._events:
            readers.append(NoteReader(self._events))
        return readers

    def plane(self, route: PoseTopic) -> Plane:
        """Return the plane that a source of poses moves in."""
        if route not in self._planes:
            self._planes[route] = plane_of(self._in_space(route), self._options.plane)
        return self._planes[route]

    def _poses(self, route: PoseTopic, kind: PoseKind, offset_s: float) -> PoseReader:
        return PoseReader(route, kind, offset_s, self.plane(route))

    def _in_space(self, route: PoseTopic) -> Iterator[Pose]:
        reader = PoseReader(route, OdometryPose, 0.0)
        with suppress(InputError), self.open_bag(self.path) as bag:  # damage is reported when it is read
            for message in bag.messages(topics_of(bag, [reader])):
                with suppress(InputError, *MESSAGE_ERRORS):
                    for matrix in reader.matrices(message):
                        yield matrix[:3, 3], matrix[:3, :3]


def _refuse_tables(path: Path, options: Reading) -> None:
    for name in ("time_unit", "table", "columns"):
        if getattr(options, name):
            text = f"found --reading {name}=..., which is for tables, and this is a bag; leave it out"
            raise InputError(path, text)


def _supporting(topics: Sequence[Topic], chosen: TopicChoice) -> set[str | None]:
    """Return the topics that what is chosen is read with: a camera's calibration, and coordinate frames."""
    folder = _folder(chosen.image) if chosen.image else None
    framed = any(route is not None and route.frames for route in (chosen.odometry, chosen.truth))
    calibrations = {
        t.name for t in topics if known_type(t.type) in CALIBRATIONS and _folder(t.name) == folder
    }
    transforms = {t.name for t in topics if known_type(t.type) in TRANSFORMS}
    static = {name for name in transforms if "static" in name and (chosen.image or chosen.scan)}
    maps = {topic.name for topic in map_topics(topics) if chosen.scan}
    return {*calibrations, *maps, *(transforms if framed else static)}


def _folder(topic: str) -> str:
    return topic.removesuffix("/compressed").rpartition("/")[0]


def _events_topic(bag: BagSource) -> str | None:
    names = [t.name for t in readable(bag.topics, {TEXT})]
    return next((name for name in names if name.rpartition("/")[2] == "events"), None)


def peek(bag: BagSource, topic: str) -> list[tuple[int | None, int]]:
    """Return stamp and recording time of a topic's first messages."""
    stamps = []
    for message, content in first_messages(bag, topic, PEEKED):
        with suppress(*MESSAGE_ERRORS):  # reported when it is read
            stamps.append((stamp_ns(content), message.log_ns))
    return stamps


START_WITHIN_M = 5.0  # driven, up to which a pose that is given is one of the beginning ...
START_WITHIN_S = 30.0  # ... or since the first scan or picture, where there is no odometry


def start_topics(bag: BagSource, seen: str | None) -> list[Topic]:
    """Return the topics by which somebody gives a localizer its pose."""
    poses = readable(of_robot(bag.topics, seen), {POSE_WITH_COVARIANCE})
    return [topic for topic in poses if "initialpose" in topic.name]


def pose_in_words(pose: F64) -> str:
    """Return a pose (3,) in the plane as text."""
    return f"{pose[0]:.2f}, {pose[1]:.2f} m, {math.degrees(pose[2]):.0f} deg"


def start_in(
    path: Path, open_bag: OpenBag, given: Sequence[Topic], odometry: PoseTopic | None, first_ns: int
) -> tuple[F64 | None, str]:
    """Return where a drive began (3,) by what somebody told AMCL, and a remark; None if nobody did in time.

    Of several poses the last counts, as it corrects those before; less what odometry saw until it came.
    """
    readers = [PoseReader(PoseTopic(topic.name), TruthPose, 0.0) for topic in given]
    readers += [PoseReader(odometry, OdometryPose, 0.0)] if odometry else []
    begin, moved, way_m, start, remark = None, np.zeros(3), 0.0, None, ""
    left = sum(topic.count for topic in given)
    for record in read_bag(path, open_bag, readers, ReadingNotes(keep_going=True), None) if given else ():
        if isinstance(record, OdometryPose):
            begin = record.pose if begin is None else begin
            before, moved = moved, motion_between(begin, record.pose)
            way_m += float(np.hypot(*(moved - before)[:2]))
        elif isinstance(record, TruthPose):
            left, after_s = left - 1, record.t_s - first_ns / 1e9
            start_words = f"{given[0].name} is at {pose_in_words(record.pose)}"
            if way_m <= START_WITHIN_M if odometry else after_s <= START_WITHIN_S:
                start, remark = compose(record.pose, inverse(moved)), f"the drive starts where {start_words}"
            remark = (
                remark or f"{start_words}, and came {after_s:.0f} s after the start; --start begins there"
            )
        if not left or (start is not None and way_m > START_WITHIN_M):
            break
    return start, remark


# The camera: size and field of view from its calibration, yaw from static transforms.

CALIBRATIONS = ("sensor_msgs/CameraInfo", "foxglove.CameraCalibration")
STEEP_RAD = math.radians(60)  # a camera that looks further up or down has no meaningful yaw


def camera_of(bag: BagSource, image: str | None) -> tuple[Camera | None, str]:
    """Return the camera of a topic of pictures, and a remark on its yaw; None and "" where unknown."""
    if image is None:
        return None, ""
    camera, frame = _calibrated(bag, image), frame_of(first_of(bag, image))
    tree = FrameTree(links_in(bag, bag.topics, static_only=True))
    base = base_above(tree, frame)
    place = None if base is None else tree.place(base, frame)
    if place is None:
        return camera, ""
    turned = place[:3, :3]
    axis = "z" if "optical" in frame else forward_axis([turned])
    if leaning(turned, axis) > STEEP_RAD:
        return camera, ""
    yaw_rad = float(planar(place[:3, 3], turned, axis)[2])
    remark = f"camera yaw {math.degrees(yaw_rad):.1f} deg by the static transform {base} to {frame}"
    return replace(camera or Camera(image), yaw_rad=yaw_rad), remark


def _calibrated(bag: BagSource, image: str) -> Camera | None:
    for topic in bag.topics:
        if known_type(topic.type) in CALIBRATIONS and _folder(topic.name) == _folder(image):
            for _, calibration in first_messages(bag, topic.name, 1):
                with suppress(*MESSAGE_ERRORS):
                    return _camera(image, calibration)
    return None


def _camera(name: str, calibration: Any) -> Camera:
    matrix = calibration.k if hasattr(calibration, "k") else calibration.K
    width, height, focal = int(calibration.width), int(calibration.height), float(matrix[0])
    view = 2 * math.atan2(width / 2, focal) if focal > 0 and width > 0 else None
    return Camera(name, width or None, height or None, view)


BAGS: dict[str, OpenBag] = {"rosbag1": open_ros1, "rosbag2": open_ros2, "mcap": open_mcap}


def names_read(path: Path, options: Reading) -> tuple[str, ...]:
    """Return topics that are read of a bag, and their frames; none of what is no bag. InputError."""
    name = chosen(path, options).name
    if name not in BAGS:
        return ()
    topics = BagRecording(path, BAGS[name], options).chosen
    with BAGS[name](path) as bag:
        frames = [frame_of(first_of(bag, topic)) for topic in (topics.scan, topics.image) if topic]
    moving = topics.odometry.frames if topics.odometry and topics.odometry.frames else ()
    return (*topics.topics, *frames, *moving)


def _format(name: str, what: str, looks_like: Callable[[Path], bool]) -> Format:
    def opened(path: Path, options: Reading) -> BagRecording:
        return BagRecording(path, BAGS[name], options)

    return Format(
        name,
        what,
        looks_like,
        opened,
        extra="ros",
        module="rosbags",
        shifts=True,
        in_space=True,
        readings=True,
    )


MCAP = "MCAP with ROS 2, ROS 1, JSON or protobuf messages, as ROS 2 and Foxglove write it"
FORMATS = (
    _format("rosbag1", "ROS 1 bag: .bag, chunks plain, bz2 or lz4", looks_like_rosbag1),
    _format("rosbag2", "ROS 2 bag: a folder with metadata.yaml, or one .db3", looks_like_rosbag2),
    _format("mcap", MCAP, looks_like_mcap),
)
