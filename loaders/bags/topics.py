"""The topics of a bag that hold pictures, odometry and truth: as requested, or guessed and reported."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError
from .messages import (
    CLOUDS,
    GRID,
    NUMBERS,
    ODOMETRIES,
    PICTURES,
    POSE_WITH_COVARIANCE,
    POSES,
    SCANS,
    TRANSFORMS,
    VIDEOS,
    known_type,
)
from .source import Topic
from .video import INSTALL, can_decode

TRUE = re.compile(r"ground_?truth|(^|[/_])(gt|truth|vicon|mocap|optitrack|qualisys|leica)([/_]|\d|$)", re.I)
GUESSED = re.compile(
    r"amcl|beluga|localiz|estimate|particle|initial_?pose|(^|[/_])(goal|plan|target)([/_]|$)", re.I
)
ESTIMATED = re.compile(r"amcl|beluga|localiz|estimate|particle|slam|ptam|rtabmap|cartographer|vins", re.I)
FIXED = re.compile(r"(^|/)(odom|odom_combined|odometry)$")
BASE = ("base_footprint", "base_link")
FIRST = re.compile(r"color|rgb|front|left", re.I)  # of several cameras
LASER_LAST = re.compile(
    r"rear|back|left|right|raw|unfiltered|debug|virtual|camera|depth|kinect|sonar|cliff|bump", re.I
)
MAIN_LASER = re.compile(r"(^|/)(base_)?scan$")
NO_MAP = re.compile(r"costmap|mask|local_?map|submap", re.I)
LAST = re.compile(r"depth|infra|(^|[/_])ir([/_]|$)|disparity|mask|debug|thermal|right|rear|back", re.I)
HOUSEKEEPING = re.compile(r"^(rcl_interfaces|rosgraph_msgs|diagnostic_msgs|bond|dynamic_reconfigure)/")
PROJECTORS = {  # what makes scans of points
    "sensor_msgs/PointCloud2": "pointcloud_to_laserscan",
    "sensor_msgs/MultiEchoLaserScan": "laser_proc",
}
SHOWN = 12  # topics that an error or a remark lists


@dataclass(frozen=True, slots=True)
class PoseTopic:
    """A source of poses: a topic of poses, or two frames of a topic of transforms."""

    topic: str
    frames: tuple[str, str] | None = None  # the pose of the second in the first

    def __str__(self) -> str:
        """Return it as it is typed: `/odom`, `/tf:odom.base_link`."""
        return self.topic if self.frames is None else f"{self.topic}:{'.'.join(self.frames)}"


@dataclass(frozen=True, slots=True)
class TopicChoice:
    """The topics to read."""

    image: str | None
    odometry: PoseTopic | None
    truth: PoseTopic | None
    scan: str | None = None
    guess: str = ""  # what was guessed, in one line; "" when nothing was
    others: str = ""  # what else could have been chosen, where something was guessed

    @property
    def topics(self) -> tuple[str, ...]:
        """All topics to read, without duplicates."""
        names = (self.image, self.scan, *(route.topic for route in (self.odometry, self.truth) if route))
        return tuple(dict.fromkeys(name for name in names if name))


@dataclass(frozen=True, slots=True)
class TopicRequest:
    """The requested topics; None: guess one. "none" requests none."""

    image: str | None = None
    odometry: str | None = None
    truth: str | None = None
    scan: str | None = None


def choose(
    path: Path, topics: Sequence[Topic], wishes: TopicRequest, edges: Collection[tuple[str, str]] = ()
) -> TopicChoice:
    """Choose the topics; `edges` are the transforms' parents and children. InputError for a wrong topic."""
    image, scan = _image(path, topics, wishes.image), _scan(path, topics, wishes.scan)
    own, robot = of_robot(topics, scan or image), (scan or image or "").strip("/").partition("/")[0]
    truth = _route(path, topics, wishes.truth, _guess_truth(own))
    topic_of_truth = truth.topic if truth is not None and truth.frames is None else None
    odometry = _route(path, topics, wishes.odometry, _guess_odometry(own, edges, topic_of_truth, robot))
    choice = TopicChoice(image, odometry, truth, scan)
    guess, others = _guess_in_words(topics, wishes, choice)
    return replace(choice, guess=guess, others=others)


