"""Messages of a running robot as lines of a session log: pictures, and what moved between them."""

from __future__ import annotations

import base64
import json
import re
import time
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from maurice_mcl.typing import F64

from .bag_clock import use_recorded
from .bag_images import picture_of
from .bag_messages import pose_of, stamp_ns
from .fields import FieldError
from .pictures import encode_jpeg
from .recording import TruthPose, interpolated, motion_between

MOST_KEPT = 2000  # poses of one topic that pictures are looked up in
MOST_PICTURES = 8  # that wait for the odometry after them ...
LONGEST_S = 1.0  # ... and for how long by our own clock
MOST_UNDATED = 50  # messages held back until every topic has shown what its times are worth
COMPRESSED = re.compile(r"jpe?g|png|webp", re.I)


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """A message of a topic, not decoded yet."""

    topic: str
    log_ns: int  # when the bridge sent it, or it came
    decode: Callable[[], Any]  # gives an object with the message's fields


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics that are read, by "image", "odometry" and "truth"; None for what there is none of."""

    by_role: Mapping[str, str | None]

    @property
    def names(self) -> tuple[str, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys(name for name in self.by_role.values() if name))

    def role(self, topic: str) -> str:
        """Tell what a topic is read for."""
        return next((role for role, name in self.by_role.items() if name == topic), "")


def json_message(data: bytes | str) -> Any:
    """Decode a JSON message into an object with its fields."""
    return json.loads(data, object_hook=as_object)


def as_object(found: dict[str, Any]) -> Any:
    """Give a JSON object as an object with fields; the parts of a ROS 1 time are named as in ROS 2."""
    if found.keys() == {"secs", "nsecs"}:
        found = {"sec": found["secs"], "nanosec": found["nsecs"]}
    return SimpleNamespace(**found)


class Track:
    """The poses that one topic has told lately, by their times."""

    def __init__(self) -> None:
        self.first: F64 | None = None
        self._poses: deque[tuple[float, int, F64]] = deque()
        self._number = 0

    @property
    def last_s(self) -> float:
        """The latest time of a pose."""
        return self._poses[-1][0] if self._poses else float("-inf")

    def add(self, t_s: float, pose: F64) -> None:
        """Take in a pose, also one that comes a little late."""
        self._number += 1
        self.first = pose if self.first is None else self.first
        if t_s >= self.last_s:
            self._poses.append((t_s, self._number, pose))
        else:
            insort(self._poses, (t_s, self._number, pose))
        if len(self._poses) > MOST_KEPT:
            self._poses.popleft()

    def at(self, t_s: float, max_dt_s: float) -> F64 | None:
        """Give the pose (3,) at a time: between two that near, or the only one that is."""
        before = next((one for one in reversed(self._poses) if one[0] <= t_s), None)
        after = next((one for one in self._poses if one[0] >= t_s), None) if self.last_s >= t_s else None
        near = [one for one in (before, after) if one is not None and abs(one[0] - t_s) <= max_dt_s]
        if len(near) == 2:
            return interpolated(TruthPose(near[0][0], near[0][2]), TruthPose(near[1][0], near[1][2]), t_s)
        return near[0][2] if near else None


class Translator:
    """Turns messages into records of a session log, as objects to be written as lines."""

    def __init__(self, max_dt_s: float) -> None:
        self.problems: deque[FieldError] = deque(maxlen=100)  # pictures that were left out
        self._max_dt_s = max_dt_s
        self._tracks = {"odometry": Track(), "truth": Track()}
        self._undated: (
            list[tuple[str, int, Any]] | None
        ) = []  # role, log time, message; None once it is known
        self._recorded = False  # the times that messages carry are of no use
        self._pictures: deque[tuple[float, float, Any]] = deque()  # time, our own clock's, message
        self._last_pose: F64 | None = None
        self._last_s = float("-inf")
        self._has_odometry = False

    def take(self, said: Said, topics: Topics) -> Iterator[dict[str, Any]]:
        """Take in a message. FieldError for one that makes no sense."""
        role = topics.role(said.topic)
        if not role:
            return
        self._has_odometry = topics.by_role["odometry"] is not None
        message = _decoded(said)
        if self._undated is None:
            yield from self._sort(role, said.log_ns, message)
            return
        self._undated.append((role, said.log_ns, message))
        roles = {one for one, _, _ in self._undated}
        if roles >= {one for one, name in topics.by_role.items() if name} or self._many_undated():
            yield from self._settle_clock()

    def idle(self) -> Iterator[dict[str, Any]]:
        """Give what has waited long enough, when nothing comes."""
        if self._undated:
            yield from self._settle_clock()
        yield from self._ready()

    def _many_undated(self) -> bool:
        undated = self._undated or []
        return len(undated) > MOST_UNDATED or sum(role == "image" for role, _, _ in undated) > MOST_PICTURES

    def _settle_clock(self) -> Iterator[dict[str, Any]]:
        undated, self._undated = self._undated or [], None
        stamps: dict[str, list[tuple[int | None, int]]] = {}
        for role, log_ns, message in undated:
            stamps.setdefault(role, []).append((stamp_ns(message), log_ns))
        if why := use_recorded(stamps):
            self._recorded = True
            t_s = undated[0][1] / 1e9
            yield {"t": t_s, "event": f"clock: the bridge's times are used, because {why}"}
        for one in undated:
            yield from self._sort(*one)

    def _sort(self, role: str, log_ns: int, message: Any) -> Iterator[dict[str, Any]]:
        stamp = None if self._recorded else stamp_ns(message)
        t_s = (log_ns if stamp is None else stamp) / 1e9
        if role == "image":
            self._pictures.append((t_s, time.monotonic(), message))
        else:
            self._tracks[role].add(t_s, _pose(message))
        yield from self._ready()

    def _ready(self) -> Iterator[dict[str, Any]]:
        """Give the pictures about which nothing more will be known."""
        while self._pictures:
            t_s, since_s, message = self._pictures[0]
            known = not self._has_odometry or self._tracks["odometry"].last_s >= t_s
            waited = time.monotonic() - since_s > LONGEST_S or len(self._pictures) > MOST_PICTURES
            if not known and not waited:
                return
            self._pictures.popleft()
            try:
                yield from self._lines(t_s, message)
            except FieldError as problem:  # before any of its lines
                self.problems.append(problem)

    def _lines(self, t_s: float, message: Any) -> Iterator[dict[str, Any]]:
        """Give the lines of one picture: what moved, the truth, the picture."""
        if t_s < self._last_s:
            raise FieldError(f"found a picture at {t_s:.6f} s after one at {self._last_s:.6f} s")
        pose = self._tracks["odometry"].at(t_s, self._max_dt_s)
        if pose is None and self._has_odometry:
            raise FieldError(f"found no odometry within {self._max_dt_s:g} s of a picture; see --max-dt")
        image = {"base64": _encoded(message)}
        self._last_s = t_s
        if pose is not None:
            before = self._tracks["odometry"].first if self._last_pose is None else self._last_pose
            self._last_pose = pose
            if before is not None and not np.array_equal(before, pose):
                yield {"t": t_s, "odometry": motion_between(before, pose).tolist()}
        truth = self._tracks["truth"].at(t_s, self._max_dt_s)
        if truth is not None:
            yield {"t": t_s, "truth": truth.tolist()}
        yield {"t": t_s, "image": image}


def _decoded(said: Said) -> Any:
    try:
        return said.decode()
    except Exception as problem:  # decoders raise anything on what a broken peer sends
        raise FieldError(
            f"found a message of {said.topic} that cannot be decoded ({_short(problem)})"
        ) from None


def _pose(message: Any) -> F64:
    try:
        return pose_of(message)
    except (AttributeError, TypeError, ValueError) as problem:
        raise FieldError(f"found no pose in a message ({_short(problem)})") from None


def _encoded(message: Any) -> str:
    """Give a picture's file as base64: as it came where it is compressed, else as JPEG."""
    try:
        form = str(getattr(message, "format", ""))
        if hasattr(message, "encoding") or not COMPRESSED.search(form) or "Depth" in form:
            return base64.b64encode(encode_jpeg(picture_of(message))).decode("ascii")
        data = message.data
        return data if isinstance(data, str) else base64.b64encode(bytes(data)).decode("ascii")
    except (AttributeError, TypeError, ValueError) as problem:
        raise FieldError(f"found a picture that cannot be used ({_short(problem)})") from None


def _short(problem: Exception) -> str:
    return " ".join(str(problem).split())[:200] or type(problem).__name__
