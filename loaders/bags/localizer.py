"""Another localizer's output in a bag: its particles and its pose, update by update; and the bag's map.

AMCL and Beluga publish their cloud after resampling, so its weights are nearly equal. Their pose comes in a
separate message at nearly the same time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from maurice_mcl.values import F64, U8, Arena, LaserScan, SessionInfo, open_arena

from ..errors import InputError, ReadingNotes
from ..files.maps import arena_of_message, occupancy_of_message
from ..reading.options import Reading
from ..reading.plane import Plane
from ..reading.recording import Motion, Note, OdometryPose, Picture, Record, Scan, TruthPose
from ..reading.time_alignment import Aligner, Steps, as_rows
from .maps import map_of
from .messages import (
    CLOUDS,
    IN_XY,
    POSE_WITH_COVARIANCE,
    POSES,
    clock_ns,
    cloud_of,
    known_type,
    pose_of,
)
from .readers import OneTopic, Timed, in_order, read_bag
from .recording import BagRecording, peek, pose_in_words, start_topics
from .source import BagSource, Message, OpenBag, Topic
from .topics import PoseTopic, TopicRequest, choose, listed, named_topic, of_robot, readable


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """The particles of a recorded localizer at one time."""

    t_s: float
    poses: F64  # (N, 3) x_m, y_m, heading_rad in the map's frame
    weights: F64 | None  # (N,) as recorded; None: the message has none


@dataclass(frozen=True, slots=True)
class CloudReader(OneTopic):
    """Converts a topic's messages to clouds."""

    types: ClassVar[Collection[str]] = CLOUDS

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the cloud of one message."""
        yield Cloud(t_s, *cloud_of(content))


@dataclass(frozen=True, slots=True, eq=False)
class LocalizerPose:
    """The pose that a recorded localizer published."""

    t_s: float
    pose: F64  # (3,)
    sd: F64  # (3,) standard deviations of x_m, y_m and heading_rad, by its own covariance


@dataclass(frozen=True, slots=True)
class LocalizerPoseReader(OneTopic):
    """Converts a topic of poses to a localizer's; without a covariance they are taken as exact."""

    types: ClassVar[Collection[str]] = POSES
    plane: Plane = IN_XY
    alone: bool = False  # there is no cloud: poses of the same mean and covariance stand for it

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the pose of one message."""
        covariance = covariance_of(content, self.plane)
        variances = np.diag(covariance)
        sd = np.sqrt(np.where((variances > 0) & (variances < np.inf), variances, 0))
        pose = LocalizerPose(t_s, pose_of(content, self.plane), sd)
        yield pose
        if self.alone:
            yield Cloud(t_s, stand_ins(pose.pose, covariance), None)


class GivenPoseReader(OneTopic):
    """Converts what somebody told the localizer, as RViz's 2D Pose Estimate does, to events."""

    types: ClassVar[Collection[str]] = (POSE_WITH_COVARIANCE,)

    def read(self, content: Any, t_s: float, message: Message, number: int) -> Iterator[Timed]:
        """Yield the event of one message."""
        yield Note(t_s, f"given a pose: {pose_in_words(pose_of(content))} ({self.topic})")


def covariance_of(message: Any, plane: Plane) -> F64:
    """Return the covariance (3, 3) of x_m, y_m and heading_rad; zeros for a message without one."""
    entries = getattr(getattr(message, "pose", None), "covariance", None)
    if entries is None:
        return np.zeros((3, 3))
    turned = np.kron(np.eye(2), plane.turned)
    covariance: F64 = turned @ np.asarray(entries, np.float64).reshape(6, 6) @ turned.T
    return covariance[np.ix_(PLANAR, PLANAR)]


STAND_INS = 500  # so that shares of them within a radius are those of the normal distribution to 2 points


def stand_ins(pose: F64, covariance: F64) -> F64:
    """Return poses (500, 3), normally distributed, of exactly this mean and covariance.

    What is no covariance counts as 0. The numbers are the same at every update.
    """
    if not np.isfinite(covariance).all():
        return np.repeat(pose[None], STAND_INS, axis=0)
    variances, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    points: F64 = pose + _standard_normals() @ (np.sqrt(np.maximum(variances, 0)) * axes).T
    return points


@cache
def _standard_normals() -> F64:
    """Return normal numbers (500, 3) of mean 0 and covariance 1, to rounding."""
    numbers = np.random.default_rng(0).standard_normal((STAND_INS, 3))
    numbers -= numbers.mean(axis=0)
    spread = np.linalg.cholesky(np.cov(numbers.T, bias=True))
    return np.asarray(np.linalg.solve(spread, numbers.T).T)


