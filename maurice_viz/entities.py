"""Every entity path and every timeline, once.

What belongs to one run stands under `/<run label>/`; what runs share stands under `/world` (it never
changes) and `/session` (what was seen and, if known, what was true).
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

from .style import font_safe

STEP = "step"  # sequence: the number of the picture; shows the weighted cloud
SESSION = "session"  # duration in seconds since the session's first record
PHASE = "phase"  # sequence: 6 * step + slot; shows the phases of one update

PHASES_PER_STEP = 6  # phases of one update on the phase timeline, whether or not they are filled

WORLD = "/world"
FLOORS = "/world/floors"
BARE_FLOORS = "/world/floors-bare"  # without names and ruler, for small maps and close-ups
WALLS = "/world/walls"
SEPARATORS = "/world/separators"  # in every 2D view, one between every two layers: empty Points2D
NODES = "/world/nodes"

SEEN = "/session/**"  # everything that the runs of a recording share
CAMERA = "/session/camera"
EDGES = "/session/edges"
VERDICT = "/session/verdict"  # what happened: one TextDocument, static
TOUR = "/session/tour"  # where to look: one TextDocument per moment, from its step on
LIMITS = "/session/limits"  # Scalars: the error above which runs count as lost
PHASES = "/session/phases"  # the strip of phases: boxes, names, and a mark at the present one
ERROR_UNIT = "/session/error-unit"  # TextDocument: what is plotted there, and its unit
TRUTH = "/session/truth"  # as an estimate: disk, arrow and trail
CARRIED = f"{TRUTH}/carried"  # Arrows2D: from where to where a kidnapped robot was carried

RESERVED = ("world", "session", "compare", "what_happened", "runs")


class Phase(IntEnum):
    """The phases of one update, in the order in which they happen."""

    PREDICT = 0
    MEASURE = 1
    WEIGHT = 2
    RESAMPLE = 3
    RESEED = 4
    ESTIMATE = 5


PHASE_NAMES = tuple(phase.name.lower() for phase in Phase)


def phase_number(step: int, slot: Phase) -> int:
    """Return the place of one phase of one step on the phase timeline."""
    return PHASES_PER_STEP * step + slot


@dataclass(frozen=True, slots=True)
class Place:
    """Where the time cursor stands: at a step, or at one phase of it."""

    step: int
    phase: Phase | None = None

    @property
    def timeline(self) -> str:
        """The timeline on which it is a place."""
        return STEP if self.phase is None else PHASE

    @property
    def number(self) -> int:
        """The place on that timeline."""
        return self.step if self.phase is None else phase_number(self.step, self.phase)

    def __str__(self) -> str:
        return f"step {self.step}{'' if self.phase is None else f', {self.phase.name.lower()}'}"


def open_command(source: str | Path, place: Place, layout: str | None = None) -> str:
    """Return the command that opens a recording or a saved run at a place, in a tab that is asked for."""
    phase = "" if place.phase is None else f" --phase {place.phase.name.lower()}"
    tab = "" if layout is None else f" --layout {layout}"
    return f"maurice-replay open {shlex.quote(str(source))} --step {place.step}{phase}{tab}"


@lru_cache(maxsize=64)
def escaped(label: str) -> str:
    """Write a label as one part of an entity path: Rerun wants a backslash before spaces and signs."""
    return re.sub(r"([^\w.-])", r"\\\1", font_safe(label))


@dataclass(frozen=True, slots=True)
class Below:
    """A path below a run's own, which a field of `RunPaths` stands for."""

    parts: tuple[str, ...]

    def __get__(self, run: RunPaths, kind: type[RunPaths]) -> str:
        """Return the path for one run."""
        return run.at(*self.parts)


