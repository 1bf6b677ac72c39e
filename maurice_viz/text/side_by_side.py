"""Runs side by side at one step, in words: who is closer, what each phase did to each cloud, and why.

A particle is a "dot", as in the words on phases of one run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.filter.localizer import EXPANDED
from maurice_mcl.filter.recovery import DRAWS_NEVER
from maurice_mcl.scoring.comparison import Step
from maurice_mcl.scoring.modes import LEAST_NEAR, picture_gain
from maurice_mcl.sensor.laser.sensor import LASER
from maurice_mcl.values import F64, Belief, Bool, Moment, Radii, StepRecord

from ..entities import Phase
from ..style import Scale, capital
from .comparison import errors_m, least_closer_m
from .explanation import ordinal
from .phases import DRAWN, NOTHING_WEIGHED, heaviest_half, listed, motion, spread, spread_of

NEAR_SHARES = (1 / 3, 1.0)  # of the radius `confidence`: near the truth, and if no dot is there
RECORDED = "a recorded run has its clouds alone"
FEW_RANKS = 3  # channels whose ranks are told; of more the first and the last


@dataclass(frozen=True, slots=True)
class BestMatch:
    """The reference that a run's sensors like best, of all in the library."""

    label: str
    entry: int
    pose: F64  # (3,) where it was taken, in the map's frame
    entries: int  # L
    ranks: Mapping[str, int]  # by each channel that a run of this drive has; 1 is the nearest
    used: tuple[str, ...]  # the channels of this run


def quoted(labels: Iterable[str]) -> str:
    """Write the names of runs: "`a` and `b`"."""
    return listed([f"`{label}`" for label in labels])


def step_words(steps: Mapping[str, Step], scale: Scale, radii: Radii, phase: Phase | None = None) -> str:
    """Return which run is closer to the truth at a step, or at a phase of it from `weight` on."""
    return f"{_head(steps, phase)} {_who(steps, scale, radii)}"


def _head(steps: Mapping[str, Step], phase: Phase | None) -> str:
    moment, _ = next(iter(steps.values()))
    place = "" if phase is None else f", {phase + 1} {phase.name.lower()}"
    return f"Step {moment.frame.step}{place}:"


def _who(steps: Mapping[str, Step], scale: Scale, radii: Radii) -> str:
    """Say who is closer; all numbers are those of the labels in the close-ups."""
    off = errors_m(steps)
    if len(off) < 2:
        return _apart(steps, scale)
    digits, unit = scale.units.digits, scale.units.name
    shown = {label: f"{scale.length(error):.{digits}f}" for label, error in off.items()}
    first, second, *_ = off
    tied = [label for label in off if off[label] - off[first] < least_closer_m(radii)]
    rest = "".join(f"; `{label}` {shown[label]} {unit}" for label in off if label not in tied)
    if len(tied) > 1:
        numbers = listed(list(dict.fromkeys(shown[label] for label in tied)))
        return f"{quoted(tied)} are about equally close, {numbers} {unit} off{rest}."
    if len(off) > 2:
        return f"`{first}` is closest, **{shown[first]} {unit} off**{rest}."
    gap = f"{float(shown[second]) - float(shown[first]):.{digits}f} {unit}"
    return f"`{first}` is **{gap} closer** than `{second}`: {shown[first]} and {shown[second]} {unit} off."


def _apart(steps: Mapping[str, Step], scale: Scale) -> str:
    places = np.array([record.estimate.pose[:2] for _, record in steps.values()])
    apart = float(np.hypot(*(places[:, None] - places).T).max())
    wide = [f"{spread(record.mean_estimate, scale)} with `{label}`" for label, (_, record) in steps.items()]
    return (
        f"the estimates are {'at most ' if len(steps) > 2 else ''}{scale.say(apart)} apart; the clouds "
        f"spread over {listed(wide)}. Who is closer is not known without truth."
    )


