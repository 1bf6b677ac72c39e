"""Entity paths of what the runs of a comparison share; a run's own stand in `maurice_viz.entities`."""

from __future__ import annotations

from . import entities
from .entities import RunPaths, escaped

COMPARE = "/compare"
TEXT = "/compare/text"  # how the runs differ at this step: one TextDocument
RESULT = "/compare/result"  # how they compare over the drive: one TextDocument, static
RUNS_KEY = "/compare/key/runs"
BELIEF_KEY = "/compare/key/belief"
CIRCLE_KEY = "/compare/key/circles"
POSITION_DIFFERENCE = (
    "/compare/trace/position"  # Scalars, one a run but the first: its error minus the first's
)
HEADING_DIFFERENCE = "/compare/trace/heading"
APART = "/compare/trace/apart"  # Scalars, one a run but the first: from its estimate to the first's


def _of(label: str, *parts: str) -> str:
    return "/".join((COMPARE, "run", escaped(label), *parts))


def cloud_of(label: str) -> str:
    """A run's cloud on the shared map, thinned: Points2D."""
    return _of(label, "cloud")


def parted_of(label: str) -> str:
    """When a run parted from the first one: one Scalars, a mark on the plot of distances."""
    return _of(label, "parts")


def truth_of(label: str, own_drive: bool = True) -> str:
    """The truth that a run is measured by: its own where it replays another drive than the first run."""
    return _of(label, "truth") if own_drive else entities.TRUTH


def camera_of(label: str, own_drive: bool = True) -> str:
    """What a run's camera saw: its own where it replays another drive than the first run."""
    return _of(label, "camera") if own_drive else entities.CAMERA


def estimate_of(label: str) -> str:
    """A run's estimate, as everywhere."""
    return RunPaths(label).estimate
