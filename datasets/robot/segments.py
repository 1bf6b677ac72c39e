"""What happens between two pictures or scans, with its times: what a session log is made of."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from maurice_loaders.reading.recording import Motion, Note, OdometryPose, Picture, Record, Scan, TruthPose
from maurice_loaders.session_log.writer import LogLines
from maurice_mcl.values import F64, INCH_M, KIDNAPPED, U8, Arena, LaserScan, NamedProgress, compose

from ..worlds.world import floor_at
from .drive import DriveUpdate

CAMERA = "front"  # its name
FRAME_S = 3.3  # to fetch an 88 x 143 frame at 115,200 baud (worked out from the CMUcam2's manual)
SETTLE_S = 0.5  # before and after each movement; invented
TURN_RAD_S = float(np.radians(45))  # invented
DRIVE_M_S = 0.15  # invented
SCAN_HZ = 5  # of a laser, as small robots have them
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
    """Everything from the last picture or scan up to and with the next one."""

    entries: tuple[Motion | OdometryPose | Note, ...]  # in order, none after `t_s`
    t_s: float  # when the picture is there
    pose: F64  # (3,) where it was taken
    is_last: bool = True  # of an update: a laser scans on the way, too
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
    """Write a session of so many updates as it goes."""
    updates = 0
    for record in begun(start, arena):
        log.add(record)
    for number, segment in enumerate(segments, start=1):
        for record in records_of(number, segment, eye, arena):
            if isinstance(record, Picture):
                log.image(record.t_s, record.read(), camera=record.camera)
            else:
                log.add(record)
        updates += segment.is_last
        report(updates, total, "session")


def begun(start: F64, arena: Arena) -> tuple[Record, ...]:
    """Return the records of a robot that stands at a pose (3,) where its drive begins."""
    return Note(0.0, _floor_event(arena, start)), TruthPose(0.0, start)


def records_of(number: int, segment: Segment, eye: Eye, arena: Arena) -> Iterator[Record]:
    """Yield the records of a segment, the `number`-th: movements, events, what is seen, the truth."""
    yield from segment.entries
    t_s, seen = segment.t_s, eye.take(number, segment.pose)
    yield from (Note(t_s, text) for text in eye.events(number))
    yield Scan(t_s, seen) if isinstance(seen, LaserScan) else Picture(t_s, lambda: seen, "", camera=CAMERA)
    yield TruthPose(t_s, segment.pose)
    if segment.kidnapped_to is not None:
        put_down_s = t_s + CARRY_S
        yield Note(put_down_s, KIDNAPPED)
        yield Note(put_down_s, _floor_event(arena, segment.kidnapped_to))
        yield TruthPose(put_down_s, segment.kidnapped_to)


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
    turned = t_s + 2 * SETTLE_S + _turn_s(update)
    driven = turned + 2 * SETTLE_S + _straight_s(update)
    happened = _happened(update, arena, turned + SETTLE_S, driven)
    first = Motion(turned, turn.measured, turn.encoders_m)
    last = Motion(driven, straight.measured, straight.encoders_m)
    pose, carried = update.pose, update.kidnapped_to
    return Segment((first, *happened, last), driven + FRAME_S, pose, kidnapped_to=carried)


def scanned_segments(start: F64, updates: Iterable[DriveUpdate], arena: Arena) -> Iterator[Segment]:
    """Yield the scans of a drive with their times, the first at its start (3,); the robot does not pause.

    Each comes with the pose by the odometry, whose frame begins there. What to do next is decided at a scan.
    """
    clock, odometry = 0, np.zeros(3)  # in scans
    yield Segment((OdometryPose(0.0, odometry),), 0.0, start, is_last=False)
    for update in updates:
        count = max(1, math.ceil((_turn_s(update) + _straight_s(update)) * SCAN_HZ))
        yield from _scanned(update, arena, clock, count, odometry)
        odometry = compose(odometry, compose(update.turn.measured, update.straight.measured))
        clock += count + (0 if update.kidnapped_to is None else round(CARRY_S * SCAN_HZ))


def _scanned(update: DriveUpdate, arena: Arena, clock: int, count: int, odometry: F64) -> Iterator[Segment]:
    """Yield the scans of an update that begins at a scan of the clock and at a pose of the odometry."""
    turn_s, straight_s = _turn_s(update), _straight_s(update)
    straight_at_s = clock / SCAN_HZ + turn_s
    happened = deque(_happened(update, arena, straight_at_s, straight_at_s + straight_s))
    for number in range(1, count + 1):
        t_s, is_last = (clock + number) / SCAN_HZ, number == count
        after_s = math.inf if is_last else number / SCAN_HZ
        turned, driven = _share(after_s, turn_s), _share(after_s - turn_s, straight_s)
        pose = update.straight.at(driven) if turned == 1 else update.turn.at(turned)
        moved = compose(turned * update.turn.measured, driven * update.straight.measured)
        notes = list[Note]()
        while happened and (is_last or happened[0].t_s <= t_s):
            note = happened.popleft()
            notes.append(replace(note, t_s=min(t_s, note.t_s)))
        measured = OdometryPose(t_s, compose(odometry, moved))
        yield Segment((*notes, measured), t_s, pose, is_last, update.kidnapped_to if is_last else None)


def _share(after_s: float, whole_s: float) -> float:
    """Return how much of a movement is done after a time, from 0 to 1."""
    return min(max(after_s / whole_s, 0.0), 1.0) if whole_s > 0 else 1.0


def _turn_s(update: DriveUpdate) -> float:
    return abs(float(update.turn.measured[2])) / TURN_RAD_S


def _straight_s(update: DriveUpdate) -> float:
    return abs(float(update.straight.measured[0])) / DRIVE_M_S


def _happened(update: DriveUpdate, arena: Arena, begun_s: float, driven_s: float) -> list[Note]:
    """Return what happens on the straight of an update, which begins and is over at these times."""
    straight, took = update.straight, _straight_s(update)
    changes = crossings(straight.path, arena)
    happened = [Note(begun_s + share * took, f"floor {name}".strip()) for share, name in changes]
    if straight.slipped_rad:
        slip = f"slip {np.degrees(straight.slipped_rad):+.1f} deg"
        happened.insert(1, Note(happened[0].t_s, slip))
    if straight.spun_m:
        happened.append(Note(driven_s, f"slip {straight.spun_m / INCH_M:.1f} in ahead: the wheels spin"))
    if straight.bumped:
        happened.append(Note(driven_s, "bump"))
    return happened


def crossings(path: F64, arena: Arena) -> list[tuple[float, str]]:
    """Return how far along a path (K, 3) the floor changes, as a share of it, and to which floor."""
    names = [floor_at(arena, float(x), float(y)) for x, y, _ in path]
    return [(k / (len(names) - 1), names[k]) for k in range(1, len(names)) if names[k] != names[k - 1]]
