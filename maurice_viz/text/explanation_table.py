"""An explanation as a table and as JSON; what pose sensors read, in sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from maurice_mcl.reasons.explanation import (
    TRUTH,
    WINNER,
    EntryExplanation,
    Explained,
    StepExplanation,
    offset,
)
from maurice_mcl.sensor.landmarks.sensor import SHAPE_TOLERANCE, Landmarks
from maurice_mcl.sensor.verification import KEYPOINTS
from maurice_mcl.values import (
    F64,
    Arena,
    Frame,
    MovedThing,
    PoseSensor,
    Shown,
    StepRecord,
    plain_value,
)

from ..style import Scale
from .explanation import REFERENCES
from .summary import markdown_table

NONE = "outside free space"


def winner_first(step: StepExplanation) -> StepExplanation:
    """Return the same in the order of the columns that people see: the winner stands first."""
    shown = sorted(step.shown, key=lambda explained: explained.who != WINNER)
    return replace(step, shown=tuple(shown))


def brief_table(step: StepExplanation, scale: Scale) -> str:
    """Write the figures of an update's references side by side; of each channel nats and rank."""
    rows = [*_of_all(step, scale), *(_brief(step, k, name) for k, name in enumerate(step.channels))]
    if any(e.entry.verified for e in step.shown if e.entry is not None):
        rows.append(_row(step, f"**{KEYPOINTS}**", lambda e: f"{e.entry.verified:.2f}" if e.entry else ""))
    entries = [NONE if explained.entry is None else explained.entry.entry for explained in step.shown]
    heads = [f"{REFERENCES[e.who].label}: {entry}" for e, entry in zip(step.shown, entries, strict=True)]
    return markdown_table(["", *heads], rows)


def _brief(step: StepExplanation, number: int, name: str) -> tuple[str, ...]:
    def cell(explained: Explained) -> str:
        if explained.entry is None:
            return ""
        channel = explained.entry.channels[number]
        return f"{channel.loses:.2f} · {channel.rank}"

    return _row(step, f"**{name}** · rank", cell)


def _of_all(step: StepExplanation, scale: Scale) -> list[tuple[str, ...]]:
    """Return the rows of all channels together: a name, and one cell per reference."""
    rows = [_row(step, f"{scale.units.name}, deg", lambda e: _pose(e, scale))]
    if any(e.from_truth for e in step.shown):
        rows.append(_row(step, "from the truth", lambda e: _from_truth(e, step, scale)))
    rows += [
        _row(step, "rank · quality", lambda e: f"{e.entry.rank} · {e.entry.quality:.3f}" if e.entry else ""),
        _row(step, "nats lost", lambda e: f"{-e.entry.log_likelihood:.2f}" if e.entry else ""),
    ]
    if any(e.weighed is not None for e in step.shown):
        title = "particle there, nats"
        rows.append(_row(step, title, lambda e: "" if e.weighed is None else f"{e.weighed:.2f}"))
    return rows


def _row(step: StepExplanation, title: str, cell: Callable[[Explained], str]) -> tuple[str, ...]:
    return (title, *(cell(explained) for explained in step.shown))


def _pose(explained: Explained, scale: Scale) -> str:
    if explained.entry is None:
        return ""
    x_m, y_m, heading_rad = explained.entry.pose.tolist()
    digits = 2 * (scale.units.digits - 1)  # whole inches, or centimeters
    x, y = (f"{scale.length(place_m):.{digits}f}" for place_m in (x_m, y_m))
    return f"{x}, {y}, {math.degrees(heading_rad):.0f}"


def _from_truth(explained: Explained, step: StepExplanation, scale: Scale) -> str:
    truth = step.of(TRUTH)
    if truth is None or explained.entry is None:
        return ""
    off = offset(explained.entry.pose, truth.pose)
    return f"{scale.length(off.apart_m):.{scale.units.digits}f}, {math.degrees(off.turned_rad):.0f}"


