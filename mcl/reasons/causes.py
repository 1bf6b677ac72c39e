"""The causes of a failure: one table, from which rules, verdicts, tours, lanes and reports take their names.

docs/diagnose.md says which evidence decides for each cause. An incident is what befell the robot or its
camera, whether or not it did harm; each kind of incident belongs to one cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..scoring.episodes import Episode

SENSOR, AMBIGUITY = "sensor", "ambiguity"
PROPOSAL, RESAMPLING = "impoverished", "resampling"
MOTION, KIDNAPPED, LEFT_MAP = "motion", "kidnapped", "left_map"
OUT_OF_PLANE = "out_of_plane"
LIBRARY_GAP, LIGHTING, VIEW = "library_gap", "lighting", "changed_view"
NUMERIC, DATA, UNKNOWN = "numeric", "data", "unknown"
START, MOUNT, WRONG_MAP = "wrong_start", "mount", "wrong_map"
UNSEEN, FLAT = "unseen_walls", "flat_sensor"


@dataclass(frozen=True, slots=True)
class CauseKind:
    """A cause as people read it."""

    title: str  # in a word or two
    meaning: str  # in a line


CAUSES: Mapping[str, CauseKind] = {
    DATA: CauseKind("gap in the recording", "dropped pictures, clock jumps"),
    KIDNAPPED: CauseKind("carried away", "the robot was carried to another place, unseen by its odometry"),
    LEFT_MAP: CauseKind("off the map", "the robot drove, or the cloud was driven, off the map"),
    OUT_OF_PLANE: CauseKind("tilted", "the robot pitched or rolled, which a pose in the plane cannot follow"),
    MOTION: CauseKind("odometry misled", "the robot moved in a way that the motion model excludes"),
    NUMERIC: CauseKind("no weight left", "all weights were zero, or all but one"),
    MOUNT: CauseKind("laser turned", "the laser is mounted otherwise than the recording says"),
    WRONG_MAP: CauseKind("wrong map", "the scans fit nowhere on the map better than by chance"),
    UNSEEN: CauseKind("walls not seen", "beams pass through walls of the map, or come back from nothing"),
    LIBRARY_GAP: CauseKind("no reference near", "no reference is near the true place"),
    LIGHTING: CauseKind("the light changed", "the light is not that of the references"),
    VIEW: CauseKind(
        "the view changed", "something is in view that the references do not show, or the map changed"
    ),
    SENSOR: CauseKind("pictures fit elsewhere", "the pictures fit wrong places better than the true one"),
    START: CauseKind("wrong start", "the filter began where the robot was not"),
    FLAT: CauseKind("sensor too flat", "the model of the laser says less than the motion noise takes away"),
    RESAMPLING: CauseKind(
        "chance in resampling", "particles at the true place had weight, and were not copied, by chance"
    ),
    AMBIGUITY: CauseKind("places look alike", "other places look the same"),
    PROPOSAL: CauseKind("no particle there", "no particle was at the true place"),
    UNKNOWN: CauseKind("not known", "none of these"),
}  # in the order in which they are looked for

CARRIED = "carried"  # the log says so: expected None, actual meters
JUMPED = "jumped"  # the truth moved much farther than odometry says: expected and actual meters
SLIPPED = "slipped"  # odometry went on while the robot did not: expected and actual meters
OVERSTATED = "overstated"  # the same where odometry is made from pictures: no wheel slipped
TURNED = "turned"  # the log tells of a slip: its words
DARK = "dark"  # pictures darker than any before: expected and actual mean gray level, 0 to 255
LIGHTS = "lights"  # the log tells of another light: its words


@dataclass(frozen=True, slots=True)
class IncidentKind:
    """A kind of incident, and the cause that it belongs to."""

    cause: str  # a key of CAUSES
    title: str  # in a word or two
    is_loud: bool = False  # whether it is told even where it did no harm
    shows_at_end: bool = False  # whether it is seen best at its last step


INCIDENTS: Mapping[str, IncidentKind] = {
    CARRIED: IncidentKind(KIDNAPPED, "kidnapped", is_loud=True),
    JUMPED: IncidentKind(KIDNAPPED, "the truth jumps", is_loud=True),
    SLIPPED: IncidentKind(MOTION, "the wheels slip", is_loud=True, shows_at_end=True),
    OVERSTATED: IncidentKind(MOTION, "odometry too long", shows_at_end=True),
    TURNED: IncidentKind(MOTION, "the wheels slip"),
    DARK: IncidentKind(LIGHTING, "lights out", is_loud=True),
    LIGHTS: IncidentKind(LIGHTING, "the light changes"),
}
BEFALLING = frozenset(kind.cause for kind in INCIDENTS.values())  # causes that an incident tells of

OF_LASER: Mapping[str, str] = {VIEW: "the map changed", AMBIGUITY: "scans fit elsewhere"}  # titles

Value = float | str
TOO_DARK = 0.2  # of the expected brightness, at most: nothing can be seen


@dataclass(frozen=True, slots=True)
class Failure:
    """One time that a run was lost or not localized, with the one cause that explains it: its diagnosis."""

    kind: str  # a key of CAUSES
    first: int  # step at which the cause shows first
    episode: Episode  # when it was wrong
    evidence: Mapping[str, Value] = field(default_factory=dict)  # named numbers and words that decide
    truth_known: bool = True  # False: said without ground truth, from the evidence alone
    also: tuple[str, ...] = ()  # further causes that had a part in it, the likelier first

    @property
    def has_laser(self) -> bool:
        """Whether it is said of the scans of a laser."""
        return "scans" in self.evidence

    @property
    def title(self) -> str:
        """The cause in a word or two."""
        if self.has_laser and self.kind in OF_LASER:
            return OF_LASER[self.kind]
        is_dark = self.kind == LIGHTING and float(self.evidence.get("brightness", 1.0)) <= TOO_DARK
        return "too dark" if is_dark else CAUSES[self.kind].title
