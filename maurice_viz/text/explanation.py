"""Why the best reference wins and where others lose, in sentences.

The elements of a channel stand in planes of equal length (the red bins, the green ones, ...). A run of them
lies within one plane and has a name: "blue 96 to 119". A channel that is not known here has one plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from maurice_mcl.reasons.explanation import (
    ASKED,
    ESTIMATE,
    LEAST_NATS,
    TRUTH,
    WINNER,
    ChannelExplanation,
    EntryExplanation,
    PoseOffset,
    StepExplanation,
    where_lost,
)
from maurice_mcl.sensor.descriptors import chromaticity, color_grid, hog, tiny
from maurice_mcl.sensor.descriptors.histograms import BINS, HIGH, LOW, WIDTH
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.verification import KEYPOINTS

from ..style import Scale, capital

COLORS = ("red", "green", "blue")
PARTS = color_grid.COLUMNS * color_grid.ROWS
CELLS = hog.COLUMNS * hog.ROWS

Name = Callable[[int, int, int], str]  # plane, first and last element in it -> a few words


@dataclass(frozen=True, slots=True)
class Planes:
    """How a descriptor is divided."""

    count: int
    name: Name


def planes_of(channel: str, size: int) -> Planes:
    """Return the planes of a channel whose descriptor has `size` elements."""
    known = KNOWN.get(channel)
    return known[1] if known and known[0] == size else Planes(1, lambda _, a, b: f"elements {_span(a, b)}")


def _levels(what: str = "") -> Name:
    def name(plane: int, first: int, last: int) -> str:
        low, high = LOW + WIDTH * first, LOW + WIDTH * last + WIDTH - 1
        return f"{COLORS[plane]}{what} {low} to {HIGH if last == BINS - 1 else high}"

    return name


def _chromaticity(red: int, first: int, last: int) -> str:
    low, high = chromaticity.RANGE
    step = (high - low) / chromaticity.BINS
    a, b, c, d = (low + k * step for k in (red, red + 1, first, last + 1))
    return f"red share {a:.2f} to {b:.2f} with green share {c:.2f} to {d:.2f}"


def _raster(rows: int, columns: int, numbers: int) -> Name:
    """Return names for cells of a raster over the picture, row by row, with this many numbers per cell."""

    def name(row: int, first: int, last: int) -> str:
        at, left, right = f"row {row + 1} of {rows}", first // numbers, last // numbers
        if right - left == columns - 1:
            return f"{at} of the picture"
        return f"{at}, column {_span(left, right)} of {columns} of the picture"

    return name


def _color_grid(plane: int, first: int, last: int) -> str:
    part, color = divmod(plane, len(COLORS))
    width = (HIGH + 1 - LOW) / color_grid.BINS
    low, high = round(LOW + first * width), round(LOW + (last + 1) * width) - 1
    return f"{COLORS[color]} {low} to {high} in {_place(part, color_grid.COLUMNS)}"


def _hog(cell: int, first: int, last: int) -> str:
    width = 180 // hog.DIRECTIONS
    return f"edges at {first * width} to {(last + 1) * width} deg in {_place(cell, hog.COLUMNS)}"


def _place(cell: int, columns: int) -> str:
    row, column = divmod(cell, columns)
    return f"row {row + 1}, column {column + 1} of the picture"


def _span(first: int, last: int) -> str:
    return str(first + 1) if first == last else f"{first + 1} to {last + 1}"


# channel -> the size of its descriptor, and its planes
KNOWN: Mapping[str, tuple[int, Planes]] = {
    **{
        channel: (3 * BINS, Planes(3, _levels()))
        for channel in ("color", "smoothed", "blurred", "cumulative")
    },
    "edges": (3 * BINS, Planes(3, _levels(" edges of strength"))),
    "chromaticity": (chromaticity.BINS**2, Planes(chromaticity.BINS, _chromaticity)),
    "tiny": (3 * tiny.COLUMNS * tiny.ROWS, Planes(tiny.ROWS, _raster(tiny.ROWS, tiny.COLUMNS, 3))),
    "color_grid": (PARTS * 3 * color_grid.BINS, Planes(PARTS * 3, _color_grid)),
    "hog": (CELLS * hog.DIRECTIONS, Planes(CELLS, _hog)),
}


MOST_CHANNELS = 3  # that a sentence lists
LARGE_FACTOR = 1e6  # a larger factor is no more informative
SHARES = {"256 x share": 256.0, "share": 1.0}  # units of channels that count pixels: what all of them are
GLOSSARY = "One nat lost: 2.7 times less likely. Rank 1: the best of all. Quality: likeness, 0 to 1."


@dataclass(frozen=True, slots=True)
class ReferenceWords:
    """What a reference that is explained is called."""

    label: str  # on the map, and in tables
    title: str  # of its pictures
    words: str  # in a sentence
    place: str  # of the pose that it is nearest to, in a sentence


REFERENCES = {
    TRUTH: ReferenceWords("truth's", "Truth's reference", "the reference nearest to the truth", "the truth"),
    ESTIMATE: ReferenceWords(
        "estimate's", "Estimate's reference", "the reference nearest to the estimate", "the estimate"
    ),
    WINNER: ReferenceWords("winner", "Best match (winner)", "the winner", "the winner's pose"),
    ASKED: ReferenceWords(
        "asked for", "Reference asked for", "the reference asked for", "the pose asked for"
    ),
}


def say_step(step: StepExplanation, scale: Scale) -> list[str]:
    """Return a few sentences, one paragraph each: why the winner wins and where the others lose."""
    winner = step.winner
    others = [e for e in step.shown if e.who != WINNER]
    alike = [REFERENCES[e.who].words for e in others if e.entry is not None and e.entry.entry == winner.entry]
    also = f" It is also {' and '.join(alike)}." if alike else ""
    paragraphs = [_winner(step, scale) + also]
    named: dict[int, str] = {}
    for explained in others:
        entry, called = explained.entry, REFERENCES[explained.who]
        if entry is None:
            paragraphs.append(f"{capital(called.place)} lies outside free space, where no particle can be.")
        elif entry.entry in named:
            paragraphs.append(f"{capital(called.words)} is the same as {named[entry.entry]}.")
        elif entry.entry != winner.entry:
            paragraphs.append(_other(entry, called.words, winner))
            named[entry.entry] = called.words
    weighed = _weighed(step)
    return [*paragraphs, weighed] if weighed else paragraphs


def _winner(step: StepExplanation, scale: Scale) -> str:
    winner, explained = step.winner, step.of(WINNER)
    loses = {c.channel: c.loses for c in winner.channels} | {KEYPOINTS: winner.verified}
    by = sorted(loses, key=lambda name: -loses[name])
    parts = ", ".join(f"{name} {loses[name]:.1f}" for name in by[:MOST_CHANNELS] if loses[name] >= LEAST_NATS)
    among = f"Of {winner.entries} references entry {winner.entry}"
    among = among if winner.entries > 1 else "The only reference"
    parts = f" ({parts})" if parts and len(winner.channels) > 1 else ""
    cost = f": it loses {-winner.log_likelihood:z.1f} nats{parts}"
    lies = explained.from_truth if explained else None
    lies_at = "" if lies is None else f" It is {say_offset(lies, scale)} from the truth."
    return f"{among} at {scale.say_pose(winner.pose)} matches the picture best{cost}.{lies_at}"


def _other(entry: EntryExplanation, what: str, winner: EntryExplanation) -> str:
    start = f"{capital(what)}, entry {entry.entry}, is {ordinal(entry.rank)} of {entry.entries}"
    if entry.behind < LEAST_NATS:
        return f"{start}: practically as likely as the winner."
    return f"{start}, {say_behind(entry.behind)}. {_reasons(entry, winner)}"


def say_behind(nats: float) -> str:
    """Describe a gap in log-likelihood: "2.3 nats behind the winner: 10 times less likely"."""
    return f"{nats:.1f} nats behind the winner: {say_times(nats)} times less likely"


def say_times(nats: float) -> str:
    """Write the factor of likelihood that so many nats are: "160,000", "over a million"."""
    factor = math.exp(min(nats, 700.0))
    if factor > LARGE_FACTOR:
        return "over a million"
    return f"{factor:.1f}" if factor < 10 else f"{float(f'{factor:.2g}'):,.0f}"


def _reasons(entry: EntryExplanation, winner: EntryExplanation) -> str:
    costs = entry.lost_to(winner)
    order = np.argsort(-costs, kind="stable")
    verified, first = entry.verified - winner.verified, int(order[0])
    others = [(entry.channels[k].channel, float(costs[k])) for k in order]
    sentences = list[str]()
    if verified > costs[first]:
        sentences.append(f"{capital(KEYPOINTS)} cost it {verified:.1f} nats")
    else:
        others.insert(1, (KEYPOINTS, verified))
    if not sentences or costs[first] >= LEAST_NATS:
        sentences.append(_costs(entry.channels[first], winner.channels[first], costs[first]))
        others = others[1:]
    text = ". ".join(sentences)
    others = [(name, cost) for name, cost in others if abs(cost) >= LEAST_NATS]
    more = [f"{name} {cost:.1f}" if cost > 0 else f"{name} favors it by {-cost:.1f}" for name, cost in others]
    return f"{text}; {', '.join(more[:MOST_CHANNELS])}." if more else f"{text}."


def _costs(mine: ChannelExplanation, best: ChannelExplanation, cost: float) -> str:
    """Say what a channel costs a reference, and where most of that is lost."""
    text = f"{capital(mine.channel)} costs it {cost:.1f} nats"
    planes = planes_of(mine.channel, len(mine.sample))
    run = where_lost(mine, best, planes.count)
    if run is None:
        return text
    gain = run.nats - cost  # by the channel's other elements
    text += f", {run.nats:.1f} {'lost' if gain >= LEAST_NATS else 'of them'}"
    text += f" at {planes.name(run.plane, run.first, run.last)}"
    text += f", where the picture has {'less' if run.picture < run.reference else 'more'}"
    text += f" ({_amounts(mine.channel, run.picture, run.reference)})"
    return text + (f", and {gain:.1f} won elsewhere" if gain >= LEAST_NATS else "")


def _amounts(channel: str, picture: float, reference: float) -> str:
    """Say what a picture has against a reference: "2.9% against 1.3% of the pixels a bin"."""
    unit = CHANNELS[channel].unit if channel in CHANNELS else "the channel's unit"
    whole = SHARES.get(unit)
    pair = (picture, reference) if whole is None else (100 * picture / whole, 100 * reference / whole)
    values = [f"{value:.1f}" if value >= 10 else f"{value:.2g}" for value in pair]
    if whole is None:
        return f"{' against '.join(values)}, {unit}"
    return f"{'% against '.join(values)}% of the pixels a bin"


def _weighed(step: StepExplanation) -> str:
    """Say what a particle at each pose gets, and what its nearest reference or each sensor gives alone."""
    parts, sensors = [], dict[str, None]()
    for explained in step.shown:
        weight, entry = explained.weighed, explained.entry
        if weight is None or entry is None or explained.who == WINNER:
            continue
        of = f"its nearest reference alone: {entry.log_likelihood:z.1f}"
        if explained.sensed:
            sensors.update(dict.fromkeys(explained.sensed))
            each = {**explained.sensed, "references": weight - sum(explained.sensed.values())}
            of = ", ".join(f"{name} {nats:z.1f}" for name, nats in each.items())
        parts.append(f"on {REFERENCES[explained.who].place} gets {weight:z.1f} nats ({of})")
    if not parts:
        return ""
    start = "Particles are weighted by the references around them, including virtual ones"
    at_own = f", and at their own poses by {' and '.join(sensors)}" if sensors else ""
    return f"{start}{at_own}: one {', one '.join(parts)}."


def say_offset(offset: PoseOffset, scale: Scale) -> str:
    """Describe the distance between two poses: "4.1 in and 8 deg"."""
    return f"{scale.say(offset.apart_m)} and {math.degrees(offset.turned_rad):.0f} deg"


def ordinal(number: int) -> str:
    """Write a rank: 1st, 2nd, 3rd, 11th."""
    ending = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"
