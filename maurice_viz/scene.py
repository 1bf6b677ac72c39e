"""One description of what is shown: the runs, and the scene that they share. Layouts and panels get both."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import takewhile

import numpy as np

from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.sensor.laser.parameters import LaserParameters
from maurice_mcl.sensor.laser.sensor import LASER, Laser, laser_of
from maurice_mcl.sensor.map_places import reference_of
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values import F64, USUAL, Arena, Library, Radii, SessionInfo

from .drawing.contact_sheet import cell_height
from .entities import RunPaths
from .style import RGB, RUN_COLORS, Scale, scale_for

SHORT, ENDS = 16, 7  # letters that have room left of a lane at 1280 pixels; and of each end of a longer name


class Detail(StrEnum):
    """How much is drawn."""

    FULL = "full"  # every panel at every update
    EVENTS = "events"  # the same around events, elsewhere as light
    LIGHT = "light"  # camera, text, traces, estimate, and a cloud of a few hundred particles


@dataclass(frozen=True, eq=False)
class Scene:
    """What all runs of a Rerun recording share, as it is known before the first step."""

    info: SessionInfo
    library: Library  # without entries where only the map is known
    has_truth: bool
    updates: int = 0  # how many there will be; 0 when that is not known
    has_pictures: bool = True  # whether the robot has a camera at all
    live: bool = False  # the drive is going on: viewers may come and go, and nobody is waited for
    # the largest position error of all runs, without truth the largest spread; None: not known before the end
    most_m: float | None = None
    most_not_lost_m: float = 0.0  # the largest of errors that do not count as lost; 0: none, or not known
    opens: str = ""  # the file or the folder that `maurice-replay open` shows again; none: it is not kept

    @property
    def arena(self) -> Arena:
        """The map."""
        return self.library.arena

    @cached_property
    def scale(self) -> Scale:
        """From meters to what is drawn, in the session's units."""
        return scale_for(self.info.display_units, self.arena)

    @property
    def picture_height(self) -> int:
        """Of a reference on the contact sheet, in pixels."""
        return cell_height(self.library.pictures)

    def compares_pictures(self, run: RunView) -> bool:
        """Whether there are pictures of places to look at, beside those that the robot of a run takes."""
        return bool(run.channels) or (self.has_pictures and self.library.size > 0 and not self.library.is_map)

    @cached_property
    def nearest(self) -> NearestReference | None:
        """The library's own rule for which entry represents a pose; None for a library without entries."""
        return reference_of(self.library, self.arena) if self.library.size else None

    def laser_of(self, run: RunView) -> Laser | None:
        """What judges scans on the map: a run's own laser; of another localizer's run one like ours."""
        if run.sensor is not None:
            laser = run.sensor.sensors.get(LASER)
            return laser if isinstance(laser, Laser) else None
        occupancy = self.library.occupancy
        return laser_of(occupancy, LaserParameters()) if run.is_recorded and occupancy is not None else None

    def entry_at(self, pose: F64) -> int:
        """Return the entry that represents a pose (3,) in the map's frame; -1 outside free space."""
        if self.nearest is None:
            return -1
        relative = (pose - np.append(self.library.origin, 0)).astype(np.float32)
        return int(self.nearest.entries(relative[None], self.library.origin)[0])


@dataclass(frozen=True, slots=True)
class RunView:
    """One run as it is shown."""

    label: str
    channels: tuple[str, ...]  # one histogram panel each; none: another localizer's, as recorded
    sensor: SensorModel | None = None  # None: comparisons are not available, and their panels stay empty
    particles: int = 0
    radii: Radii = USUAL  # by which it is judged
    draws_new: str | None = None  # where recovery draws new particles, NEVER: nowhere; None: not known
    localizer: Localizer | None = None  # None: failures are judged by the records alone
    own_drive: bool = False  # compared with runs of another drive, so that truth and camera are its own
    start: F64 | None = None  # (3,) in the map's frame, where it is known to begin
    number: int = 0  # among the runs of the recording; the first draws what all share (see `numbered`)
    all_channels: tuple[str, ...] = ()  # of all runs of the recording, for the key that they share
    shortened: str = ""  # its label, if that is long and other runs are known

    @property
    def short(self) -> str:
        """Its label where room is scarce: left of lanes, above pictures, on maps."""
        return self.shortened or self.label

    @property
    def is_recorded(self) -> bool:
        """Whether another localizer ran it: nothing is known but its clouds or poses."""
        return not self.channels and not self.sensors

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of its pose sensors; none if it is not known what it was made with."""
        return () if self.sensor is None else tuple(self.sensor.sensors)

    @property
    def sees_alone(self) -> bool:
        """Whether a laser is all that it has: then its scans stand where pictures do."""
        return not self.channels and self.sensors == (LASER,)

    @property
    def distances(self) -> Mapping[str, str]:
        """How each channel measures distances; none if comparisons are not available."""
        return {} if self.sensor is None else self.sensor.distances

    @property
    def paths(self) -> RunPaths:
        """Where it is drawn."""
        return RunPaths(self.label)

    @property
    def color(self) -> RGB:
        """Of its estimate, its path and its curves; a fifth run has the first one's again."""
        return RUN_COLORS[self.number % len(RUN_COLORS)]

    @classmethod
    def of(cls, label: str, localizer: Localizer, start: F64 | None = None) -> RunView:
        """Return the view of a filter's run, all of whose panels will be filled."""
        return cls(
            label,
            tuple(localizer.sensor.distances),
            localizer.sensor,
            localizer.particles,
            radii=localizer.radii,
            draws_new=localizer.draws_new,
            localizer=localizer,
            start=start,
        )


def numbered(runs: Iterable[RunView]) -> list[RunView]:
    """Return runs with their numbers, in order: each has its own color; and with what others measure."""
    views = list(runs)
    channels = tuple(dict.fromkeys(channel for run in views for channel in run.channels))
    short = short_names([run.label for run in views])
    return [
        replace(run, number=number, all_channels=channels, shortened=name)
        for number, (run, name) in enumerate(zip(views, short, strict=True))
    ]


def short_names(labels: Sequence[str]) -> list[str]:
    """Return labels of at most `SHORT` letters, no two alike.

    Long ones go without the words that all of them begin and end with; what is still long has both ends.
    """
    names: list[str] = []
    parts = [re.split(r"[-_. ]", label) for label in labels if len(label) > SHORT]
    first, last = (_alike([words[::way] for words in parts]) for way in (1, -1))
    for number, label in enumerate(labels, 1):
        words = re.split(r"[-_. ]", label)
        own = "-".join(words[first : len(words) - last]) if len(parts) > 1 else ""
        name = own if 0 < len(own) <= SHORT else f"{label[:ENDS]}\N{HORIZONTAL ELLIPSIS}{label[-ENDS:]}"
        name = label if len(label) <= SHORT else name
        if name in names or (name != label and name in labels):
            name = f"{label[: SHORT - 3]}\N{HORIZONTAL ELLIPSIS}{number}"
        names.append(name)
    return names


def _alike(parts: Sequence[Sequence[str]]) -> int:
    """Return how many words all begin with."""
    return len([*takewhile(lambda words: len({*words}) == 1, zip(*parts, strict=False))])


def shortly(runs: Sequence[RunView], text: str) -> str:
    """Return a text in Markdown with short names of runs in place of their labels."""
    for run in runs:
        text = text.replace(f"`{run.label}`", f"`{run.short}`")
    return text
