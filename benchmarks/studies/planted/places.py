"""Where planted drives take place, and which of them may be tuned on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from maurice_datasets.surveys import cached_survey
from maurice_datasets.tasks import FITTING, SURVEY, TEST
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import World
from maurice_loaders.libraries.store import open_library
from maurice_mcl.sensor.descriptors.registry import weights_of
from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena, Region

FEATURE = "best"
CHANNELS = (*weights_of(FEATURE), "color")
APART_M = 1.0  # between the halves of a twin


@dataclass(frozen=True, slots=True)
class SeedSet:
    """Worlds with their arena seeds, in turn for one seed after another, and the first seed of a drive."""

    name: str
    places: tuple[tuple[str, int], ...]
    first: int

    def place_of(self, number: int) -> tuple[str, int]:
        """Return world and arena seed of planted drive `number`, from 0."""
        return self.places[number % len(self.places)]


WORKSHOP = str(Path(__file__).with_name("workshop.toml"))
ROOMS, OFFICE = "two-rooms", "office"
SETS: Mapping[str, SeedSet] = {
    one.name: one
    for one in (
        # what names causes may be tuned on these
        SeedSet("develop", ((ROOMS, 1), (ROOMS, 2), (ROOMS, 3), (OFFICE, 1)), FITTING.start),
        # and never on these; one world is seen only here
        SeedSet("unseen", ((ROOMS, 1011), (WORKSHOP, 1011), (OFFICE, 1011), (ROOMS, 1012)), TEST.start + 200),
    )
}


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A simulated world with its library."""

    name: str
    arena_seed: int
    world: World
    library: Library  # with a few channels


@lru_cache(1)
def ground_of(name: str, arena_seed: int) -> Ground:
    """Load a world and its library; both are kept for the last one, and the survey in the cache."""
    cv2.setNumThreads(1)
    world = load_world(name, arena_seed)
    survey = cached_survey(world, arena_seed, lambda done, total, what: None)
    return Ground(name, arena_seed, world, open_library(survey / SURVEY.name, CHANNELS))


def part_of(library: Library, kept: Bool) -> Library:
    """Return a library of some of its references, (L,) True where one is kept."""
    index = {name: _some(channel, kept) for name, channel in library.index.items()}
    pictures = tuple(file for file, keep in zip(library.pictures, kept, strict=True) if keep)
    return replace(library, poses=library.poses[kept], pictures=pictures, index=index)


def _some(channel: ChannelIndex, kept: Bool) -> ChannelIndex:
    references = np.ascontiguousarray(channel.references[kept])
    return ChannelIndex(references, channel.noise_floor, references.max(axis=0))


def twin_of(library: Library) -> Library:
    """Return a library of two halves that look the same, side by side, with no way from one to the other."""
    shift = np.array([library.arena.size_m[0] + APART_M, 0.0])
    poses = np.concatenate([library.poses, library.poses + np.append(shift, 0.0)])
    index = {name: _twice(channel) for name, channel in library.index.items()}
    arena = _twin_arena(library.arena, shift)
    return Library(library.name, poses, library.pictures * 2, index, arena, library.display_units)


def _twice(channel: ChannelIndex) -> ChannelIndex:
    references = np.concatenate([channel.references, channel.references])
    return ChannelIndex(references, channel.noise_floor, channel.relevance)


def _twin_arena(arena: Arena, shift: F64) -> Arena:
    x_min, y_min, x_max, y_max = arena.bounds
    walls = np.concatenate([arena.walls, arena.walls + np.tile(shift, 2)])
    return Arena(
        (x_min, y_min, x_max + float(shift[0]), y_max),
        walls,
        *(_with_twins(regions, shift) for regions in (arena.obstacles, arena.floors, arena.rooms)),
    )


def _with_twins(regions: tuple[Region, ...], shift: F64) -> tuple[Region, ...]:
    return (*regions, *(Region(region.name, region.polygon + shift) for region in regions))
