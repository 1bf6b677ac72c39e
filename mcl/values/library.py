"""The library: reference poses with what each channel measured there. It is the filter's map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from .arrays import F32, F64
from .laser import OccupancyMap
from .map import Arena
from .pose_sensor import PoseSensor
from .session import Camera


@dataclass(frozen=True, eq=False)
class ChannelIndex:
    """One channel over all of a library, in the unit of that channel."""

    references: F32  # (L, D)
    noise_floor: F32  # (D,) what the channel measures with the lens covered; zeros when not measured
    relevance: F32  # (D,) per-bin maximum over the library (thesis fig. 15)

    @cached_property
    def centered(self) -> Centered:
        """The references about their mean, for distances by products."""
        return Centered.of(self.references)

    @cached_property
    def centered_roots(self) -> Centered:
        """Square roots of the references, about their mean."""
        return Centered.of(np.sqrt(self.references))


@dataclass(frozen=True, slots=True, eq=False)
class Centered:
    """Rows about their mean, with their squared lengths: what a distance by products needs of a library."""

    middle: F32  # (D,)
    rows: F32  # (L, D) rows minus the middle
    squared: F32  # (L,) squared lengths of the rows

    @classmethod
    def of(cls, values: F32) -> Centered:
        """Center values (L, D)."""
        middle = values.mean(axis=0, dtype=np.float64).astype(np.float32)
        rows = values - middle
        return cls(middle, rows, np.einsum("ij,ij->i", rows, rows))


@dataclass(frozen=True, slots=True, eq=False)
class Library:
    """L reference pictures with their surveyed poses, and the map they were taken in.

    `maurice_loaders.open_library` returns one for a library folder or a survey log.

        >>> import maurice_mcl as mcl
        >>> library = mcl.tiny_library()
        >>> library.size, library.index["color"].references.shape
        (96, (96, 84))
    """

    name: str
    poses: F64  # (L, 3) as surveyed, in the map's frame
    pictures: tuple[Path | None, ...]  # L files, None where the picture is not kept
    index: Mapping[str, ChannelIndex]  # by channel name
    arena: Arena
    display_units: str = "m"
    sensors: Mapping[str, PoseSensor] = field(default_factory=dict)  # besides the channels, by name
    camera: Camera | None = None  # what is known of the one that took the pictures

    @property
    def size(self) -> int:
        """The number of entries L."""
        return len(self.poses)

    @property
    def occupancy(self) -> OccupancyMap | None:
        """What scans of a laser are compared with; None: no such map."""
        return self.arena.occupancy

    @property
    def is_map(self) -> bool:
        """Whether the entries are places on an occupancy map alone: no references that people can look at."""
        return self.occupancy is not None and not self.index

    @property
    def origin(self) -> F64:
        """The point (2,) that float32 poses are stored relative to: the middle of the map."""
        x_min, y_min, x_max, y_max = self.arena.bounds
        return np.array([(x_min + x_max) / 2, (y_min + y_max) / 2])
