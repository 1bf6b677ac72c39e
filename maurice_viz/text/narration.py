"""What happened, in words and in the session's units: Markdown for the text panel."""

from __future__ import annotations

import math

import numpy as np

from maurice_mcl.filter.estimate import weighted_mean
from maurice_mcl.filter.localizer import ALL_ZERO, EXPANDED, GUIDED, LEFT_MAP, NO_NUMBER, RESAMPLED
from maurice_mcl.reasons.explanation import offset
from maurice_mcl.scoring.events import say_recovery_test
from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.records import Estimate, StepRecord
from maurice_mcl.values.session import Moment

from ..entities import PHASES_PER_STEP, Phase
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


NOT_THERE = {
    Phase.MEASURE: "What the localizer measured, and what it compared that with, is not in the bag.",
    Phase.RESAMPLE: "Whether it was resampled, and which particle came from which, is not in the bag.",
    Phase.RESEED: "Whether particles were drawn anew is not in the bag.",
}


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


def _recorded_phase(record: StepRecord, slot: Phase, scale: Scale) -> str:
    if slot is Phase.PREDICT:
        before = "The cloud before the sensor is not in the bag; shown is the published one."
        return f"{moved(record, scale)}{before}"
    if slot is Phase.WEIGHT:
        return f"{cloud(record, scale)} It was published after resampling, as AMCL and Beluga do."
    return NOT_THERE[slot]


NOT_COMPARED = "What the picture was compared with is not available."  # of some saved runs
LEAST_SHARE = 0.01  # share of the particles; a smaller group is left out
ALL_ROUND_RAD = np.pi / 2  # a larger circular deviation is about no single heading


def predicted(record: StepRecord, scale: Scale) -> str:
    """Describe how the cloud moved."""
    cloud = weighted_mean(record.predicted)
    turned = f"{np.degrees(cloud.heading_sd_rad):.0f} deg"
    turned = turned if cloud.heading_sd_rad < ALL_ROUND_RAD else "every heading"
    toward = ", some toward the pose that a sensor proposes" if GUIDED in record.events else ""
    return (
        f"Odometry says {motion(record.frame.motions, scale)}. Every particle moved so, with its own noise"
        f"{toward}; the cloud now spreads over {spread(cloud, scale)} and {turned}."
    )


def measured(record: StepRecord) -> str:
    """Describe what the picture was compared with, and what matched best."""
    sighting = record.sighting.comparison
    if not len(sighting.quality):
        return NOT_COMPARED
    first, *others = sighting.best(2).tolist()
    by = [*sighting.channels, *(sensed.name for sensed in sighting.sensed)]
    if not by:
        return NOT_COMPARED
    against = f"{len(sighting.quality)} references by {' and '.join(by)}"
    runner_up = f", then entry {others[0]} ({sighting.quality[others[0]]:.3f})" if others else ""
    what = "picture" if sighting.channels else "frame"
    return (
        f"The {what} was compared with {against}: entry {first} matches best, "
        f"quality {sighting.quality[first]:.3f}{runner_up}."
    )


def weighted(record: StepRecord, scale: Scale) -> str:
    """Describe the new weights: who gained, who lost, and what they were compared with."""
    if NO_NUMBER in record.events:
        return "**Likelihoods are no numbers: all weights zero.** A channel or the library holds NaN."
    if ALL_ZERO in record.events:
        return "**No particle is in free space: all weights zero.** They cannot be updated."
    if LEFT_MAP in record.events:
        return (
            f"**Every particle drove out of free space.** The cloud stays where it was. {effective(record)}"
        )
    log_weights = record.weighted.log_weights
    heaviest = np.exp(log_weights.max()) * len(log_weights)
    return (
        f"Each particle was weighed by how well the references around it match; the heaviest has "
        f"{heaviest:.1f} times the average weight. {gains(record, scale)}{effective(record)}"
    )


def gains(record: StepRecord, scale: Scale) -> str:
    """Describe where particles more than doubled their weight, and where they lost more than half."""
    before, after = record.predicted.log_weights, record.weighted.log_weights
    gain = np.subtract(after, before, out=np.zeros_like(after), where=np.isfinite(before))
    winners = _group(record, gain > np.log(2), scale)
    losers = _group(record, gain < -np.log(2), scale)
    groups = [f"{winners} more than doubled their weight"] if winners else []
    groups += [f"{losers} lost more than half of theirs"] if losers else []
    return f"{_capital('; '.join(groups))}. " if groups else ""


def _group(record: StepRecord, members: Bool, scale: Scale) -> str:
    """Describe these particles (N,): how many, where, and which entry most were compared with."""
    count = int(members.sum())
    if count < LEAST_SHARE * record.weighted.size:
        return ""
    cloud, sighting = record.weighted, record.sighting
    center = cloud.poses[members, :2].mean(axis=0, dtype=np.float64) + cloud.origin
    entries = sighting.entries[members]
    known = np.bincount(entries[entries >= 0], minlength=1)
    x, y = (f"{scale.length(float(v)):.{scale.units.digits}f}" for v in center)
    some = f"{count} particle{'s' if count > 1 else ''}"
    text = f"{some} about ({x}, {y}) {scale.units.name}"
    if not len(sighting.comparison.quality) or not known.any():
        return text
    entry = int(known.argmax())
    return f"{text}, most of them compared with entry {entry} ({sighting.comparison.quality[entry]:.3f}),"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def resampled(record: StepRecord) -> str:
    """Describe the resampling step."""
    if record.parents is None:
        return "Not resampled: the particles and their weights stay as they are."
    copies = np.bincount(record.parents[record.parents >= 0], minlength=1)
    return (
        f"Resampled: {np.count_nonzero(copies)} of {record.weighted.size} particles survive, "
        f"at most in {copies.max()} copies. All weights are equal again."
    )


def reseeded(record: StepRecord) -> str:
    """Describe what recovery compared, and how many particles were drawn anew."""
    test = record.recovery_test
    why = f": {say_recovery_test(test)}" if test else ""
    if EXPANDED in record.events:
        return f"Expanded{why}. Every particle was moved at random."
    if record.injected is None:
        return f"Not reseeded{why}."
    fresh = f"**{int(record.injected.sum())} fresh** of {record.belief.size} particles."
    if test:
        return f"Reseeded{why}: {fresh}"
    what = "picture" if record.sighting.comparison.channels else "frame"
    if not np.isfinite(record.calibrated_evidence):
        return f"Reseeded: {fresh} No particle was in free space, so that none explained this {what}."
    return f"Reseeded: {fresh} The cloud explained this {what} with {record.calibrated_evidence:.1f} nats."


def phase(moment: Moment, record: StepRecord, slot: Phase, scale: Scale) -> str:
    """Return what one phase of an update did: a heading and a sentence or two."""
    describe = {
        Phase.PREDICT: lambda: predicted(record, scale),
        Phase.MEASURE: lambda: measured(record),
        Phase.WEIGHT: lambda: weighted(record, scale),
        Phase.RESAMPLE: lambda: resampled(record),
        Phase.RESEED: lambda: reseeded(record),
    }
    title = f"Phase {slot + 1} of {PHASES_PER_STEP}: {slot.name.lower()}"
    text = _recorded_phase(record, slot, scale) if _is_recorded(record) else describe[slot]()
    return f"**{_when(moment)} · {title}**\n\n{text}"


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
