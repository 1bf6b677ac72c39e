"""Calibration trials from a session log with truth: what each movement did, by the poses around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.calibrate import Trials
from maurice_mcl.calibrate_legs import Leg, trials_of
from maurice_mcl.motion import MauriceParameters
from maurice_mcl.typing import F64

from .errors import LogError
from .findings import Findings
from .log_records import Event, Odometry, Truth, read_header, read_records
from .odometry_folder import Cutting
from .truth import is_kidnapping

MISHAPS = ("slip", "bump")  # events of movements that no constant explains
SAMPLES = 9  # points of a way at which the floor is looked up


def trials_from_session(path: Path) -> Trials:
    """Read a session's movements and truth. LogError for what is no session, or has no truth."""
    info, kind = read_header(path)
    if kind != "session":
        raise LogError(path, f"found a {kind} log, expected a session log with odometry and truth", 1)
    reader = _Legs(path)
    trials = trials_of(reader, lambda a, b: floor_between(info.arena, a, b))
    trials = replace(trials, left_out=trials.left_out + reader.bent)
    if reader.truths < 2:
        found = "no truth" if not reader.truths else "one truth"
        raise LogError(path, f"found {found}, expected truth records before and after the movements")
    return trials


class _Legs:
    """The legs of a log: the movements between truths, with the first truth after each movement.

    The first, because odometry covers the time since the odometry record before: later truths may already
    be on the next way. Nothing is joined across a kidnapping.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.truths = 0  # seen so far ...
        self.bent = 0  # ... and movements left out because they are arcs

    def __iter__(self) -> Iterator[Leg]:
        self.truths = self.bent = 0
        before: F64 | None = None
        motions: list[F64] = []
        for record in read_records(self._path, "session", Findings(keep_going=False)):
            if isinstance(record, Odometry):
                motions.append(record.motion)
            elif is_kidnapping(record):
                before, motions = None, []
            elif isinstance(record, Truth):
                self.truths += 1
                if before is not None and motions:
                    leg = plain(Leg(before, tuple(motions), record.pose))
                    self.bent += 0 if leg else len(motions)
                    yield from (leg,) if leg else ()
                if before is None or motions:
                    before, motions = record.pose, []


def mishaps(path: Path) -> dict[str, int]:
    """Count what a session log tells of slips and bumps: events that begin with these words."""
    found = dict.fromkeys(MISHAPS, 0)
    for record in read_records(path, "session", Findings(keep_going=False)):
        if isinstance(record, Event) and (word := record.text.split(" ")[0]) in found:
            found[word] += 1
    return found


def plain(leg: Leg) -> Leg | None:
    """Give a leg whose movements are turns or straights and never both; None for arcs.

    A movement by itself that is nearly a turn counts as one, and one that is nearly a straight as a straight
    that drifted by what its odometry did not see. What an arc did cannot be told apart.
    """
    least, limits = MauriceParameters(), Cutting()
    way_m, turn = float(np.hypot(*leg.motions[0][:2])), float(leg.motions[0][2])
    both = [
        np.hypot(*m[:2]) >= least.straight_from_m and abs(m[2]) >= least.turn_from_rad for m in leg.motions
    ]
    if not any(both):
        return leg
    if len(both) > 1 or (way_m >= limits.least_m) == (abs(turn) >= limits.least_rad):
        return None
    if way_m >= limits.least_m:
        return Leg(leg.before, (leg.motions[0] * [1, 1, 0],), leg.after - [0, 0, turn])
    return Leg(leg.before, (np.array([0, 0, turn]),), leg.after)


def floor_between(arena: Arena | None, start: F64, end: F64) -> str | None:
    """Name the floor of a straight way between two points (2,); "" without one, None across several."""
    if arena is None:
        return ""
    names = {floor_at(arena, point) for point in np.linspace(start, end, SAMPLES)}
    return names.pop() if len(names) == 1 else None


def floor_at(arena: Arena, point: F64) -> str:
    """Name the topmost floor at a point (2,); "" where there is none."""
    x, y = (float(v) for v in point)
    for floor in reversed(arena.floors):
        if cv2.pointPolygonTest(floor.polygon.astype(np.float32), (x, y), False) >= 0:
            return floor.name
    return ""
