"""What happened at a step, in words: the whole step, and one phase of it in two plain sentences.

In the words on phases, the headlines of inside-a-step, a particle is a "dot", as on the first screen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from maurice_mcl.filter.localizer import ALL_ZERO, EXPANDED, GUIDED, LEFT_MAP, NO_NUMBER, RESAMPLED
from maurice_mcl.filter.recovery import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.explanation import offset
from maurice_mcl.scoring.events import say_recovery_test
from maurice_mcl.values import F64, Belief, Estimate, Moment, StepRecord

from ..entities import Phase
from ..style import Scale, capital

STILL_RAD = math.radians(0.5)  # a turn that would be written "0 deg" is not mentioned


def motion(motions: F64, scale: Scale) -> str:
    """Return what odometry measured: "18.0 in forward and a turn of 45 deg left (2 movements)"."""
    forward, left, turn = motions.sum(axis=0).tolist()
    parts = []
    if _shows(forward, scale):
        parts.append(f"{scale.say(abs(forward))} {'forward' if forward > 0 else 'backward'}")
    if _shows(left, scale):
        parts.append(f"{scale.say(abs(left))} to the {'left' if left > 0 else 'right'}")
    if abs(turn) > STILL_RAD:
        parts.append(f"a turn of {math.degrees(abs(turn)):.0f} deg {'left' if turn > 0 else 'right'}")
    count = f" ({len(motions)} movements)" if len(motions) > 1 else ""
    return (" and ".join(parts) or "no movement") + count


def _shows(length_m: float, scale: Scale) -> bool:
    return round(abs(scale.length(length_m)), scale.units.digits) > 0


def spread(cloud: Estimate, scale: Scale) -> str:
    """Return the radial standard deviation of a whole cloud with its unit."""
    return scale.say(math.hypot(*cloud.sd_m))


def spread_of(belief: Belief, scale: Scale) -> str:
    """Return the same of particles."""
    xy, weights = belief.poses[:, :2].astype(np.float64), belief.weights
    xy -= weights @ xy
    return scale.say(math.sqrt((weights @ np.square(xy)).sum()))


def effective(record: StepRecord) -> str:
    """Return the effective sample size as a sentence."""
    size = record.weighted.size
    share = record.effective_sample_size / size
    return f"Effective sample size {record.effective_sample_size:.0f} of {size} ({share:.0%})."


def say_estimate(record: StepRecord, truth: F64 | None, scale: Scale) -> str:
    """Return the estimate, the weight near it and its error as a sentence."""
    estimate = record.estimate
    near = f"{estimate.confidence:.0%} of the weight within {scale.say(estimate.radii.confidence_m)}"
    text = f"Estimate {scale.say_pose(estimate.pose)}; {near}"
    if truth is None:
        return f"{text} (truth not known)."
    off = offset(estimate.pose, truth)
    return f"{text}; **error {scale.say(off.apart_m)}, {np.degrees(off.turned_rad):.0f} deg**."


def cloud(record: StepRecord, scale: Scale) -> str:
    """Describe the published cloud."""
    width = spread_of(record.weighted, scale)
    return f"The published cloud spreads over {width}. {effective(record)}"


def moved(record: StepRecord, scale: Scale) -> str:
    """Describe the motion if there is odometry; else empty."""
    motions = record.frame.motions
    return f"Odometry says {motion(motions, scale)}. " if len(motions) else ""


NOT_COMPARED = "What the picture was compared with is not available."  # of some saved runs


def summary(moment: Moment, record: StepRecord, scale: Scale) -> str:
    """Return what a step did, for the last phase and for timelines without phases."""
    events = [*moment.events, *(event for event in record.events if event != RESAMPLED)]
    title = f"**Step {moment.frame.step} · {moment.frame.time_s:.1f} s**"
    title += "".join(f" · {event}" for event in events)
    is_recorded = bool(np.isnan(record.log_evidence))
    rest = f"{moved(record, scale)}{cloud(record, scale)}" if is_recorded else _done(record, scale)
    return "\n\n".join([title, say_estimate(record, moment.truth, scale), rest])


def _done(record: StepRecord, scale: Scale) -> str:
    seen = record.sighting.comparison
    first = int(seen.quality.argmax()) if len(seen.quality) else None
    match = (
        NOT_COMPARED if first is None else f"Best match: entry {first}, quality {seen.quality[first]:.3f}."
    )
    resampling = "Resampled." if record.parents is not None else "Not resampled."
    if record.injected is not None:
        test = record.recovery_test
        why = f"{capital(say_recovery_test(test))}: " if test else ""
        resampling = f"{resampling} {why}**{int(record.injected.sum())} fresh** particles."
    return f"Odometry says {motion(record.frame.motions, scale)}. {match} {effective(record)} {resampling}"


# What one phase did.

# what each phase does, below its name in the strip
DOES = {
    Phase.PREDICT: "move every dot",
    Phase.MEASURE: "compare pictures",
    Phase.WEIGHT: "weigh every dot",
    Phase.RESAMPLE: "copy heavy, drop light",
    Phase.RESEED: "add new dots if lost",
    Phase.ESTIMATE: "one answer",
}
NO_BEST = "no dot moves"  # where no reference is compared
LIGHT = 0.5  # times the average weight
HALF = 0.5 - 1e-9  # of all weight
NOTHING_WEIGHED = {
    NO_NUMBER: "The likelihoods are no numbers: a channel or the library holds NaN.",
    ALL_ZERO: "No dot is in free space, so that none can be weighed.",
    LEFT_MAP: "Every dot drove out of free space: the cloud stays where it was.",
}


def phase_words(
    moment: Moment,
    record: StepRecord,
    phase: Phase,
    scale: Scale,
    draws_new: str | None = None,
    taken_at: F64 | None = None,
) -> str:
    """Return two sentences about a phase, after its step and its name.

    `draws_new` is the run's; `taken_at` (3,) where the best reference was taken, if it is known.
    """
    sentences = {
        Phase.PREDICT: lambda: predicted(record, scale),
        Phase.MEASURE: lambda: measured(moment, record, scale, taken_at),
        Phase.WEIGHT: lambda: weighted(record),
        Phase.RESAMPLE: lambda: resampled(record),
        Phase.RESEED: lambda: reseeded(record, draws_new),
        Phase.ESTIMATE: lambda: estimated(moment, record, scale),
    }
    return f"Step {moment.frame.step}, {phase + 1} {phase.name.lower()}: {sentences[phase]()}"


def whole_step(moment: Moment, record: StepRecord, scale: Scale) -> str:
    """Return two sentences about a whole update, for timelines without phases."""
    survive = f"{_survivors(record):,} survive" if record.parents is not None else "all stay"
    fresh = "" if record.injected is None else f", {int(record.injected.sum()):,} are new"
    moved, size = motion(record.frame.motions, scale), record.weighted.size
    return (
        f"Step {moment.frame.step}, left: odometry says {moved}. Right: the picture weighs {size:,} dots, "
        f"{survive}{fresh}. {_answer(moment, record, scale)}"
    )


def of_scans(text: str) -> str:
    """Return words about pictures as they are said of a robot that has a laser alone."""
    return text.replace("frame is compared by laser", "scan is compared with the map").replace(
        "picture", "scan"
    )


def predicted(record: StepRecord, scale: Scale) -> str:
    """Describe how the cloud moved."""
    toward = ", some toward where a sensor sees the robot" if GUIDED in record.events else ""
    wide = spread_of(record.predicted, scale)
    return (
        f"odometry says {motion(record.frame.motions, scale)}, and every dot moves so, with an error of its "
        f"own{toward}. The cloud now spreads over {wide}: nothing has been seen yet."
    )


def listed(parts: Sequence[str]) -> str:
    """Write "a, b and c"."""
    return " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)


def measured(moment: Moment, record: StepRecord, scale: Scale, taken_at: F64 | None = None) -> str:
    """Describe what the picture was compared with, and how far from the truth the best match was taken."""
    seen = record.sighting.comparison
    by = [*seen.channels, *(part.name for part in seen.read)]
    if not by:
        return NOT_COMPARED
    count = len(seen.quality)
    many = f" with {count:,} references" if count else ""
    text = f"the {'picture' if seen.channels else 'frame'} is compared{many} by {listed(by)}."
    if moment.truth is None or taken_at is None:
        return f"{text} No dot moves."
    away = scale.say(float(np.hypot(*(taken_at - moment.truth)[:2])))
    return f"{text} The best match was taken {away} from the truth. No dot moves."


def weighted(record: StepRecord) -> str:
    """Describe the new weights: how few hold how much, and what that leaves of the cloud."""
    for event, text in NOTHING_WEIGHED.items():
        if event in record.events:
            return text
    size, weights = record.weighted.size, record.weighted.weights
    times = weights * size
    return (
        f"{heaviest_half(weights):,} of {size:,} dots now hold half of the weight; "
        f"{int((times < LIGHT).sum()):,} weigh less than half the average. The heaviest weighs "
        f"{times.max():.1f} times the average; the cloud is worth {_worth(record)} equal dots."
    )


def heaviest_half(weights: F64) -> int:
    """Return how many of the heaviest particles hold half of all weight (N,)."""
    return int((np.cumsum(np.sort(weights)[::-1]) < HALF).sum()) + 1


def _worth(record: StepRecord) -> str:
    return f"{record.effective_sample_size:,.0f}"


def _survivors(record: StepRecord) -> int:
    if record.parents is None:
        return record.weighted.size
    return int(np.count_nonzero(np.bincount(record.parents[record.parents >= 0])))


def resampled(record: StepRecord) -> str:
    """Describe how weight became number."""
    size = record.weighted.size
    if record.parents is None:
        worth = f"{_worth(record)} of {size:,} equal dots"
        return f"not resampled, as the cloud is worth {worth}. All keep their weights."
    counts = np.bincount(record.parents[record.parents >= 0], minlength=1)
    alive, most = int(np.count_nonzero(counts)), int(counts.max())
    copies = f"{most:,} {'copy' if most == 1 else 'copies'}"
    return (
        f"{alive:,} of {size:,} dots survive, the heaviest with {copies}; "
        f"{size - alive:,} die. All weigh the same again: weight has become number."
    )


def reseeded(record: StepRecord, draws_new: str | None = None) -> str:
    """Describe how many particles were drawn anew, or why none."""
    if EXPANDED in record.events:
        return "the picture fits the cloud badly, so that every dot is moved at random. None is new."
    if record.injected is not None:
        fresh, size = int(record.injected.sum()), record.belief.size
        where = "where they may be right" if draws_new is None else DRAWN.get(draws_new, "")
        return f"{fresh:,} of {size:,} dots are new (pink), drawn {where}. The picture fits the others badly."
    if draws_new == DRAWS_NEVER:
        return "no new dots: this filter never draws any. Once lost, only luck brings it back."
    return (
        "no new dots: the cloud explains the picture well enough. Dots are drawn anew only when it does not."
    )


DRAWN = {DRAWS_EVENLY: "anywhere on the map", DRAWS_WHERE_LIKELY: "where the picture fits"}


def estimated(moment: Moment, record: StepRecord, scale: Scale) -> str:
    """Describe the answer."""
    answer = _answer(moment, record, scale)
    return f"{answer[:1].lower()}{answer[1:]} The oval holds most of that group's dots."


def _answer(moment: Moment, record: StepRecord, scale: Scale) -> str:
    estimate = record.estimate
    text = f"the heaviest group, with {estimate.mass:.0%} of the weight, says {scale.say_pose(estimate.pose)}"
    if moment.truth is None:
        return f"{capital(text)}."
    off = offset(estimate.pose, moment.truth)
    text = f"{text}: {scale.say(off.apart_m)} and {np.degrees(off.turned_rad):.0f} deg off the truth."
    return capital(text)
