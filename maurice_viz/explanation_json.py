"""An explanation as JSON, in metres, radians and nats."""

from __future__ import annotations

import math
from typing import Any

from maurice_mcl.explaining import ChannelExplanation, EntryExplanation, Explained, Offset, StepExplanation


def to_json(label: str, step: StepExplanation) -> dict[str, Any]:
    """Give `{"runs": [{"label": ..., "step": ..., "explained": [...]}]}`."""
    explained = [_explained(one, step.winner) for one in step.shown]
    return {"runs": [{"label": label, "step": step.step, "explained": explained}]}


def _explained(one: Explained, winner: EntryExplanation) -> dict[str, Any]:
    weighed = one.weighed if one.weighed is not None and math.isfinite(one.weighed) else None
    return {
        "who": one.who,
        "pose": one.pose.tolist(),
        "particle_log_likelihood": weighed,  # null outside free space
        "from_truth": None if one.from_truth is None else _offset(one.from_truth),
        "from_estimate": _offset(one.from_estimate),
        "reference": None if one.entry is None else _entry(one.entry, winner),
    }


def _offset(offset: Offset) -> dict[str, float]:
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
        "channels": {c.channel: _channel(c, behind) for c, behind in zip(entry.channels, lost, strict=True)},
    }


def _channel(channel: ChannelExplanation, behind: float) -> dict[str, Any]:
    return {
        "distance_by": channel.distance_by,
        "distance": channel.distance,
        "calibrated_cost": channel.calibrated,
        "quality": channel.quality,
        "rank": channel.rank,
        "loses": channel.loses,
        "behind_winner": behind,
    }
