"""What a page is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from maurice_loaders.run_store import SavedRun
from maurice_mcl.library import Library
from maurice_mcl.session import SessionInfo

from ..look import Scale
from .choosing import Happening, Scene
from .shots import Shot
from .tracks import Collected


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """All that a page is made of."""

    runs: Sequence[SavedRun]
    info: SessionInfo
    library: Library
    scale: Scale
    collected: Collected
    happened: Sequence[Happening]
    scenes: Sequence[Scene]
    shots: Mapping[int, Shot]  # by step

    @property
    def labels(self) -> list[str]:
        """The runs' names, in order."""
        return [track.label for track in self.collected.tracks]
