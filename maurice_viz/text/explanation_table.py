"""An explanation as a table and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from maurice_mcl.reasons.explanation import (
    TRUTH,
    WINNER,
    EntryExplanation,
    Explained,
    PoseOffset,
    StepExplanation,
    offset,
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
    return markdown_table(["", *(_head(explained) for explained in step.shown)], rows)


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


def _head(explained: Explained) -> str:
    entry = NONE if explained.entry is None else explained.entry.entry
    return f"{REFERENCES[explained.who].label}: {entry}"


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
    weighed = shown.weighed if shown.weighed is not None and math.isfinite(shown.weighed) else None
    return {
        "who": shown.who,
        "pose": shown.pose.tolist(),
        "particle_log_likelihood": weighed,  # null outside free space
        "from_truth": None if shown.from_truth is None else _offset(shown.from_truth),
        "from_estimate": _offset(shown.from_estimate),
        "reference": None if shown.entry is None else _entry(shown.entry, winner),
    }


def _offset(offset: PoseOffset) -> dict[str, float]:
    return {"apart_m": offset.apart_m, "turned_rad": offset.turned_rad}


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
