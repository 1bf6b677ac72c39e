"""What a robot saw and did: frames for the filter, and moments, which also hold the truth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from .arrays import F64, U8
from .laser import LaserScan
from .map import Arena


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """All that the filter may see of one update; `motions` are the robot's own, in order (thesis 3.2).

    >>> import numpy as np, maurice_mcl as mcl
    >>> frame = mcl.Frame(1, 0.5, np.array([[0.1, 0.0, 0.2]]), np.zeros((24, 32, 3), np.uint8), "")
    >>> frame.motions.shape
    (1, 3)
    """

    step: int  # 1 for the first picture
    time_s: float  # since the session's first record; never decreases
    motions: F64  # (M, 3) forward_m, left_m, turn_rad, each in the robot's frame at its start
    image: U8  # (H, W, 3) RGB, top row first
    picture: str  # where the image is stored, for people; "" when nowhere
    # numbers by name, of other sensors than the camera: the newest of each name since the last frame
    readings: Mapping[str, float] = field(default_factory=dict)
    scan: LaserScan | None = None  # of a planar laser, taken at the frame's pose


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A frame, and what the filter must not see.

    >>> import maurice_mcl as mcl
    >>> moment = next(mcl.tiny_session().moments())
    >>> moment.truth.shape, moment.events
    ((3,), ())
    """

    frame: Frame
    truth: F64 | None = None  # (3,) x_m, y_m, heading_rad; None when unknown
    events: tuple[str, ...] = ()  # free text since the last frame, as the log has it

    @property
    def without_picture(self) -> Moment:
        """The moment without its picture, for a filter that is given its comparison: pictures fill memory."""
        return replace(self, frame=replace(self.frame, image=NO_PICTURE))

    @property
    def kidnapped(self) -> bool:
        """Whether the log says that the robot was carried away since the last frame."""
        return any(map(is_kidnapping, self.events))

    def told(self, word: str) -> tuple[str, ...]:
        """Return the events of one kind: those whose first word is `word`."""
        return tuple(text for text in self.events if first_word(text) == word)


NO_PICTURE: U8 = np.full((90, 120, 3), 48, np.uint8)  # the image of a frame of a robot without a camera
KIDNAPPED = "kidnapped"  # first word of an event that says so
FIRST_WORD = re.compile(r"[^\W\d_]+")


def first_word(text: str) -> str:
    """Return the first word of an event, in lower case, which is its kind (docs/session-log.md).

    >>> first_word("Kidnapped: by a visitor"), first_word("  ")
    ('kidnapped', '')
    """
    word = FIRST_WORD.search(text)
    return word[0].lower() if word else ""


SKIPPED = "skipped"  # first word of the events of a live run that left observations out
SKIPPED_COUNT = re.compile(rf"{SKIPPED}: (\d+) ")


def skipped_before(events: Iterable[str]) -> int:
    """Return how many observations a live run left out right before a moment with these events.

    >>> skipped_before(["bump", "skipped: 3 pictures: the filter was too slow"])
    3
    """
    return sum(int(match[1]) for text in events if (match := SKIPPED_COUNT.match(text)))


def is_kidnapping(text: str) -> bool:
    """Return whether an event says that the robot was carried away, unseen by its odometry."""
    return first_word(text) == KIDNAPPED


@dataclass(frozen=True, slots=True)
class Camera:
    """One camera of the robot, as the header describes it; every field may be unknown."""

    name: str
    width_px: int | None = None
    height_px: int | None = None
    horizontal_fov_rad: float | None = None
    yaw_rad: float = 0.0  # viewing direction, counter-clockwise from the robot's forward
    height_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SessionInfo:
    """The contents of a session's header: known before the first frame, constant during the drive."""

    name: str
    display_units: str = "m"  # "m" or "in", for display; everything stored is in meters
    robot: str = "robot"
    motion: dict[str, Any] | None = None  # parameters, see maurice_mcl.filter.motion; None: generic odometry
    cameras: tuple[Camera, ...] = ()
    start: F64 | None = None  # (3,) where the drive began, if known
    survey: Path | None = None  # the survey log or library that it belongs to, resolved
    arena: Arena | None = None
    notes: tuple[str, ...] = field(default=())  # for example "odometry is synthetic: ..."
    captured: bool = False  # of a live source: its moments are those of the live run


class Session(Protocol):
    """A recorded drive, which can be read from its beginning any number of times.

    Any class with these two members is a session; `maurice_loaders.open_session` returns one for a recording.

        >>> import maurice_mcl as mcl
        >>> session: mcl.Session = mcl.tiny_session()
        >>> session.info.name, sum(1 for moment in session.moments())
        ('tiny drive', 6)
    """

    @property
    def info(self) -> SessionInfo:
        """The header."""
        ...

    def moments(self) -> Iterator[Moment]:
        """Yield from the first picture, on every call; read lazily."""
        ...


def expect_frame(moment: Moment, before: Frame | None) -> None:
    """Raise InputError, in one line, for a moment that no filter can use after the frame `before` it."""
    frame, image = moment.frame, moment.frame.image
    is_array = isinstance(image, np.ndarray) and image.dtype == np.uint8
    if not is_array or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        kind = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError(None, f"image: found {kind}, expected uint8 (H, W, 3) RGB")
    motions = frame.motions
    if not isinstance(motions, np.ndarray) or motions.ndim != 2 or motions.shape[1] != 3:
        kind = str(motions.shape) if isinstance(motions, np.ndarray) else type(motions).__name__
        raise InputError(None, f"motion: found {kind}, expected (M, 3) forward_m, left_m, turn_rad")
    if not np.isfinite(motions).all():
        raise InputError(None, f"motion: found {motions.tolist()!r:.80}, expected finite numbers")
    if moment.truth is not None and (np.shape(moment.truth) != (3,) or not np.isfinite(moment.truth).all()):
        raise InputError(None, f"truth: found {moment.truth!r:.80}, expected three finite numbers")
    for name, value in frame.readings.items():
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise InputError(None, f"reading {name}: found {value!r:.60}, expected a finite number")
    least = 1 if before is None else before.step + 1
    if frame.step < least:
        raise InputError(None, f"step: found {frame.step}, expected {least} or more")
    least_s = -np.inf if before is None else before.time_s
    if not np.isfinite(frame.time_s) or frame.time_s < least_s:
        raise InputError(None, f"time_s: found {frame.time_s}, expected a finite time from {least_s:g} on")
