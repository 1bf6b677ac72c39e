"""What a layout has to know of what will be drawn."""

from __future__ import annotations

from dataclasses import dataclass

from maurice_mcl.map import Arena

from .drawing.contact_sheet import CELL_PX
from .style import Scale


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What a layout has to know of what will be drawn."""

    arena: Arena
    scale: Scale
    has_truth: bool
    has_pictures: bool = True  # whether the robot has a camera at all
    picture_height: int = CELL_PX * 3 // 4  # of a reference on the contact sheet, in pixels


@dataclass(frozen=True, slots=True)
class Run:
    """One run: its label, and the channels whose histograms there are."""

    label: str
    channels: tuple[str, ...]  # none: another localizer's, as recorded
    own_drive: bool = False  # compared with runs of another drive, so that truth and camera are its own