def of_robot(topics: Sequence[Topic], seen: str | None) -> list[Topic]:
    """Return the topics that are of no other robot than a topic: beside /a/scan and /b/scan not /b/odom."""
    robot, _, rest = (seen or "").strip("/").partition("/")
    words = [topic.name.strip("/").split("/") for topic in topics]
    others = {first for first, *more in words if rest and "/".join(more) == rest} - {robot}
    return [topic for topic, parts in zip(topics, words, strict=True) if not others & set(parts[:-1])]


def is_estimate(topics: Sequence[Topic], truth: PoseTopic) -> bool:
    """Return whether what is taken as truth is what a localizer published, by its name, type or frame."""
    if TRUE.search(truth.topic):
        return False
    if truth.frames is not None:
        return truth.frames[0] == "map" and not any(TRUE.search(name) for name in truth.frames)
    types = {known_type(t.type) for t in topics if t.name.lstrip("/") == truth.topic.lstrip("/")}
    return bool(ESTIMATED.search(truth.topic)) or POSE_WITH_COVARIANCE in types


def nothing_to_read(topics: Sequence[Topic], *, live: bool = False) -> str:
    """Return the error of a bag with neither pictures nor poses, which lists what it has.

    Of a `live` source: with neither pictures nor scans, as the filter waits for these.
    """
    advice = "expected pictures, scans, odometry or truth; name topics with --reading image_topic=..."
    if live:
        advice = (
            "expected pictures or scans; name a topic with --reading image_topic=... or scan_topic=..., "
            "or start the camera"
        )
    more = ["--as-recorded shows its particles"] if readable(topics, CLOUDS) else []
    parts = [f"found no topic of a type that is read, {advice}", f"it holds {listed(topics, live)}", *more]
    if live:
        parts = [f"found neither, {advice}", f"it has {listed(topics, live)}"]
    return "; ".join(part for part in (*parts, _video_advice(topics), _points_advice(topics)) if part)


def listed(topics: Sequence[Topic], live: bool = False) -> str:
    """List topics with their types and counts, of which there are none while they are `live`."""
    counts = {t.name: "" if live else f", {t.count}" for t in topics}
    parts = [f"{t.name} ({t.type or 'no type'}{counts[t.name]}{_why(t)})" for t in topics[:SHOWN]]
    more = f" and {len(topics) - SHOWN} more" if len(topics) > SHOWN else ""
    return f"{', '.join(parts)}{more}" if parts else "no topic at all"


def not_read(topics: Sequence[Topic], read: Collection[str | None]) -> str:
    """Say which topics with messages are not read, sensors before a system's own; "" where all are."""
    left = [topic for topic in topics if topic.count and topic.name not in read]
    left.sort(key=lambda topic: (bool(HOUSEKEEPING.search(topic.type)), -topic.count, topic.name))
    kinds = [topic.type.rpartition("/")[2] or "of no known type" for topic in left]
    parts = [f"{topic.name} ({topic.count} {kind})" for topic, kind in zip(left, kinds, strict=True)][:SHOWN]
    more = f" and {len(left) - SHOWN} more topics" if len(left) > SHOWN else ""
    return f"also holds {', '.join(parts)}{more}, not read" if parts else ""


def _why(topic: Topic) -> str:
    return f", {topic.unreadable}" if topic.unreadable else ""


def readable(topics: Sequence[Topic], types: Collection[str]) -> list[Topic]:
    """Return the topics of these types that are not empty and can be decoded."""
    return [t for t in topics if known_type(t.type) in types and t.count and not t.unreadable]


