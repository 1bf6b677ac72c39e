"""Virtual references: what a picture taken midway between surveyed ones would measure.

Means of descriptors replace pictures that were not taken halfway between two places or headings. Averaging
likelihoods cannot: the mean of two poor matches is poor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..values import (
    F64,
    I32,
    SAME_PLACE_M,
    Arena,
    ChannelIndex,
    Keep,
    Tables,
    crosses,
    distinct_places,
    made_anew,
    place_tree,
    spacing,
    wrap,
)
from .references import OVERLAP_RAD

JOINED_SPACINGS = 1.5  # spacings: a grid's next nodes along its lines and diagonals, and no others
MOST_JOINED_PLACES = 4  # places with a common middle
SAME_VIEW_RAD = np.radians(15)  # of two places: views that show the same scene


@dataclass(frozen=True, slots=True, eq=False)
class VirtualReferences:
    """V poses and the surveyed entries whose descriptors are averaged there, in equal shares."""

    poses: F64  # (V, 3) in the map's frame
    sources: I32  # (V, n) entry numbers; rows with fewer than n repeat them in turn

    def extend(self, index: Mapping[str, ChannelIndex]) -> dict[str, ChannelIndex]:
        """Append the V means to every channel's references: (L, D) to (L + V, D)."""
        return {name: self._extended(channel) for name, channel in index.items()}

    def _extended(self, channel: ChannelIndex) -> ChannelIndex:
        total = np.zeros((len(self.sources), channel.references.shape[1]), np.float32)
        for column in self.sources.T:
            total += channel.references[column]
        total /= np.float32(self.sources.shape[1])
        return replace(channel, references=np.concatenate([channel.references, total]))


def virtual_references(poses: F64, arena: Arena, keep: Keep = made_anew) -> VirtualReferences:
    """Find the poses midway between those of a library (L, 3) in heading and place, never across a wall."""
    places, place_of_entry = distinct_places(poses[:, :2])
    views = _views(poses, place_of_entry)
    turned = views[views[:, 0] != views[:, 1]]
    rows = [np.tile(turned, 4)]
    groups = _neighbors_between(places, arena.walls, keep)
    headings = wrap(_middle(poses[views, 2]))
    place_of_view = place_of_entry[views[:, 0]]
    by_place = [np.flatnonzero(place_of_view == place) for place in range(len(places))]
    for group in groups:
        rows.append(_joined(views, headings, [by_place[place] for place in group]))
    sources = np.concatenate(rows).astype(np.int32)
    middles = np.column_stack([poses[sources, :2].mean(axis=1), wrap(_middle(poses[sources, 2]))])
    return VirtualReferences(middles, sources)


def _views(poses: F64, place_of_entry: I32) -> NDArray[np.int64]:
    """Return pairs of entries (W, 2) at one place: each with itself, and with the next if they overlap."""
    pairs = [np.column_stack([np.arange(len(poses))] * 2)]
    for place in range(int(place_of_entry.max(initial=-1)) + 1):
        entries = np.flatnonzero(place_of_entry == place)
        entries = entries[np.argsort(poses[entries, 2] % (2 * np.pi), kind="stable")]
        following = np.roll(entries, -1)
        gap = (poses[following, 2] - poses[entries, 2]) % (2 * np.pi)
        overlap = (gap > 0) & (gap <= OVERLAP_RAD)
        pairs.append(np.column_stack([entries, following])[overlap])
    return np.concatenate(pairs)


def _neighbors_between(places: F64, walls: F64, keep: Keep) -> list[list[int]]:
    """Return groups of places with a common middle: two along a grid's line, four around a cell's center."""

    def seen() -> Tables:
        within = JOINED_SPACINGS * spacing(places)
        pairs = place_tree(places).query_pairs(within, output_type="ndarray").reshape(-1, 2)
        pairs = pairs[~crosses(places[pairs[:, 0]], places[pairs[:, 1]], walls)]
        return (pairs[np.lexsort(pairs.T[::-1])],)

    (pairs,) = keep("pairs 1", [places, walls], seen)
    middle = np.round(places[pairs].mean(axis=1) / SAME_PLACE_M).astype(np.int64)
    groups: dict[tuple[int, int], list[int]] = {}
    for (x, y), pair in zip(middle.tolist(), pairs.tolist(), strict=True):
        groups.setdefault((x, y), []).extend(pair)
    return [group[:MOST_JOINED_PLACES] for group in groups.values()]


def _joined(views: NDArray[np.int64], headings: F64, members: list[NDArray[np.intp]]) -> NDArray[np.int64]:
    """Join the views of several places with the same heading: rows (W, 8) of entries."""
    first = members[0]
    chosen, alike = [first], np.ones(len(first), bool)
    for other in members[1:]:
        turned = np.abs(wrap(headings[first][:, None] - headings[other]))
        nearest = turned.argmin(axis=1)
        alike &= turned[np.arange(len(first)), nearest] <= SAME_VIEW_RAD
        chosen.append(other[nearest])
    entries = np.concatenate([views[view[alike]] for view in chosen], axis=1)
    return entries[:, np.arange(8) % entries.shape[1]]


def _middle(headings: F64) -> F64:
    return np.asarray(np.arctan2(np.sin(headings).mean(axis=1), np.cos(headings).mean(axis=1)))