PLANAR = [0, 1, 5]  # x, y and the turn about z, of six
NEAR_S = 0.5  # most time between pose and cloud of one update
MAX_DT_S = 1.0  # most time between an update and the odometry used for it


@dataclass(frozen=True, slots=True, eq=False)
class RecordedUpdate:
    """One cloud of the localizer, and what was known when it was published."""

    t_s: float
    poses: F64  # (N, 3) in the map's frame, N > 0
    weights: F64 | None  # (N,) as recorded; None: the message has none
    pose: LocalizerPose | None  # the localizer's own, within 0.5 s
    motions: F64  # (M, 3) by odometry since the last update
    truth: F64 | None  # (3,)
    read: Callable[[], U8] | None  # decodes the last picture before; None: there was none yet
    picture: str  # its name
    scan: LaserScan | None = None  # the nearest within 0.5 s
    events: tuple[str, ...] = ()  # since the last update


@dataclass(frozen=True, slots=True)
class Overview:
    """The contents of the whole recording, from one reading."""

    updates: int
    has_truth: bool
    most_particles: int
    arena: Arena  # the bag's map, or where the particles were


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _CloudPicture(Picture):
    """A cloud disguised as a picture, for which the time alignment is made."""

    cloud: Cloud
    estimate: LocalizerPose | None
    view: Picture | None
    scan: LaserScan | None


class RecordedLocalizer:
    """The localizer of a bag. InputError if the bag holds no particles, or is damaged."""

    def __init__(
        self,
        path: Path,
        open_bag: OpenBag,
        options: Reading,
        topic: str | None = None,
        arena: Arena | None = None,
    ) -> None:
        """Choose what is read; `topic` is the localizer's, `arena` counts in place of the bag's map."""
        self.path = path
        self._options = options
        with open_bag(path) as bag:
            scan = choose(path, bag.topics, TopicRequest(scan=options.scan_topic)).scan
            topics = of_robot(bag.topics, scan)
            self._given = [topic.name for topic in start_topics(bag, scan)]
            self.pose = _pose_topic(topics)
            self.cloud = _cloud_topic(path, topics, self.pose)  # or that of the poses, without a cloud
            if topic is not None:
                self.cloud = named_topic(path, bag.topics, topic, CLOUDS | POSES)
                if known_type(self.cloud.type) in POSES:
                    self.pose = self.cloud
            self._map = arena or _map_in(path, bag)
            own = [topic.name for topic in (self.cloud, self.pose) if topic is not None]
            self._drive = BagRecording(path, open_bag, options, beside=[*own, *self._given])
            names = [*dict.fromkeys(own), *self._drive.chosen.topics]
            if self._map is not None and self._drive.chosen.scan is None:
                self._map = replace(self._map, occupancy=None)  # which is for scans
            self._clock_ns = clock_ns({name: peek(bag, name) for name in names})

    @property
    def info(self) -> SessionInfo:
        """What is known before the first update."""
        return self._drive.info

    @property
    def has_cloud(self) -> bool:
        """Whether particles were recorded, and not only poses with their covariance."""
        return self.cloud is not self.pose

    @property
    def has_pictures(self) -> bool:
        """Whether pictures are read."""
        return self._drive.chosen.image is not None

    def updates(self, notes: ReadingNotes) -> Iterator[RecordedUpdate]:
        """Yield all updates from the first; invalid messages go to `notes`."""
        steps, aligner = Steps(), Aligner(MAX_DT_S)
        for aligned in aligner(_joined(self._stream(notes))):
            picture = aligned.picture
            if not isinstance(picture, _CloudPicture):
                continue
            pose = aligned.odometry_at(MAX_DT_S)
            motions = steps.add(aligned.motions, pose, aligner.first_odometry)
            steps.used(pose)
            yield RecordedUpdate(
                picture.t_s,
                picture.cloud.poses,
                picture.cloud.weights,
                picture.estimate,
                as_rows(motions),
                aligned.truth_at(),
                None if picture.view is None else picture.view.read,
                "" if picture.view is None else picture.view.name,
                picture.scan,
                tuple(aligned.events),
            )

    def overview(self) -> Overview:
        """Read it once, without any picture."""
        count, truth, most = 0, False, 0
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for update in self.updates(ReadingNotes(self._options.keep_going)):
            count, most = count + 1, max(most, len(update.poses))
            truth = truth or update.truth is not None
            some = [update.poses, *([update.truth[None]] if update.truth is not None else [])]
            xy = np.concatenate(some)[:, :2]
            low, high = np.minimum(low, xy.min(axis=0)), np.maximum(high, xy.max(axis=0))
        if not count:
            text = f"found no particles at {self.cloud.name}, expected a localizer's cloud"
            raise InputError(self.path, text)
        return Overview(count, truth, most, self._map or open_arena(np.stack([low, high]), 1.0))

    def _stream(self, notes: ReadingNotes) -> Iterator[Timed]:
        readers = [*self._drive.readers()]
        if self.has_cloud:
            readers.append(CloudReader(self.cloud.name))
        if self.pose is not None:
            alone = not self.has_cloud
            plane = self._drive.plane(PoseTopic(self.pose.name)) if alone else IN_XY
            readers.append(LocalizerPoseReader(self.pose.name, plane, alone))
        readers += map(GivenPoseReader, self._given)
        records = read_bag(self.path, self._drive.open_bag, readers, notes, self._clock_ns)
        yield from in_order(records, notes)


