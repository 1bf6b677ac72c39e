"""What happened, in plain words and in the session's own units. Markdown, for the text panel."""

from __future__ import annotations

import numpy as np

from maurice_mcl.geometry import circular_mean
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment
from maurice_mcl.typing import Bool

from . import narrate_recorded
from .entities import SLOTS, Slot
from .look import Scale
from .narrate_parts import effective, estimated, motion, spread_m

NOT_COMPARED = "What the picture was compared with is not at hand."  # of some saved runs
LEAST_TOLD = 0.01  # a group of fewer particles is not told of
ALL_ROUND_RAD = np.pi / 2  # a larger circular deviation is no longer about any one heading


def predicted(record: StepRecord, scale: Scale) -> str:
    """Say how the cloud moved."""
    cloud = record.predicted
    _, heading = circular_mean(cloud.poses[:, 2], cloud.weights)
    turned = f"{np.degrees(heading):.0f} deg" if heading < ALL_ROUND_RAD else "every heading"
    return (
        f"The robot {motion(record.frame.motions, scale)}. Every particle did the same, with its own noise; "
        f"the cloud now spreads over {scale.say(spread_m(cloud))} and {turned}."
    )


def measured(record: StepRecord) -> str:
    """Say what the picture was compared with, and what matched best."""
    sighting = record.sighting.comparison
    if not len(sighting.quality):
        return NOT_COMPARED
    first, *others = sighting.best(2).tolist()
    against = f"{len(sighting.quality)} references by {' and '.join(sighting.channels)}"
    runner_up = f", then entry {others[0]} ({sighting.quality[others[0]]:.3f})" if others else ""
    return (
        f"The picture was compared with {against}: entry {first} matches best, "
        f"quality {sighting.quality[first]:.3f}{runner_up}."
    )


def weighted(record: StepRecord, scale: Scale) -> str:
    """Say how the picture's weights fell: who gained, who lost, and what they were compared with."""
    if "all weights zero" in record.events:
        return "No particle is where the picture could be from: all weights zero, so the old ones stay."
    log_weights = record.weighted.log_weights
    heaviest = np.exp(log_weights.max()) * len(log_weights)
    return (
        f"Each particle was weighed by how well the references about it match; the heaviest has "
        f"{heaviest:.1f} times the average weight. {gains(record, scale)}{effective(record)}"
    )


def gains(record: StepRecord, scale: Scale) -> str:
    """Say where those stand whose weight more than doubled, and those whose weight fell under a half."""
    gain = record.weighted.log_weights - record.predicted.log_weights
    winners = _group(record, gain > np.log(2), scale)
    losers = _group(record, gain < -np.log(2), scale)
    told = [f"{winners} more than doubled their weight"] if winners else []
    told += [f"{losers} lost more than half of theirs"] if losers else []
    return f"{_capital('; '.join(told))}. " if told else ""


def _group(record: StepRecord, members: Bool, scale: Scale) -> str:
    """Say how many particles (N,) these are, where they are and which entry most were compared with."""
    count = int(members.sum())
    if count < LEAST_TOLD * record.weighted.size:
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
    """Say who survived."""
    if record.parents is None:
        return "Not resampled: the particles and their weights stay as they are."
    copies = np.bincount(record.parents[record.parents >= 0], minlength=1)
    return (
        f"Resampled: {np.count_nonzero(copies)} of {record.weighted.size} particles survive, "
        f"the luckiest in {copies.max()} copies. All weights are equal again."
    )


def reseeded(record: StepRecord) -> str:
    """Say how many particles were drawn anew, and why."""
    if "expanded" in record.events:
        return "Expanded: the picture was explained badly, so every particle was moved at random."
    if record.injected is None:
        return "Not reseeded."
    drawn = f"Reseeded: {int(record.injected.sum())} of {record.belief.size} particles were drawn afresh."
    if not np.isfinite(record.calibrated_evidence):
        return f"{drawn} No particle was in free space, so that none explained this picture."
    return f"{drawn} The cloud explained this picture with {record.calibrated_evidence:.1f} nats."


def phase(moment: Moment, record: StepRecord, slot: Slot, scale: Scale) -> str:
    """Say what one phase of an update did: a heading and a sentence or two."""
    says = {
        Slot.PREDICT: lambda: predicted(record, scale),
        Slot.MEASURE: lambda: measured(record),
        Slot.WEIGHT: lambda: weighted(record, scale),
        Slot.RESAMPLE: lambda: resampled(record),
        Slot.RESEED: lambda: reseeded(record),
    }
    title = f"Phase {slot + 1} of {SLOTS}: {slot.name.lower()}"
    recorded = narrate_recorded.is_recorded(record)
    said = narrate_recorded.phase(record, slot, scale) if recorded else says[slot]()
    return f"**{_when(moment)} · {title}**\n\n{said}"


def summary(moment: Moment, record: StepRecord, scale: Scale) -> str:
    """Say what a whole step did, for the last phase and for timelines without phases."""
    events = [*moment.events, *(event for event in record.events if event != "resampled")]
    title = f"**{_when(moment)}**" + "".join(f" · {event}" for event in events)
    if narrate_recorded.is_recorded(record):
        return "\n\n".join([title, *narrate_recorded.summary(record, moment.truth, scale)])
    return "\n\n".join([title, estimated(record, moment.truth, scale), _done(record, scale)])


def _done(record: StepRecord, scale: Scale) -> str:
    """Say how the robot moved, what matched, how many particles count, and what became of them."""
    seen = record.sighting.comparison
    first = int(seen.quality.argmax()) if len(seen.quality) else None
    match = (
        NOT_COMPARED if first is None else f"Best match: entry {first}, quality {seen.quality[first]:.3f}."
    )
    kept = "Resampled." if record.parents is not None else "Not resampled."
    if record.injected is not None:
        kept = f"{kept} {int(record.injected.sum())} particles drawn afresh."
    return f"The robot {motion(record.frame.motions, scale)}. {match} {effective(record)} {kept}"


def _when(moment: Moment) -> str:
    return f"Step {moment.frame.step} · {moment.frame.time_s:.1f} s"
