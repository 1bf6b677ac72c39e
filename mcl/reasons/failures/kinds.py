"""The kinds of cause that a diagnosis names, and one finding: a time that a run was lost, and its cause.

docs/diagnose.md says which evidence decides for each kind, and in which order they are looked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...scoring.episodes import Episode

SENSOR, AMBIGUITY = "sensor", "ambiguity"
PROPOSAL, RESAMPLING = "impoverished", "resampling"
MOTION, KIDNAPPED, LEFT_MAP = "motion", "kidnapped", "left_map"
OUT_OF_PLANE = "out_of_plane"
LIBRARY_GAP, LIGHTING, VIEW = "library_gap", "lighting", "changed_view"
NUMERIC, DATA, UNKNOWN = "numeric", "data", "unknown"

CAUSES: Mapping[str, str] = {
    DATA: "the recording: dropped pictures, clock jumps",
    KIDNAPPED: "the robot was carried to another place, unseen by its odometry",
    LEFT_MAP: "the robot drove, or the cloud was driven, off the map",
    OUT_OF_PLANE: "the robot pitched or rolled, which a pose in the plane cannot follow",
    MOTION: "the robot moved in a way that the motion model excludes",
    NUMERIC: "all weights were zero, or all but one",
    LIBRARY_GAP: "no reference is near the true place",
    LIGHTING: "the light is not that of the references",
    AMBIGUITY: "other places look the same",
    VIEW: "something is in view that the references do not show, or the map changed",
    SENSOR: "the pictures fit wrong places better than the true one",
    RESAMPLING: "particles at the true place had weight, and were not copied, by chance",
    PROPOSAL: "no particle was at the true place",
    UNKNOWN: "none of these",
}  # in the order in which they are looked for

Value = float | str


@dataclass(frozen=True, slots=True)
class Failure:
    """One time that a run was lost or not localized, with the one cause that explains it."""

    kind: str  # a key of CAUSES
    first: int  # step at which the cause shows first
    episode: Episode  # when it was wrong
    evidence: Mapping[str, Value] = field(default_factory=dict)  # named numbers and words that decide
    truth_known: bool = True  # False: said without ground truth, from the evidence alone
    also: tuple[str, ...] = ()  # further kinds that had a part in it, the likelier first