def phase_words(
    steps: Mapping[str, Step],
    phase: Phase,
    scale: Scale,
    radii: Radii,
    matches: Sequence[BestMatch],
    draws_new: Mapping[str, str | None],
) -> str:
    """Return what a phase did to each run's cloud, after its step and its name.

    `draws_new` says of each run where it draws new dots.
    """
    known = {label: step for label, step in steps.items() if not is_recorded(step[1])}
    if phase is Phase.ESTIMATE or not known:
        return step_words(steps, scale, radii, phase)
    sentences: Mapping[Phase, Callable[[], str]] = {
        Phase.PREDICT: lambda: _predicted(known, scale),
        Phase.MEASURE: lambda: _measured(known, matches, scale),
        Phase.WEIGHT: lambda: _weighted(known),
        Phase.RESAMPLE: lambda: _resampled(known, scale),
        Phase.RESEED: lambda: _reseeded(known, scale, draws_new),
    }
    others = [label for label in steps if label not in known]
    rest = f" {quoted(others)}: {RECORDED}." if others else ""
    return f"{_head(steps, phase)} {sentences[phase]()}{rest}"


def is_recorded(record: StepRecord) -> bool:
    """Whether another localizer made it: its phases are not known."""
    return record.predicted is record.weighted and bool(np.isnan(record.log_evidence))


def _predicted(steps: Mapping[str, Step], scale: Scale) -> str:
    motions = dict.fromkeys(motion(record.frame.motions, scale) for _, record in steps.values())
    wide = [f"{spread_of(record.predicted, scale)} with `{label}`" for label, (_, record) in steps.items()]
    odometry = (
        f"odometry says {next(iter(motions))}" if len(motions) == 1 else "each robot moves by its odometry"
    )
    return f"{odometry}. The dots now spread over {listed(wide)}: nothing has been seen yet."


def _measured(steps: Mapping[str, Step], matches: Sequence[BestMatch], scale: Scale) -> str:
    words = _of_matches(steps, matches, scale)
    return f"{words} No dot moves." if words else f"{_what(steps)}s are measured. No dot moves."


def _of_matches(steps: Mapping[str, Step], matches: Sequence[BestMatch], scale: Scale) -> str:
    """Say where the best matches were taken: from the truth, else from the run's own estimate."""
    by_entry: dict[tuple[int, float], list[BestMatch]] = {}
    for match in matches:
        by_entry.setdefault((match.entry, _away_m(match, steps)), []).append(match)
    far = {key: scale.say(key[1]) for key in by_entry}
    if not by_entry:
        return ""
    goal = "the truth" if all(moment.truth is not None for moment, _ in steps.values()) else "its estimate"
    count = f"{matches[0].entries:,}"
    if len(by_entry) > 2:
        parts = [
            f"{far[key]} from {goal} by {quoted(match.label for match in some)}"
            if k == 0
            else f"{far[key]} by {quoted(match.label for match in some)}"
            for k, (key, some) in enumerate(by_entry.items())
        ]
        return f"of {count} references the best match was taken {listed(parts)}."
    parts = [
        f"the best match by {quoted(match.label for match in some)} was taken {far[key]} from {goal}"
        f"{_ranks(some)}"
        for key, some in by_entry.items()
    ]
    return f"of {count} references {'; '.join(parts)}."


def _away_m(match: BestMatch, steps: Mapping[str, Step]) -> float:
    moment, record = steps[match.label]
    goal = record.estimate.pose if moment.truth is None else moment.truth
    return float(np.hypot(*(match.pose - goal)[:2]))


def _ranks(matches: Sequence[BestMatch]) -> str:
    """Say how the match of some runs ranks by each channel: "(1st by color and 170th by edges, unused)"."""
    ranks = sorted(matches[0].ranks.items(), key=lambda item: item[1])
    used = {channel for match in matches for channel in match.used}
    if len(ranks) < 2:
        return ""
    some = ranks if len(ranks) <= FEW_RANKS else [ranks[0], ranks[-1]]
    parts = [f"{ordinal(rank)} by {channel}{'' if channel in used else ', unused'}" for channel, rank in some]
    return f" ({listed(parts)})"


