"""What a step teaches, in one sentence: whether the picture knows the place, and whether dots are there.

"The picture knows the place (rank 1 of 624); no dot of `thesis` is within 108 in." A filter weighs the dots
that it has: where none is near, the best match does not help it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from maurice_mcl.reasons.place import PlaceKnown

from ..style import Scale, capital
from .explanation import ordinal
from .verdict import joined

MOST_RANK, RANK_SHARE = (
    5,
    0.01,
)  # up to which rank the picture knows the place: the five best, or the best 1 %
SMALL_SHARE = 0.05  # of a small library's references, at most so many are the best
POOR_SHARE = 0.1  # of the references, beyond which the picture does not know it
FITS, FITS_NOT = 0.8, 0.5  # shares of a laser's beams
MOSTLY = 0.5  # share of the weight from which on the dots are there

Places = Mapping[str, PlaceKnown | None]


def say_lesson(places: Places, scale: Scale) -> str:
    """Return the sentence on runs by their labels; empty where nothing can be said."""
    runs = {label: place for label, place in places.items() if place is not None}
    if not runs:
        return ""
    known = _ranked(runs, len(places) > 1) or _fitting(runs)
    dots = _dots(runs, scale, len(places) > 1)
    text = "; ".join(part for part in (known, dots) if part)
    return f"{capital(text)}."


def _ranked(runs: Mapping[str, PlaceKnown], several: bool) -> str:
    """Return the rank of the true place: "the picture knows the place (rank 1 of 624)"."""
    ranks = {label: place.rank for label, place in runs.items() if place.rank is not None}
    entries = next((place.entries for place in runs.values() if place.rank is not None), 0)
    if entries < 2:
        return ""
    least, most = min(ranks.values()), max(ranks.values())
    best = max(min(MOST_RANK, int(SMALL_SHARE * entries)), int(RANK_SHARE * entries))  # 0: too few to tell
    poor = max(POOR_SHARE * entries, 1.0)
    span = f"rank {least} of {entries}" if least == most else f"rank {least} to {most} of {entries}"
    if most <= best:
        return f"the picture knows the place ({span})"
    if least > poor:
        return f"the picture does not know the place ({span})"
    if least == most or not several:
        return f"the picture ranks the place {ordinal(least)} of {entries}"
    if most <= poor:
        return f"the picture ranks the place {ordinal(least)} to {ordinal(most)} of {entries}"
    by_rank: dict[int, list[str]] = {}
    for label, rank in ranks.items():
        by_rank.setdefault(rank, []).append(f"`{label}`")
    each = [f"{ordinal(rank)} for {joined(labels)}" for rank, labels in by_rank.items()]
    return f"of {entries} places the picture ranks this one {', '.join(each)}"


def _fitting(runs: Mapping[str, PlaceKnown]) -> str:
    """Return whether the scan fits the true place: "the scan fits the place (58 of 60 beams agree)"."""
    beams = next((place.agree for place in runs.values() if place.agree is not None), None)
    if beams is None or not beams[1]:
        return ""
    share = beams[0] / beams[1]
    fits = "fits the place" if share >= FITS else "does not fit the place"
    fits = "fits the place in part" if FITS_NOT <= share < FITS else fits
    return f"the scan {fits} ({beams[0]} of {beams[1]} beams agree)"


def _dots(runs: Mapping[str, PlaceKnown], scale: Scale, several: bool) -> str:
    """Return which runs have dots there, those without any first."""
    groups: dict[str, list[str]] = {"none": [], "turned": [], "some": [], "there": []}
    for label, place in runs.items():
        groups[_kind(place)].append(label)
    parts = []
    if without := groups["none"]:
        within = _at_least(min(runs[label].nearest_m for label in without), scale)
        of = f" of {joined(_named(without), 'or')}" if several else ""
        parts.append(f"no dot{of} is within {within}{_of_what(runs[without[0]])}")
    there = "there" if parts or runs[next(iter(runs))].is_true else "where the picture fits best"
    if turned := groups["turned"]:
        parts.append(f"dots{_of(turned, several)} are {there}, but face another way")
    for label in groups["some"]:
        whose = f"`{label}`'s weight" if several else "the weight"
        parts.append(f"{_percent(runs[label].share)} of {whose} is {there}")
    if near := groups["there"]:
        parts.append(f"the dots{_of(near, several)} are {there}")
    return "; ".join(parts)


def _kind(place: PlaceKnown) -> str:
    if place.near:
        return "there" if place.share >= MOSTLY else "some"
    return "turned" if place.has_dot else "none"


def _of_what(place: PlaceKnown) -> str:
    """Return of what no dot is near, where the sentence has not said it before."""
    if not place.is_true:
        return " of where the picture fits best"
    return "" if place.rank is not None or place.agree is not None else " of the white disk"


def _named(labels: Sequence[str]) -> list[str]:
    return [f"`{label}`" for label in labels]


def _of(labels: Sequence[str], several: bool) -> str:
    return f" of {joined(_named(labels))}" if several else ""


def _percent(share: float) -> str:
    return f"{share:.0%}" if share >= 0.005 else "less than 1%"


def _at_least(length_m: float, scale: Scale) -> str:
    """Write a distance, rounded down to whole inches or tenths of a meter: nothing is nearer."""
    unit = scale.units
    digits = unit.digits - 1
    down = math.floor(scale.length(length_m) * 10**digits) / 10**digits
    return f"{down:.{digits}f} {unit.name}"