class Nearest:
    """The updates of a localizer that are nearest to some rising times."""

    def __init__(self, updates: Iterator[RecordedUpdate]) -> None:
        self._updates = updates
        self._before: RecordedUpdate | None = None
        self._after = next(updates, None)

    def at(self, t_s: float) -> RecordedUpdate | None:
        """Return the update nearest to a time, None where none is within 0.5 s."""
        while self._after is not None and self._after.t_s <= t_s:
            self._before, self._after = self._after, next(self._updates, None)
        return _nearest([update for update in (self._before, self._after) if update], t_s)


def _joined(stream: Iterable[Timed]) -> Iterator[Record]:
    """Join each cloud with the pose and the scan nearest in time, and with the last picture before it."""
    waiting: deque[Timed] = deque()
    last: dict[type[Timed], Timed] = {}  # of each kind, so far
    for record in stream:
        waiting.append(record)
        while waiting[0].t_s < record.t_s - NEAR_S:
            yield from _passed(waiting, last)
    while waiting:
        yield from _passed(waiting, last)


def _passed(waiting: deque[Timed], last: dict[type[Timed], Timed]) -> Iterator[Record]:
    """Release the first record; all records near it in time follow it in `waiting`."""
    record = waiting.popleft()
    if isinstance(record, Picture | LocalizerPose | Scan):
        last[type(record)] = record
    elif isinstance(record, Motion | OdometryPose | TruthPose | Note):
        yield record
    elif isinstance(record, Cloud) and len(record.poses):
        near = [*last.values(), *waiting]
        pose = _nearest([p for p in near if isinstance(p, LocalizerPose)], record.t_s)
        at_s = record.t_s if pose is None else pose.t_s  # whose stamp is that of the scan behind it
        scan = _nearest([p for p in near if isinstance(p, Scan)], at_s)
        camera = last.get(Picture)
        yield _CloudPicture(
            record.t_s,
            _no_image,
            "",
            cloud=record,
            estimate=pose,
            view=camera if isinstance(camera, Picture) else None,
            scan=None if scan is None else scan.scan,
        )


Near = TypeVar("Near", bound=Timed)


def _nearest(records: Iterable[Near], t_s: float) -> Near | None:
    near = (record for record in records if abs(record.t_s - t_s) <= NEAR_S)
    return min(near, key=lambda record: abs(record.t_s - t_s), default=None)


def _no_image() -> U8:
    return np.zeros((1, 1, 3), np.uint8)


def _cloud_topic(path: Path, topics: Sequence[Topic], pose: Topic | None) -> Topic:
    """Return the cloud with the most messages, weighted ones first; without a cloud the localizer's poses."""
    clouds = sorted(readable(topics, CLOUDS), key=lambda t: ("ParticleCloud" not in t.type, -t.count, t.name))
    shown = next(iter(clouds), pose)
    if shown is None:
        advice = "expected a localizer's particles (PoseArray, ParticleCloud) or PoseWithCovarianceStamped"
        raise InputError(path, f"found no cloud, {advice}; it holds {listed(topics)}")
    return shown


def _pose_topic(topics: Sequence[Topic]) -> Topic | None:
    poses = [t for t in readable(topics, {POSE_WITH_COVARIANCE}) if "initial" not in t.name]
    return min(poses, key=lambda t: ("amcl" not in t.name, -t.count, t.name), default=None)


def _map_in(path: Path, bag: BagSource) -> Arena | None:
    with suppress(InputError):  # it is drawn, and nothing is compared with it
        return map_of(path, bag, _arena_of)
    return None


def _arena_of(message: Any) -> Arena:
    arena = arena_of_message(message)
    with suppress(InputError):  # without a free cell, or without an occupied one
        return replace(arena, occupancy=occupancy_of_message(message))
    return arena
