"""What happens between two pictures, with its times: what a session log is made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from maurice_loaders.reading.recording import Motion, Note
from maurice_loaders.session_log.writer import LogLines
from maurice_mcl.values import F64, INCH_M, KIDNAPPED, U8, Arena, LaserScan, NamedProgress

from ..worlds.world import floor_at
from .drive import DriveUpdate

FRAME_S = 3.3  # to fetch an 88 x 143 frame at 115,200 baud (worked out from the CMUcam2's manual)
SETTLE_S = 0.5  # before and after each movement; invented
TURN_RAD_S = float(np.radians(45))  # invented
DRIVE_M_S = 0.15  # invented
CARRY_S = 20.0  # to carry the robot somewhere else; invented


class Eye(Protocol):
    """A camera or a laser on one day, such as a `CameraSession`."""

    def take(self, number: int, pose: F64) -> U8 | LaserScan:
        """Take picture `number` (H, W, 3), or a scan, from a true pose (3,)."""
        ...

    def events(self, number: int) -> tuple[str, ...]:
        """Return what happens to the light at that picture."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Everything from the last picture up to and with the next one."""

    entries: tuple[Motion | Note, ...]  # in order, none after `t_s`
    t_s: float  # when the picture is there
    pose: F64  # (3,) where it was taken
    kidnapped_to: F64 | None = None  # (3,) where the robot was carried afterwards


def write_segments(
    log: LogLines,
    start: F64,
    segments: Iterable[Segment],
    eye: Eye,
    arena: Arena,
    total: int,
    report: NamedProgress,
) -> None:
    """Write a session as it goes: movements, events, a picture and the truth for each segment."""
    log.event(0.0, _floor_event(arena, start))
    log.truth(0.0, start)
    for number, segment in enumerate(segments, start=1):
        for entry in segment.entries:
            log.add(entry)
        for text in eye.events(number):
            log.event(segment.t_s, text)
        seen = eye.take(number, segment.pose)
        if isinstance(seen, LaserScan):
            log.scan(segment.t_s, seen)
        else:
            log.image(segment.t_s, seen, camera="front")
        log.truth(segment.t_s, segment.pose)
        if segment.kidnapped_to is not None:
            log.event(segment.t_s + CARRY_S, KIDNAPPED)
            log.event(segment.t_s + CARRY_S, _floor_event(arena, segment.kidnapped_to))
            log.truth(segment.t_s + CARRY_S, segment.kidnapped_to)
        report(number, total, "session")


def _floor_event(arena: Arena, pose: F64) -> str:
    return f"floor {floor_at(arena, float(pose[0]), float(pose[1]))}".strip()


def driven_segments(updates: Iterable[DriveUpdate], arena: Arena) -> Iterator[Segment]:
    """Yield the updates of a drive with their times: each movement settles before the next begins."""
    t_s = 0.0
    for update in updates:
        segment = timed(t_s, update, arena)
        yield segment
        t_s = segment.t_s + (0.0 if segment.kidnapped_to is None else CARRY_S)


def timed(t_s: float, update: DriveUpdate, arena: Arena) -> Segment:
    """Return the segment of one update that begins at a time."""
    turn, straight = update.turn, update.straight
    turned = t_s + 2 * SETTLE_S + abs(float(turn.measured[2])) / TURN_RAD_S
    took = abs(float(straight.measured[0])) / DRIVE_M_S
    driven = turned + 2 * SETTLE_S + took
    changes = crossings(straight.path, arena)
    begun = turned + SETTLE_S
    happened = [Note(begun + share * took, f"floor {name}".strip()) for share, name in changes]
    if straight.slipped_rad:
        slip = f"slip {np.degrees(straight.slipped_rad):+.1f} deg"
        happened.insert(1, Note(happened[0].t_s, slip))
    if straight.spun_m:
        happened.append(Note(driven, f"slip {straight.spun_m / INCH_M:.1f} in ahead: the wheels spin"))
    if straight.bumped:
        happened.append(Note(driven, "bump"))
    first = Motion(turned, turn.measured, turn.encoders_m)
    last = Motion(driven, straight.measured, straight.encoders_m)
    return Segment((first, *happened, last), driven + FRAME_S, update.pose, update.kidnapped_to)


def crossings(path: F64, arena: Arena) -> list[tuple[float, str]]:
    """Return how far along a path (K, 3) the floor changes, as a share of it, and to which floor."""
    names = [floor_at(arena, float(x), float(y)) for x, y, _ in path]
    return [(k / (len(names) - 1), names[k]) for k in range(1, len(names)) if names[k] != names[k - 1]]
