"""Every entity path and every timeline, once.

What belongs to one run stands under `/<run label>/`; what runs share stands under `/world` (it never
changes) and `/session` (what was seen and, if known, what was true).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

from .style import font_safe

STEP = "step"  # sequence: the number of the picture; shows the weighted cloud
SESSION = "session"  # duration in seconds since the session's first record
PHASE = "phase"  # sequence: 6 * step + slot; shows the phases of one update

PHASES_PER_STEP = 6  # phases of one update on the phase timeline, whether or not they are filled

WORLD = "/world"
FLOORS = "/world/floors"
BARE_FLOORS = "/world/floors-bare"  # without names and ruler, for small maps and close-ups
WALLS = "/world/walls"
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


@lru_cache(maxsize=64)
def escaped(label: str) -> str:
    """Write a label as one part of an entity path: Rerun wants a backslash before spaces and signs."""
    return re.sub(r"([^\w.-])", r"\\\1", font_safe(label))


@dataclass(frozen=True, slots=True)
class RunPaths:
    """Where one run is drawn. The label is unique in a recording and not one of `RESERVED`."""

    label: str

    def __post_init__(self) -> None:
        if not self.label or "/" in self.label or self.label in RESERVED:
            raise ValueError(f"a run's label is a word without '/', not one of {RESERVED}: {self.label!r}")

    def at(self, *parts: str) -> str:
        """Return a path below this run: `at("belief", "particles")`."""
        return "/".join(("", escaped(self.label), *parts))

    @property
    def particles(self) -> str:
        """The cloud: Points2D, one per particle."""
        return self.at("belief", "particles")

    @property
    def estimate(self) -> str:
        """The scored estimate: one Points2D, an Arrows2D along its heading, a LineStrips2D of its past."""
        return self.at("belief", "estimate")

    @property
    def name(self) -> str:
        """The run's name above its estimate: Points2D."""
        return self.at("name")

    @property
    def ellipses(self) -> str:
        """Two standard deviations of the weighted cloud: LineStrips2D."""
        return self.at("belief", "estimate", "ellipses")

    @property
    def mode_rings(self) -> str:
        """Where the modes are: LineStrips2D, each in a color that it keeps."""
        return self.at("belief", "modes")

    def inside(self, *parts: str) -> str:
        """What the inside of an update shows: "before" and "after", the answer, words, bars."""
        return self.at("inside", *parts)

    @property
    def closeup(self) -> str:
        """The frame of the view that follows the cloud: one Transform3D, with a bar under it."""
        return self.at("closeup")

    def sensor(self, name: str, *parts: str) -> str:
        """What a pose sensor shows: words, pictures, marks in them and on the map."""
        return self.at("sensors", escaped(name), *parts)

    def key(self, name: str) -> str:
        """A strip above one of its maps, by its name in `drawing.keys`: one EncodedImage."""
        return self.at("key", name)

    @property
    def line_key(self) -> str:
        """The key of the plot of evidence: one EncodedImage."""
        return self.at("key", "evidence")

    @property
    def marks_key(self) -> str:
        """The key of the other plots of one run: one EncodedImage."""
        return self.at("key", "marks")

    @property
    def headings(self) -> str:
        """The heading histogram: LineStrips2D of the sectors, Arrows2D of truth and estimate."""
        return self.at("rose")

    @property
    def says_nothing(self) -> str:
        """Words on the map while the picture hardly tells places apart: one Points2D."""
        return self.at("match", "says_nothing")

    @property
    def circles(self) -> str:
        """Match circles (thesis fig. 34): Points2D, one per library entry."""
        return self.at("match", "circles")

    @property
    def best(self) -> str:
        """The best five entries on the map: Points2D with their ranks."""
        return self.at("match", "best")

    def likelihood(self, channel: str) -> str:
        """A map of one channel's likelihood, or of "all" together: one EncodedImage."""
        return self.at("likelihood", channel)

    @property
    def contact_sheet(self) -> str:
        """All that shows the best five entries; nothing is logged there itself."""
        return self.at("match", "pictures")

    def match(self, rank: int) -> str:
        """The picture of the entry of this rank, with its caption below it: an EncodedImage each."""
        return self.at("match", "pictures", str(rank))

    @property
    def text(self) -> str:
        """Text about this step: one TextDocument."""
        return self.at("text")

    def explain(self, *parts: str) -> str:
        """What explains a step: "table", "marks" on the map, or parts such as "card" and a reference."""
        return self.at("explain", *parts)

    def trace(self, quantity: str) -> str:
        """Scalars over the session, one entity per quantity."""
        return self.at("trace", quantity)


# Entity paths of what the runs of a comparison share; a run's own stand in `maurice_viz.entities`.

COMPARE = "/compare"
TEXT = "/compare/text"  # who is closer at this step, and why: one TextDocument
RESULT = "/compare/result"  # how they compare over the drive: one TextDocument, static
COMPARE_CLOSEUP = "/compare/closeup"  # the frame that holds all clouds: Transform3D


def _of(label: str, *parts: str) -> str:
    return "/".join((COMPARE, "run", escaped(label), *parts))


def cloud_of(label: str) -> str:
    """A run's cloud on the shared map, thinned: Points2D."""
    return _of(label, "cloud")


def gap_of(label: str) -> str:
    """From a run's estimate to the truth: LineStrips2D."""
    return _of(label, "gap")


def bars_of(label: str, *parts: str) -> str:
    """Histograms of the picture and of a run's best match: EncodedImage, and Points2D of titles."""
    return _of(label, "bars", *parts)


def truth_of(label: str, own_drive: bool = True) -> str:
    """The truth of a run: its own if it replays another drive than the first run."""
    return _of(label, "truth") if own_drive else TRUTH


def camera_of(label: str, own_drive: bool = True) -> str:
    """What a run's camera saw: its own where it replays another drive than the first run."""
    return _of(label, "camera") if own_drive else CAMERA