def _weighted(steps: Mapping[str, Step]) -> str:
    parts = list[str]()
    sizes = {record.weighted.size for _, record in steps.values()}
    for label, (_, record) in steps.items():
        size = f" of {record.weighted.size:,}" if len(sizes) > 1 or not parts else ""
        parts.append(
            f"{heaviest_half(record.weighted.weights):,}{size}{'' if parts else ' dots'} with `{label}`"
        )
    failed = [
        f" `{label}`: {text}"
        for label, (_, record) in steps.items()
        for event, text in NOTHING_WEIGHED.items()
        if event in record.events
    ]
    return f"half of the weight is on {listed(parts)}.{''.join(failed)}"


def _resampled(steps: Mapping[str, Step], scale: Scale) -> str:
    """Say how many dots each run keeps, and how many of those that are near the truth."""
    parts, rest = list[str](), list[str]()
    share = _near_share(steps)
    for label, (moment, record) in steps.items():
        size = f"{record.weighted.size:,}"
        if record.parents is None:
            worth = f"{record.effective_sample_size:,.0f} of {size} equal dots"
            rest.append(f"`{label}` is not resampled, as its cloud is worth {worth}")
            continue
        survivor_rows = survivors(record)
        is_same = bool(parts) and f" of {size} dots" in parts[0]
        head = f"`{label}` {'' if parts else 'keeps '}{len(survivor_rows):,}"
        head += "" if is_same else f" of {size} dots"
        if moment.truth is not None:
            radius_m = share * _radius_m(record)
            near = _near(record.weighted, moment.truth, radius_m)
            place = "there" if parts else f"within {scale.say(radius_m)} of the truth"
            all_near = int(near.sum())
            head += (
                f", {near[survivor_rows].sum():,} of {all_near:,} {place}" if all_near else f" (none {place})"
            )
        parts.append(head)
    return f"{'; '.join([*parts, *rest])}."


def _near_share(steps: Mapping[str, Step]) -> float:
    """Return the share of the radius `confidence` that is near: the smallest that holds dots of some run."""
    for share in NEAR_SHARES[:-1]:
        for moment, record in steps.values():
            if moment.truth is not None:
                near = _near(record.weighted, moment.truth, share * _radius_m(record))
                if np.count_nonzero(near) >= LEAST_NEAR:
                    return share
    return NEAR_SHARES[-1]


def survivors(record: StepRecord) -> F64:
    """Return the numbers of the weighted particles that leave a copy."""
    assert record.parents is not None
    return np.unique(record.parents[record.parents >= 0])


def _radius_m(record: StepRecord) -> float:
    return record.estimate.radii.confidence_m


def _near(belief: Belief, truth: F64, radius_m: float) -> Bool:
    """Return which particles (N,) are within a radius of the true place, whatever their heading."""
    away = belief.poses[:, :2] + (belief.origin - truth[:2])
    return np.asarray(np.square(away).sum(axis=1) <= radius_m**2)


def _how_many(part: int, whole: int) -> str:
    if part == whole:
        return "all of them"
    return f"{part:,} of them" if part else "none"


def _reseeded(steps: Mapping[str, Step], scale: Scale, draws_new: Mapping[str, str | None]) -> str:
    parts, never, content = list[str](), list[str](), list[str]()
    for label, (moment, record) in steps.items():
        where = draws_new.get(label)
        if EXPANDED in record.events:
            parts.append(f"`{label}` moves every dot at random, as the picture fits its cloud badly")
        elif record.injected is not None:
            parts.append(_fresh(label, moment, record, scale, where))
        else:
            (never if where == DRAWS_NEVER else content).append(label)
    if content:
        parts.append(f"no new dots with {quoted(content)}, as the picture fits the cloud well enough")
    if never:
        parts.append(f"no new dots with {quoted(never)}, which never draw{'s' * (len(never) == 1)} any")
    return f"{'; '.join(parts)}."


