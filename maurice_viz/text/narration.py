"""What happened, in words and in the session's units: Markdown for the text panel."""

from __future__ import annotations

import math

import numpy as np

from maurice_mcl.filter.estimate import weighted_mean
from maurice_mcl.filter.localizer import RESAMPLED
from maurice_mcl.reasons.explanation import offset
from maurice_mcl.scoring.events import say_recovery_test
from maurice_mcl.values import F64, Estimate, Moment, StepRecord

from ..style import Scale

STILL_RAD = np.radians(0.5)  # a turn that would be written "0 deg" is not mentioned


def motion(motions: F64, scale: Scale) -> str:
    """Return what odometry measured: "18.0 in forward and a turn of 45 deg left (2 movements)"."""
    forward, left, turn = motions.sum(axis=0) if len(motions) else np.zeros(3)
    parts = []
    if _shows(forward, scale):
        parts.append(f"{scale.say(abs(forward))} {'forward' if forward > 0 else 'backward'}")
    if _shows(left, scale):
        parts.append(f"{scale.say(abs(left))} to the {'left' if left > 0 else 'right'}")
    if abs(turn) > STILL_RAD:
        parts.append(f"a turn of {np.degrees(abs(turn)):.0f} deg {'left' if turn > 0 else 'right'}")
    count = f" ({len(motions)} movements)" if len(motions) > 1 else ""
    return (" and ".join(parts) or "no movement") + count


def _shows(length_m: float, scale: Scale) -> bool:
    return round(abs(scale.length(length_m)), scale.units.digits) > 0


def spread(cloud: Estimate, scale: Scale) -> str:
    """Return the radial standard deviation of a whole cloud with its unit."""
    return scale.say(math.hypot(*cloud.sd_m))


def effective(record: StepRecord) -> str:
    """Return the effective sample size as a sentence."""
    size = record.weighted.size
    share = record.effective_sample_size / size
    return f"Effective sample size {record.effective_sample_size:.0f} of {size} ({share:.0%})."


def estimated(record: StepRecord, truth: F64 | None, scale: Scale) -> str:
    """Return the estimate, its confidence and its error as a sentence."""
    estimate = record.estimate
    text = f"Estimate {scale.say_pose(estimate.pose)}; confidence {estimate.confidence:.0%}"
    if truth is None:
        return f"{text} (truth not known)."
    off = offset(estimate.pose, truth)
    return f"{text}; **error {scale.say(off.apart_m)}, {np.degrees(off.turned_rad):.0f} deg**."


def _is_recorded(record: StepRecord) -> bool:
    return bool(np.isnan(record.log_evidence))


def cloud(record: StepRecord, scale: Scale) -> str:
    """Describe the published cloud."""
    width = spread(weighted_mean(record.weighted), scale)
    return f"The published cloud spreads over {width}. {effective(record)}"


def moved(record: StepRecord, scale: Scale) -> str:
    """Describe the motion if there is odometry; else empty."""
    motions = record.frame.motions
    return f"Odometry says {motion(motions, scale)}. " if len(motions) else ""


NOT_COMPARED = "What the picture was compared with is not available."  # of some saved runs


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def summary(moment: Moment, record: StepRecord, scale: Scale) -> str:
    """Return what a step did, for the last phase and for timelines without phases."""
    events = [*moment.events, *(event for event in record.events if event != RESAMPLED)]
    title = f"**{_when(moment)}**" + "".join(f" · {event}" for event in events)
    recorded = _is_recorded(record)
    rest = f"{moved(record, scale)}{cloud(record, scale)}" if recorded else _done(record, scale)
    return "\n\n".join([title, estimated(record, moment.truth, scale), rest])


def _done(record: StepRecord, scale: Scale) -> str:
    seen = record.sighting.comparison
    first = int(seen.quality.argmax()) if len(seen.quality) else None
    match = (
        NOT_COMPARED if first is None else f"Best match: entry {first}, quality {seen.quality[first]:.3f}."
    )
    kept = "Resampled." if record.parents is not None else "Not resampled."
    if record.injected is not None:
        test = record.recovery_test
        why = f"{_capital(say_recovery_test(test))}: " if test else ""
        kept = f"{kept} {why}**{int(record.injected.sum())} fresh** particles."
    return f"Odometry says {motion(record.frame.motions, scale)}. {match} {effective(record)} {kept}"


def _when(moment: Moment) -> str:
    return f"Step {moment.frame.step} · {moment.frame.time_s:.1f} s"