def _image(path: Path, topics: Sequence[Topic], wish: str | None) -> str | None:
    if wish is None:
        kinds = PICTURES | VIDEOS if can_decode() else PICTURES
        candidates = sorted(readable(topics, kinds), key=_first_camera)
        return candidates[0].name if candidates else None
    if wish == "none":
        return None
    named = named_topic(path, topics, wish, PICTURES | VIDEOS)
    if known_type(named.type) in VIDEOS and not can_decode():
        raise InputError(path, _needs_extra(named))
    return named.name


def _scan(path: Path, topics: Sequence[Topic], wish: str | None) -> str | None:
    if wish == "none":
        return None
    if wish is not None:
        return named_topic(path, topics, wish, SCANS).name
    return min(readable(topics, SCANS), key=_first_laser).name if readable(topics, SCANS) else None


def _first_laser(topic: Topic) -> tuple[bool, bool, int, int, str]:
    """Sort a robot's main laser before others, and what is filtered or raw behind it."""
    name = topic.name
    return bool(LASER_LAST.search(name)), not MAIN_LASER.search(name), -topic.count, len(name), name


def map_topics(topics: Sequence[Topic]) -> list[Topic]:
    """Return the topics of maps to localize on, a plain /map first; no costmaps and masks."""
    grids = [topic for topic in readable(topics, {GRID}) if not NO_MAP.search(topic.name)]
    return sorted(grids, key=lambda topic: (topic.name != "/map", len(topic.name), topic.name))


def _video_advice(topics: Sequence[Topic]) -> str:
    videos = [] if can_decode() else readable(topics, VIDEOS)
    return _needs_extra(videos[0]) if videos else ""


def _points_advice(topics: Sequence[Topic]) -> str:
    points = [(topic.name, PROJECTORS[topic.type]) for topic in readable(topics, PROJECTORS)]
    return f"{points[0][0]} is not read: record the scans that {points[0][1]} makes of it" if points else ""


def _needs_extra(topic: Topic) -> str:
    return f"{topic.name} is video; decoding it needs an extra; {INSTALL}"


def _first_camera(topic: Topic) -> tuple[bool, bool, bool, int, int, str]:
    """Sort color before depth, pictures before video, then by count; raw, the shorter name, comes first."""
    return (
        bool(LAST.search(topic.name)),
        known_type(topic.type) in VIDEOS,
        not FIRST.search(topic.name),
        -topic.count,
        len(topic.name),
        topic.name,
    )


def _route(
    path: Path, topics: Sequence[Topic], wish: str | None, guess: PoseTopic | None
) -> PoseTopic | None:
    if wish is None:
        return guess
    if wish == "none":
        return None
    name, _, frames = wish.partition(":")
    if not frames:
        topic = named_topic(path, topics, name, POSES | TRANSFORMS)
        if known_type(topic.type) in TRANSFORMS:
            raise InputError(path, f"found transforms at {name}, expected frames too: {name}:odom.base_link")
        return PoseTopic(name)
    named_topic(path, topics, name, TRANSFORMS)
    parent, _, child = frames.partition(".")
    if not parent or not child:
        raise InputError(path, f"found frames {frames!r}, expected two: {name}:odom.base_link")
    return PoseTopic(name, (parent.lstrip("/"), child.lstrip("/")))


def named_topic(path: Path, topics: Sequence[Topic], name: str, types: Collection[str]) -> Topic:
    """Return the topic of a name that carries one of these types. InputError without one."""
    same = [t for t in topics if t.name.lstrip("/") == name.lstrip("/")]
    if not same:
        raise InputError(path, f"found no topic {name}; it holds {listed(topics)}")
    for topic in same:
        if known_type(topic.type) in types and not topic.unreadable:
            return topic
    what = same[0].unreadable or f"it carries {same[0].type or 'no known type'}"
    raise InputError(path, f"the topic {name} cannot be read: {what}, expected {' or '.join(sorted(types))}")