@dataclass(frozen=True, slots=True)
class RunPaths:
    """Where one run is drawn. The label is unique in a recording and not one of `RESERVED`."""

    label: str

    particles: ClassVar = Below(("belief", "particles"))  # the cloud: Points2D, one per particle
    # the scored estimate: one Points2D, an Arrows2D along its heading, a LineStrips2D of its past
    estimate: ClassVar = Below(("belief", "estimate"))
    name: ClassVar = Below(("name",))  # the run's name above its estimate: Points2D
    # two standard deviations of the weighted cloud: LineStrips2D
    ellipses: ClassVar = Below(("belief", "estimate", "ellipses"))
    mode_rings: ClassVar = Below(("belief", "modes"))  # where the modes are: LineStrips2D, a color each
    closeup: ClassVar = Below(("closeup",))  # of the view that follows the cloud: Transform3D, a bar under it
    line_key: ClassVar = Below(("key", "evidence"))  # of the plot of evidence: one EncodedImage
    marks_key: ClassVar = Below(("key", "marks"))  # of the other plots of one run: one EncodedImage
    # the heading histogram: LineStrips2D of the sectors, Arrows2D of truth and estimate
    headings: ClassVar = Below(("rose",))
    # words on the map while the picture hardly tells places apart: one Points2D
    says_nothing: ClassVar = Below(("match", "says_nothing"))
    circles: ClassVar = Below(("match", "circles"))  # match circles (thesis fig. 34): Points2D, one per entry
    best: ClassVar = Below(("match", "best"))  # the best five entries on the map: Points2D with their ranks
    # all that shows the best five entries; nothing is logged there itself
    contact_sheet: ClassVar = Below(("match", "pictures"))
    # what is seen where the run is: the picture of the reference nearest to its estimate, an EncodedImage
    here: ClassVar = Below(("here",))
    text: ClassVar = Below(("text",))  # text about this step: one TextDocument

    def __post_init__(self) -> None:
        if not self.label or "/" in self.label or self.label in RESERVED:
            raise ValueError(f"a run's label is a word without '/', not one of {RESERVED}: {self.label!r}")

    def at(self, *parts: str) -> str:
        """Return a path below this run: `at("belief", "particles")`."""
        return "/".join(("", escaped(self.label), *parts))

    def inside(self, *parts: str) -> str:
        """What the inside of an update shows: "before" and "after", the answer, words, bars."""
        return self.at("inside", *parts)

    def sensor(self, name: str, *parts: str) -> str:
        """What a pose sensor shows: words, pictures, marks in them and on the map."""
        return self.at("sensors", escaped(name), *parts)

    def key(self, name: str) -> str:
        """A strip above one of its maps, by its name in `drawing.keys`: one EncodedImage."""
        return self.at("key", name)

    def likelihood(self, channel: str) -> str:
        """A map of one channel's likelihood, or of "all" together: one EncodedImage."""
        return self.at("likelihood", channel)

    def match(self, rank: int) -> str:
        """The picture of the entry of this rank, with its caption below it: an EncodedImage each."""
        return self.at("match", "pictures", str(rank))

    def explain(self, *parts: str) -> str:
        """What explains a step: "table", "marks" on the map, or parts such as "card" and a reference."""
        return self.at("explain", *parts)

    def trace(self, quantity: str) -> str:
        """Scalars over the session, one entity per quantity."""
        return self.at("trace", quantity)


# Entity paths of what the runs of a comparison share; a run's own stand in `maurice_viz.entities`.

COMPARE = "/compare"
TEXT = "/compare/text"  # which run is closer at this step, or what a phase did to each: one TextDocument
WHY = "/compare/why"  # how that came about: one TextDocument
RESULT = "/compare/result"  # how they compare over the drive: one TextDocument, static
COMPARE_UNIT = "/compare/error-unit"  # TextDocument: what is plotted there, and its unit
MATCHES = "/compare/matches"  # what the small map shows: Points2D


def _of(label: str, *parts: str) -> str:
    return "/".join((COMPARE, "run", escaped(label), *parts))


def cloud_of(label: str) -> str:
    """A run's cloud on the shared map, thinned: Points2D."""
    return _of(label, "cloud")


def frame_of(label: str) -> str:
    """The frame of a run's close-ups: Transform3D; below it scale bar and captions."""
    return _of(label, "closeup")


def gap_of(label: str) -> str:
    """From a run's estimate to the truth: LineStrips2D."""
    return _of(label, "gap")


def taken_of(label: str) -> str:
    """Where a run's best match was taken: Points2D and Arrows2D."""
    return _of(label, "match")


def bars_of(label: str, *parts: str) -> str:
    """Histograms of the picture and of a run's best match: EncodedImage, and Points2D of titles."""
    return _of(label, "bars", *parts)


def truth_of(label: str, own_drive: bool = True) -> str:
    """The truth of a run: its own if it replays another drive than the first run."""
    return _of(label, "truth") if own_drive else TRUTH


def camera_of(label: str, own_drive: bool = True) -> str:
    """What a run's camera saw: its own where it replays another drive than the first run."""
    return _of(label, "camera") if own_drive else CAMERA