def _fresh(label: str, moment: Moment, record: StepRecord, scale: Scale, where: str | None) -> str:
    """Say how many dots are new, and how many of them are near the truth."""
    assert record.injected is not None
    fresh, radius_m = int(record.injected.sum()), _radius_m(record)
    drawn = DRAWN.get(where or "", "")
    text = f"`{label}` draws {fresh:,} of {record.belief.size:,} dots anew{f' {drawn}' if drawn else ''}"
    if moment.truth is None:
        return text
    near = int(_near(record.belief, moment.truth, radius_m)[record.injected].sum())
    return f"{text}, {_how_many(near, fresh)} within {scale.say(radius_m)} of the truth"


def why_words(
    steps: Mapping[str, Step], phase: Phase | None, scale: Scale, matches: Sequence[BestMatch]
) -> str:
    """Return what explains the words on a phase, or on a whole step."""
    known = {label: step for label, step in steps.items() if not is_recorded(step[1])}
    if not known:
        return f"{capital(RECORDED)}: what each phase did is not known."
    if phase is Phase.PREDICT:
        return "Each dot moves as odometry says, with an error of its own, so that the clouds grow."
    if phase is Phase.MEASURE:
        return "Yellow: the best 5 matches of each run, where in view. The dots are not weighed yet."
    if phase is Phase.RESAMPLE:
        most = [
            f"{int(np.bincount(record.parents[record.parents >= 0]).max()):,} with `{label}`"
            for label, (_, record) in known.items()
            if record.parents is not None and (record.parents >= 0).any()
        ]
        copies = f"Red dots leave no copy, the largest leave most: {listed(most)}. " if most else ""
        return f"{copies}All weigh the same again: weight has become number."
    if phase is Phase.RESEED:
        return "Pink dots are new. The picture cannot bring back a place where no dot is."
    moved = gain_words(known, scale)
    if phase is Phase.WEIGHT:
        return f"{moved} A large dot is heavy, a gray one weighs less than half the average."
    words = _of_matches(known, matches, scale)
    return f"{moved} {capital(words)}".strip()


def gain_words(steps: Mapping[str, Step], scale: Scale) -> str:
    """Say what the picture did to the dots near the truth, within the smallest radius that holds some."""
    if any(moment.truth is None for moment, _ in steps.values()):
        return ""
    radius_m = 0.0
    for share in NEAR_SHARES:
        gains = dict[str, float]()
        for label, (moment, record) in steps.items():
            radius_m = share * _radius_m(record)
            if moment.truth is not None:
                gain = picture_gain(record, moment.truth, radius_m)
                gains |= {} if gain is None else {label: gain}
        if gains:
            break
    near = f"dots within {scale.say(radius_m)} of the truth"
    if not gains:
        return f"No run has {near}." if len(steps) > 1 else f"It has no {near}."
    order = sorted(gains, key=lambda label: -gains[label])
    parts = [
        f"**{gains[label]:.1f} x**{' as heavy' if k == 0 else ''} with `{label}`"
        for k, label in enumerate(order)
    ]
    without = [label for label in steps if label not in gains]
    rest = f" With {quoted(without)} hardly a dot is there." if without else ""
    return f"{_what(steps)} made {near} {listed(parts)}.{rest}"


def _what(steps: Mapping[str, Step]) -> str:
    """Return what was seen: a picture, or of lasers alone a scan."""
    read = {part.name for _, record in steps.values() for part in record.sighting.comparison.sensed}
    compared = any(record.sighting.comparison.channels for _, record in steps.values())
    return "The scan" if LASER in read and not compared else "The picture"