def to_json(label: str, step: StepExplanation) -> dict[str, Any]:
    """Return `{"runs": [{"label": ..., "step": ..., "explained": [...]}]}`."""
    explained = [_explained(shown, step.winner) for shown in step.shown]
    return {"runs": [{"label": label, "step": step.step, "explained": explained}]}


def _explained(shown: Explained, winner: EntryExplanation) -> dict[str, Any]:
    return {
        "who": shown.who,
        "pose": shown.pose.tolist(),
        "particle_log_likelihood": plain_value(shown.weighed),  # null outside free space
        "from_truth": plain_value(shown.from_truth),
        "from_estimate": plain_value(shown.from_estimate),
        "reference": None if shown.entry is None else _entry(shown.entry, winner),
    }


def _entry(entry: EntryExplanation, winner: EntryExplanation) -> dict[str, Any]:
    lost = entry.lost_to(winner).tolist()
    return {
        "entry": entry.entry,
        "pose": entry.pose.tolist(),
        "rank": entry.rank,
        "of": entry.entries,
        "quality": entry.quality,
        "log_likelihood": entry.log_likelihood,
        "behind_winner": entry.behind,
        "verified": entry.verified,
        "channels": {
            c.channel: {
                "distance_by": c.distance_by,
                "distance": c.distance,
                "calibrated_cost": c.calibrated,
                "quality": c.quality,
                "rank": c.rank,
                "loses": c.loses,
                "behind_winner": behind,
            }
            for c, behind in zip(entry.channels, lost, strict=True)
        },
    }


# What pose sensors read, in the units that people read.

OUTLINE_M = 0.15  # as far from an obstacle a point is still on it
LEAST_SHARE = 0.5  # of the points of a thing, that have to be on an obstacle, so that it has its name


def say_shown(shown: Shown, arena: Arena, scale: Scale) -> str:
    """Return what a sensor says, and a sentence for each thing that moved."""
    return " ".join([shown.text(scale.say), *(say_moved(thing, arena, scale) for thing in shown.moved)])


def say_moved(moved: MovedThing, arena: Arena, scale: Scale) -> str:
    """Describe a thing: "9 others on the wardrobe agree with each other, 11.0 in from where ..."."""
    name = thing_at(moved.places, arena)
    where = f" on the {name}" if name else ""
    far = scale.say(float(np.hypot(*moved.shift_m)))
    return f"{len(moved.places)} others{where} agree with each other, {far} from where the library has them."


def thing_at(places: F64, arena: Arena) -> str | None:
    """Return the name of the obstacle that at least half of some places (K, 2) are on."""
    most, name = LEAST_SHARE, None
    for obstacle in arena.obstacles:
        share = float(np.mean(obstacle.depth_m(places) > -OUTLINE_M))
        if share >= most:
            most, name = share, obstacle.name
    return name


def say_sensors(record: StepRecord, truth: F64 | None, arena: Arena, scale: Scale) -> list[str]:
    """Return what the pose sensors of an update say, a paragraph each: "Landmarks: 14 of 60 ..."."""
    poses: Mapping[str, F64] = {"estimate": record.estimate.pose}
    poses = poses if truth is None else {**poses, "truth": truth}
    read = record.sighting.comparison.read
    return [f"{part.name.capitalize()}: {say_shown(part.shown(poses), arena, scale)}" for part in read]


def say_other_shape(frame: Frame, sensors: Iterable[PoseSensor]) -> str | None:
    """Return what to tell where landmarks cannot read a picture, as it is of another camera; else None."""
    height, width = frame.image.shape[:2]
    for sensor in sensors:
        if isinstance(sensor, Landmarks):
            camera = sensor.map.fit.camera
            difference = abs(width * camera.height_px - height * camera.width_px)
            if difference > SHAPE_TOLERANCE * camera.width_px * height:
                text = f"found pictures of {width} x {height}, and the landmarks are of pictures of "
                text += f"{camera.width_px} x {camera.height_px}: another shape, so landmarks say nothing"
                return f"{text}; build the library with this camera, or leave landmarks out"
    return None
