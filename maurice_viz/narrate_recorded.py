"""What another localizer's recorded cloud shows, in plain words: only what a bag holds is told of."""

from __future__ import annotations

import numpy as np

from maurice_mcl.records import StepRecord
from maurice_mcl.typing import F64

from .entities import Slot
from .look import Scale
from .narrate_parts import effective, estimated, motion, spread_m

NOT_THERE = {
    Slot.MEASURE: "What the localizer measured, and what it compared that with, is not in the bag.",
    Slot.RESAMPLE: "Whether it was resampled, and which particle came from which, is not in the bag.",
    Slot.RESEED: "Whether particles were drawn afresh is not in the bag.",
}


def is_recorded(record: StepRecord) -> bool:
    """Tell whether a cloud is another localizer's: of those nobody knows the evidence."""
    return bool(np.isnan(record.log_evidence))


def cloud(record: StepRecord, scale: Scale) -> str:
    """Say how the published cloud looks."""
    return f"The published cloud spreads over {scale.say(spread_m(record.weighted))}. {effective(record)}"


def moved(record: StepRecord, scale: Scale) -> str:
    """Say how the robot moved, where odometry says so."""
    motions = record.frame.motions
    return f"The robot {motion(motions, scale)}. " if len(motions) else ""


def phase(record: StepRecord, slot: Slot, scale: Scale) -> str:
    """Say what is known of one phase of an update."""
    if slot is Slot.PREDICT:
        before = "The cloud before the sensor is not in the bag; shown is the published one."
        return f"{moved(record, scale)}{before}"
    if slot is Slot.WEIGHT:
        return f"{cloud(record, scale)} It was published after resampling, as AMCL and Beluga do."
    return NOT_THERE[slot]


def summary(record: StepRecord, truth: F64 | None, scale: Scale) -> list[str]:
    """Say what a whole update shows, a paragraph each."""
    return [estimated(record, truth, scale), f"{moved(record, scale)}{cloud(record, scale)}"]