def number_topics(path: Path, topics: Sequence[Topic], wish: str | None) -> dict[str, str]:
    """Return the topics of numbers by the names of their readings; by default all, named like their topics.

    A wish is topics with commas, each with its name before it where it has another: left=/floor/left,/range.
    """
    if wish is None:
        return {topic.name.lstrip("/"): topic.name for topic in readable(topics, NUMBERS)}
    if wish == "none":
        return {}
    pairs = [word.strip().rpartition("=") for word in wish.split(",") if word.strip()]
    named = ((name, named_topic(path, topics, topic, NUMBERS).name) for name, _, topic in pairs)
    return {name or topic.lstrip("/"): topic for name, topic in named}


def _guess_truth(topics: Sequence[Topic]) -> PoseTopic | None:
    return _with_most([t for t in readable(topics, POSES) if TRUE.search(t.name)])


def _with_most(topics: Sequence[Topic]) -> PoseTopic | None:
    order = sorted(topics, key=lambda t: ("filtered" in t.name, -t.count, len(t.name), t.name))
    return PoseTopic(order[0].name) if order else None


def _guess_odometry(
    topics: Sequence[Topic], edges: Collection[tuple[str, str]], taken: str | None, robot: str
) -> PoseTopic | None:
    """Prefer Odometry, then the transform from odom to the base, then any other poses."""
    poses = [t for t in readable(topics, POSES) if t.name != taken and not TRUE.search(t.name)]
    poses = [t for t in poses if t.type != POSE_WITH_COVARIANCE and not GUESSED.search(t.name)]
    if odometry := [t for t in poses if known_type(t.type) in ODOMETRIES]:
        return _with_most(odometry)
    moving = [t for t in readable(topics, TRANSFORMS) if "static" not in t.name]
    edge = _odometry_edge(edges, robot)
    return PoseTopic(moving[0].name, edge) if edge and moving else _with_most(poses)


def _odometry_edge(edges: Collection[tuple[str, str]], robot: str) -> tuple[str, str] | None:
    """Return the frames of the odometry, those in the robot's namespace before others."""
    fixed = [edge for edge in edges if FIXED.search(edge[0])]

    def order(edge: tuple[str, str]) -> tuple[bool, bool, tuple[str, str]]:
        return robot not in edge[0].split("/")[:-1], edge[1].rpartition("/")[2] not in BASE, edge

    return min(fixed, key=order, default=None)


def _guess_in_words(
    topics: Sequence[Topic],
    wishes: TopicRequest,
    choice: TopicChoice,
) -> tuple[str, str]:
    """Return what was guessed, and what else could have been chosen."""
    roles = (
        ("pictures", "--reading image_topic=...", wishes.image, choice.image, PICTURES | VIDEOS),
        ("scans", "--reading scan_topic=...", wishes.scan, choice.scan, SCANS),
        ("odometry", "--reading odometry_topic=...", wishes.odometry, choice.odometry, POSES),
        ("truth", "--reading truth_topic=...", wishes.truth, choice.truth, POSES),
    )
    lasers, cameras = (bool(readable(topics, kinds)) for kinds in (SCANS, PICTURES | VIDEOS))
    silent = {"scans"} if not lasers else set() if cameras else {"pictures"}  # what there is none of
    guessed = [role for role in roles if role[2] is None and role[0] not in silent]
    if not guessed:
        return "", ""
    chosen = [f"{what} {f'from {taken}' if taken else 'none'}" for what, _, _, taken, _ in guessed]
    used = {str(taken).partition(":")[0] for *_, taken, _ in roles if taken}
    kinds = PICTURES | VIDEOS | SCANS | POSES | CLOUDS
    others = [t for t in readable(topics, kinds) if t.name not in used]
    choices = ", ".join(role[1] for role in guessed)
    also = f"also there: {listed(others)}" if others else ""
    video = "" if choice.image else _video_advice(topics)
    points = "" if choice.image or choice.scan else _points_advice(topics)
    parts = (f"guessed {', '.join(chosen)} ({choices} to choose otherwise)", video, points)
    return "; ".join(text for text in parts if text), also
