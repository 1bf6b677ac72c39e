"""The causes of a failure: one table, from which rules, verdicts, tours, lanes and reports take their names.

docs/diagnose.md says which evidence decides for each cause. An incident is what befell the robot or its
camera, whether or not it did harm; each kind of incident belongs to one cause. Incidents come from the events
of the log, from the truth beside the odometry, and from the pictures; each is left out where its source is
missing. `verdict` connects them with what a run did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from ..filter.localizer import Localizer
from ..scoring.episodes import Episode
from ..scoring.table import RunTable
from ..values import F64, NO_PICTURE, SOLID, Moment, Radii, StepRecord, compose_motions
from .surroundings import mean_level

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
    FLAT: CauseKind(
        "likelihood too flat", "the model of the laser says less than the motion noise takes away"
    ),
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
LEAPT = "leapt"  # odometry jumped, far faster than it ever went: expected (by odometry) and actual meters
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
    LEAPT: IncidentKind(MOTION, "odometry jumps", is_loud=True),
    TURNED: IncidentKind(MOTION, "the wheels slip"),
    DARK: IncidentKind(LIGHTING, "lights out", is_loud=True),
    LIGHTS: IncidentKind(LIGHTING, "the light changes"),
}
BEFALLING = frozenset(kind.cause for kind in INCIDENTS.values())  # causes that an incident tells of

OF_LASER: Mapping[str, str] = {VIEW: "the map changed", AMBIGUITY: "scans fit elsewhere"}  # titles


def title_of(kind: str, has_laser: bool) -> str:
    """Return a cause in a word or two, for a run with a laser or with a camera."""
    return OF_LASER[kind] if has_laser and kind in OF_LASER else CAUSES[kind].title


Value = float | str
SKIPPED, AWAY, CLOCK = "skipped", "gap", "clock"  # first words of the events of a live source that tell of it
OF_LIVE = {SKIPPED: "pictures skipped", AWAY: "the source was away", CLOCK: "clock set back"}  # titles
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
        """Whether the scans of a laser are its evidence."""
        return "scans" in self.evidence

    @property
    def of_live(self) -> str:
        """What of a live source explains a gap: a key of OF_LIVE; "" for a gap in the recording."""
        if self.kind != DATA:
            return ""
        return SKIPPED if "skipped" in self.evidence else str(self.evidence.get("source", ""))

    @property
    def title(self) -> str:
        """The cause in a word or two."""
        if self.of_live:
            return OF_LIVE[self.of_live]
        if self.kind == MOUNT and "ahead_m" in self.evidence:
            return "laser misplaced"
        is_dark = self.kind == LIGHTING and float(self.evidence.get("brightness", 1.0)) <= TOO_DARK
        return "too dark" if is_dark else title_of(self.kind, self.has_laser)


# Incidents: what befell the robot or its camera during a drive.

FAR_FASTER, FASTER_AFTER = 4.0, 5  # times as fast as odometry ever was; updates that tell how fast that is
SLIP_SHARE = 0.5  # of the longer distance that truth and odometry must differ by
DARKER_SHARE = 2 / 3  # of the gray level of the darkest picture before, and of the darkest reference
DARK_UPDATES = 3  # in a row, unless the log tells of another light
SEEN_PICTURES = 5  # that must have been seen before one is dark
DEEP_CELLS = 1.0  # of the map's raster: nearer to its outline a pose may be off, or a cell too large
ALIKE_SHARE = 0.5  # of the usual scatter of the references' likelihoods: below it they score alike


@dataclass(frozen=True, slots=True)
class Incident:
    """One thing that befell a drive, from one step to another; its kind says what the values are."""

    kind: str  # a key of INCIDENTS
    step: int
    last: int
    expected: float | None = None
    actual: float | None = None
    words: str = ""  # of the log
    alike: bool = False  # of dark pictures: whether this run's references score alike since then

    @property
    def about(self) -> IncidentKind:
        """What is known of its kind."""
        return INCIDENTS[self.kind]

    @property
    def shown_at(self) -> int:
        """The step at which it is seen best: a slip at its end, all else at once."""
        return self.last if self.about.shows_at_end else self.step


@dataclass(slots=True)
class IncidentFinder:
    """Follows the drive of one run update by update; keeps a few numbers."""

    incidents: tuple[Incident, ...] = ()
    levels: F64 | None = None  # (L, 3) of the references; None: not known how dark a view may be
    _truth: F64 | None = None  # of the update before
    _time_s: float = float("nan")  # of the update before
    _fastest_m_s: float = 0.0  # of odometry, jumps apart
    _moved: int = 0  # updates before which odometry moved
    _gray: list[float] = field(default_factory=list)  # of the last pictures before it got dark
    _scatter: list[float] = field(default_factory=list)  # of the references' likelihoods, of the same
    _least: float = np.inf  # gray level of the darkest of all these
    _seen: int = 0
    _sum: float = 0.0  # of their gray levels
    _told: bool = False  # whether the log tells of the light that is dark now
    _dark: list[tuple[int, float, float]] = field(default_factory=list)  # step, gray and scatter since then

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        self._drive(moment, record.estimate.radii)
        self._look(moment.frame.step, record, bool(moment.told("lights")))

    def _drive(self, moment: Moment, radii: Radii) -> None:
        """Process what truth, odometry and log tell of the next update, without its picture."""
        step, truth, before = moment.frame.step, moment.truth, self._truth
        moved_m = None if truth is None or before is None else float(np.hypot(*(truth - before)[:2]))
        self._truth = truth
        slips = moment.told("slip")
        turns = [text for text in slips if "deg" in text]
        if moment.kidnapped:
            self._add(Incident(CARRIED, step, step, None, moved_m))
        elif moved_m is not None:
            slip_m = 0.0 if len(turns) < len(slips) else radii.confidence_m / 2
            leapt = self._leaps(driven(moment.frame.motions), moment.frame.time_s)
            self._compare(step, moment.frame.motions, moved_m, slip_m, radii.lost_m, leapt=leapt)
        self._time_s = moment.frame.time_s
        for kind, texts in ((TURNED, turns), (LIGHTS, moment.told("lights"))):
            if texts:
                self._add(Incident(kind, step, step, words=texts[0]))

    def _add(self, incident: Incident) -> None:
        self.incidents = (*self.incidents, incident)

    def _leaps(self, driven_m: float, time_s: float) -> bool:
        """Return whether odometry is far faster than it ever was."""
        passed_s = time_s - self._time_s
        speed = driven_m / passed_s if passed_s > 0 else 0.0
        if self._moved >= FASTER_AFTER and speed > FAR_FASTER * self._fastest_m_s:
            return True
        self._fastest_m_s, self._moved = max(self._fastest_m_s, speed), self._moved + (speed > 0)
        return False

    def _compare(
        self, step: int, motions: F64, moved_m: float, slip_m: float, jump_m: float, *, leapt: bool
    ) -> None:
        """Compare how far the robot moved with what odometry says."""
        driven_m = driven(motions)
        if leapt and driven_m - moved_m > jump_m:
            self._add(Incident(LEAPT, step, step, driven_m, moved_m))
            return
        if moved_m - driven_m > jump_m:
            self._add(Incident(JUMPED, step, step, driven_m, moved_m))
        if driven_m - moved_m <= max(slip_m, SLIP_SHARE * driven_m):
            return
        last = self.incidents[-1] if self.incidents else None
        if last is not None and last.kind == SLIPPED and last.last == step - 1:
            expected, actual = (last.expected or 0.0) + driven_m, (last.actual or 0.0) + moved_m
            slip = replace(last, last=step, expected=expected, actual=actual)
            self.incidents = (*self.incidents[:-1], slip)
        else:
            self._add(Incident(SLIPPED, step, step, driven_m, moved_m))

    def _look(self, step: int, record: StepRecord, log_tells: bool) -> None:
        """Look whether the picture is darker than the place can be; not where none was compared."""
        likelihood = record.sighting.comparison.log_likelihood
        if not len(likelihood) or record.frame.image is NO_PICTURE:
            return
        gray = mean_level(record.frame.image)
        scatter = float(np.std(likelihood))
        self._told = log_tells or (self._told and bool(self._dark))
        if not self._is_dark(gray):
            self._seen, self._least, self._dark = self._seen + 1, min(self._least, gray), []
            self._sum += gray
            self._gray = [*self._gray, gray][-SEEN_PICTURES:]
            self._scatter = [*self._scatter, scatter][-SEEN_PICTURES:]
            return
        begins = len(self._dark) == (0 if log_tells else DARK_UPDATES - 1)
        self._dark.append((step, gray, scatter))
        first, after = self._dark[0][0], float(np.mean([gray for _, gray, _ in self._dark]))
        usual_scatter = float(np.mean(self._scatter))
        alike = float(np.mean([scatter for *_, scatter in self._dark])) < ALIKE_SHARE * usual_scatter
        dark = Incident(DARK, first, step, float(np.mean(self._gray)), after, alike=alike)
        same = [(incident.kind, incident.step) == (DARK, first) for incident in self.incidents]
        if begins and not any(same):
            self._add(dark)
        else:
            pairs = zip(self.incidents, same, strict=True)
            self.incidents = tuple(dark if is_same else incident for incident, is_same in pairs)

    def _is_dark(self, gray: float) -> bool:
        """Return whether a picture is dark: darker than all before, and than any view of the library.

        A view that is darker by itself is in the library as well. Where the whole drive is darker than the
        library, its views may be so, too. Where no library tells, a dark picture is nearly black.
        """
        if self._seen < SEEN_PICTURES or gray >= DARKER_SHARE * self._least:
            return False
        usual = self._sum / self._seen
        if self._told or self.levels is None:
            return self._told or gray <= TOO_DARK * usual
        views = self.levels.mean(axis=1)
        dimmer = min(1.0, usual / max(float(np.median(views)), 1e-9))
        return gray < DARKER_SHARE * dimmer * float(views.min())


def driven(motions: F64) -> float:
    """Return how far in meters the movements (M, 3) of one update lead."""
    return float(np.hypot(*reduce(compose_motions, motions)[:2])) if len(motions) else 0.0


# A robot where the map has an obstacle: a filter that trusts the map has no particle there.


@dataclass(frozen=True, slots=True)
class InObstacle:
    """Updates in a row at which the truth was inside an obstacle of the map."""

    obstacle: str  # its name
    first: int  # step
    last: int


def stays_in_obstacles(run: RunTable, localizer: Localizer | None) -> tuple[InObstacle, ...]:
    """Return when the truth of a run was inside obstacles that its filter knows and does not doubt."""
    if localizer is None or localizer.obstacles != SOLID:
        return ()
    deep_m, places, names = DEEP_CELLS * localizer.reference.grid.cell_m, run.truths[:, :2], dict[int, str]()
    for obstacle in reversed(localizer.library.arena.obstacles):  # of several the first
        low, high = obstacle.polygon.min(axis=0), obstacle.polygon.max(axis=0)
        around = np.flatnonzero(((places >= low) & (places <= high)).all(axis=1))
        inside = around[obstacle.depth_m(places[around]) > deep_m]
        names |= dict.fromkeys(inside.tolist(), obstacle.name)
    stays = list[InObstacle]()
    for update, name in sorted(names.items()):
        step = int(run.steps[update])
        if stays and (stays[-1].obstacle, stays[-1].last) == (name, step - 1):
            stays[-1] = replace(stays[-1], last=step)
        else:
            stays.append(InObstacle(name, step, step))
    return tuple(stays)
