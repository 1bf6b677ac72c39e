"""The verdict: what happened to one run, as facts. `maurice_viz.text.verdict` turns it into a sentence.

Its `episodes` are when it was wrong, its `incidents` what befell the robot, its `failures` why it was lost,
its `ambiguity` two places that explained the pictures about as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from ..filter.estimate import modes
from ..filter.localizer import LEFT_MAP, Localizer
from ..scoring.comparison import OdometryAlone, odometry_alone
from ..scoring.episodes import Episode, RunSoFar, episodes, standing
from ..scoring.metrics import FIRST_SCORED, StepScore, score_step
from ..scoring.table import KIDNAPPED, SEARCHING, RunTable, Standing, TableRows
from ..sensor.laser.parameters import LaserParameters
from ..sensor.laser.sensor import LASER, Laser
from ..values import F64, USUAL, Moment, OccupancyMap, Radii, StepRecord
from .causes import (
    BEFALLING,
    CARRIED,
    Failure,
    Incident,
    IncidentFinder,
    InObstacle,
    stays_in_obstacles,
)
from .diagnosis import DiagnosisBuilder
from .surroundings import levels_of

KEPT_SHARE = 0.5  # of the updates since it was localized: below that a run did not stay so
DUE_STEPS = 10  # after an incident, in which a loss is due to it
SECOND_SHARE = 0.25  # of the weight, that the second of two places needs
BOTH_SHARE = 0.7  # of the weight, that both need
APART_RADII = 2.0  # times the radius *converged* that they are apart at least
LASTING_UPDATES = 2  # in a row


@dataclass(frozen=True, slots=True)
class Ambiguity:
    """The updates in which two places shared the weight; the numbers are those of the most even update."""

    step: int  # the most even update
    first: int  # update of these
    last: int
    shares: tuple[float, float]
    apart_m: float
    truth_in: int | None  # 1 or 2: the place that holds the truth; 0: neither; None: not known
    fits: tuple[float, float] | None = None  # mean quality of their particles; None: not compared
    usual: float | None = None  # median quality of all references

    @property
    def is_lasting(self) -> bool:
        """Whether it lasted for more than one update."""
        return self.last - self.first + 1 >= LASTING_UPDATES


@dataclass(frozen=True, slots=True)
class SureAndWrong:
    """The update at which a confident cloud was farthest from the truth."""

    step: int
    error_m: float
    share: float  # of the weight, near the estimate
    bereft: bool = False  # whether no particle was near the truth


@dataclass(frozen=True, slots=True)
class RunVerdict:
    """A summary of one run. Steps are numbers of pictures, lengths in meters."""

    updates: int = 0
    unjudged: int = 0  # of them those without a true pose
    has_truth: bool = False
    has_laser: bool = False  # whether it ran on a map in place of references
    laser: LaserParameters | None = None  # of its model of the laser; None: it has none, or not known
    draws_new: str | None = None  # where its filter draws new particles: DRAWS_NEVER, ...; None: not known
    localized: int | None = None  # first step at which the run was localized; None: never, or truth not known
    first: int = 0  # step of the first update
    last: int = 0  # and of the last one
    episodes: tuple[Episode, ...] = ()  # each time that it was wrong; none without truth
    doubts: tuple[tuple[int, int], ...] = ()  # first and last step of each time that it was probably lost
    error_mean_m: float | None = None  # over the scored updates, as in the table of scores
    error_most_m: float | None = None  # of these
    most_at: int = 0  # step of the largest error
    off: int = 0  # updates that were not correct
    sure: int = 0  # updates at which it was localized: correct and converged
    sure_lately: int = 0  # of these the last ones, in a row
    kept_share: float = 1.0  # of the updates since it was localized first, at which it was localized
    beyond: int = 0  # of these, those that were too far off: beyond the radius *lost*, or 45 degrees
    end: StepScore | None = None  # of the last update with truth
    radii: Radii = USUAL  # by which it was judged
    converged_share: float = 0.0  # of the updates
    left_map: tuple[int, ...] = ()  # steps at which the whole cloud would have left the map
    in_obstacles: tuple[InObstacle, ...] = ()  # when the truth was where the map has something solid
    incidents: tuple[Incident, ...] = ()  # what befell the robot and its camera
    failures: tuple[Failure, ...] = ()  # each time it was lost or never localized, with its one cause
    ambiguity: Ambiguity | None = None  # two places that shared the weight
    sure_and_wrong: SureAndWrong | None = None  # the worst update of this kind
    now: Standing | None = None  # how it stands at the last update; None: not known
    odometry_alone: OdometryAlone | None = None  # without its sensors; None: no known start, or no truth

    @property
    def every_step(self) -> str:
        """What was judged, in words: "every step", or how many."""
        judged = self.updates - self.unjudged
        some = "the only step" if judged == 1 else f"each of the {judged} steps"
        return f"{some} with a true pose" if self.unjudged else "every step"

    @property
    def judged(self) -> int:
        """How many updates have a true pose."""
        return self.updates - self.unjudged

    @property
    def right(self) -> int:
        """At how many of these it was correct, sure of it or not."""
        return self.judged - self.off

    @property
    def is_kept(self) -> bool:
        """Whether it was localized, and at most of the updates since then."""
        return self.localized is not None and self.kept_share >= KEPT_SHARE

    @property
    def error_end_m(self) -> float | None:
        """The error of the last estimate with truth."""
        return None if self.end is None else self.end.error_m

    def incident_of(self, episode: Episode) -> Incident | None:
        """Return the latest incident that an episode can be due to: at first the loud ones."""
        if episode.kind == KIDNAPPED:
            recent = [incident for incident in self.incidents if incident.step == episode.first]
        else:
            onset = episode.onset
            recent = [i for i in self.incidents if i.step <= onset <= i.last + DUE_STEPS]
        chosen = [incident for incident in recent if incident.about.is_loud] or recent
        return chosen[-1] if chosen else None

    def has_loud_incident(self, episode: Episode) -> bool:
        """Return whether something befell the robot right before an episode, which is reported on its own."""
        incident = self.incident_of(episode)
        return episode.kind == KIDNAPPED or (incident is not None and incident.about.is_loud)

    @property
    def unexplained(self) -> Failure | None:
        """The first failure that no loud incident explains, as those are reported on their own."""
        is_loud = any(map(self.has_loud_incident, self.episodes))
        return next((f for f in self.failures if not (is_loud and f.kind in BEFALLING)), None)

    @property
    def telling(self) -> Ambiguity | None:
        """The two places that shared the weight, where this tells something: before it was localized."""
        ambiguity = self.ambiguity
        if ambiguity is None or any(e.kind == KIDNAPPED or e.is_sure for e in self.episodes):
            return None
        return ambiguity if self.localized is None or ambiguity.step < self.localized else None

    @property
    def telling_incidents(self) -> tuple[Incident, ...]:
        """What befell the robot, without what is small and explains no episode."""
        explaining = [self.incident_of(e) for e in self.episodes if e.kind != SEARCHING or e.is_failure]
        return tuple(i for i in self.incidents if i.about.is_loud or i in explaining)

    @property
    def decisive(self) -> int:
        """The step to look at first: that of a loss, else of an incident, else of the worst error."""
        return self._moments()[0][1]

    def _moments(self) -> list[tuple[int, int]]:
        """Return the steps worth a look, each with its rank, the first to look at first."""
        losses = [episode for episode in self.episodes if episode.kind != SEARCHING or episode.is_sure]
        loud = [incident for incident in self.incidents if incident.about.is_loud]
        late = self.localized if self.localized is not None and self.localized > self.first + 1 else None
        sure = self.sure_and_wrong if self.localized is None else None
        ranked = (
            self._shown(losses[0]) if losses else None,
            self.failures[0].first if self.failures and not self.has_truth else None,
            None if self.telling is None else self.telling.step,
            loud[0].shown_at if loud else None,
            late,
            None if sure is None else sure.step,
            None if self.error_most_m is None else self.most_at,
            self.failures[0].first if self.failures else None,
            self.left_map[0] if self.left_map else None,
            self.first,
        )
        return [(rank, step) for rank, step in enumerate(ranked) if step is not None]

    def _shown(self, episode: Episode) -> int:
        """Return the step at which an episode is seen best."""
        sure = self.sure_and_wrong
        if self.has_loud_incident(episode) or not episode.is_sure or sure is None:
            return episode.first
        return max(sure.step, episode.first)


def shared_kidnappings(runs: Sequence[RunVerdict]) -> list[int]:
    """Return the steps of the kidnappings in the log, if all runs share them."""
    steps = [[incident.step for incident in run.incidents if incident.kind == CARRIED] for run in runs]
    return steps[0] if all(others == steps[0] for others in steps) else []


def shared_incidents(runs: Sequence[RunVerdict]) -> list[Incident]:
    """Return what befell all runs of a drive and tells something of any, without kidnappings in the log."""
    keys = dict.fromkeys((i.kind, i.step) for run in runs for i in run.telling_incidents if i.kind != CARRIED)
    by_key = [{(i.kind, i.step): i for i in run.incidents} for run in runs]
    return [by_key[0][key] for key in keys if all(key in incidents for incidents in by_key)]


def decisive_step(verdicts: Mapping[str, RunVerdict]) -> int:
    """Return the step to look at first: where a run failed, before where another one merely was worst."""
    return min((not verdict.failures, *verdict._moments()[0]) for verdict in verdicts.values())[-1]


def most_even(divided: Mapping[int, Ambiguity]) -> Ambiguity | None:
    """Return the most even of divided updates, by their numbers, of those that are two or more in a row."""
    rows = groupby(enumerate(divided), key=lambda pair: pair[1] - pair[0])
    stays = [[divided[update] for _, update in row] for _, row in rows]
    even = [
        replace(max(row, key=lambda update: update.shares[1]), first=row[0].step, last=row[-1].step)
        for row in stays
    ]
    lasting = [ambiguity for ambiguity in even if ambiguity.is_lasting]
    return max(lasting, key=lambda ambiguity: ambiguity.shares[1], default=None)


def _divided(step: int, record: StepRecord, truth: F64 | None) -> Ambiguity | None:
    """Return how the weight of one update is divided between two places; None where it is not."""
    estimate = record.estimate
    if not BOTH_SHARE / 2 <= estimate.mass <= 1 - SECOND_SHARE:
        return None
    first, second = (*modes(record.weighted, estimate.radii), None, None)[:2]
    if first is None or second is None or second.mass < SECOND_SHARE or first.mass + second.mass < BOTH_SHARE:
        return None
    apart_m = float(np.hypot(*(first.pose - second.pose)[:2]))
    reach_m = estimate.radii.cluster_m
    if apart_m < APART_RADII * reach_m:
        return None
    truth_in = None
    if truth is not None:
        off_m = [float(np.hypot(*(mode.pose - truth)[:2])) for mode in (first, second)]
        truth_in = int(np.argmin(off_m)) + 1 if min(off_m) <= reach_m else 0
    fits = [_fit(record, mode.pose, reach_m) for mode in (first, second)]
    quality = record.sighting.comparison.quality
    known = bool(record.sighting.comparison.channels) and None not in fits
    return Ambiguity(
        *(step, step, step),
        (first.mass, second.mass),
        apart_m,
        truth_in,
        (fits[0] or 0.0, fits[1] or 0.0) if known else None,
        float(np.median(quality)) if known else None,
    )


def _fit(record: StepRecord, pose: F64, reach_m: float) -> float | None:
    """Return how well the picture fits a place: the mean quality of the particles there, by weight."""
    weighted, entries = record.weighted, record.sighting.entries
    x, y = pose[:2] - weighted.origin
    near = np.square(weighted.poses[:, 0] - x) + np.square(weighted.poses[:, 1] - y) <= reach_m**2
    near &= entries >= 0
    quality, weights = record.sighting.comparison.quality, weighted.weights[near]
    if not len(quality) or not weights.sum() > 0:
        return None
    return float(np.average(quality[entries[near]], weights=weights))


@dataclass(slots=True)
class VerdictBuilder:
    """Follows one run update by update; keeps a few numbers and no cloud.

    With the run's `localizer` its failures are diagnosed by references, motion and map, too.
    """

    localizer: Localizer | None = None
    occupancy: InitVar[OccupancyMap | None] = None  # that scans of a run without one are laid on
    start: InitVar[F64 | None] = None  # (3,) where the run began, for odometry alone
    _incidents: IncidentFinder = field(default_factory=IncidentFinder)
    _divided: dict[int, Ambiguity] = field(default_factory=dict)  # by the numbers of updates
    _diagnosis: DiagnosisBuilder = field(default_factory=DiagnosisBuilder)

    def __post_init__(self, occupancy: OccupancyMap | None, start: F64 | None) -> None:
        localizer = self.localizer
        run = RunSoFar(TableRows(start=start, localizer=localizer))
        unknown = None if localizer is not None else occupancy
        self._diagnosis = DiagnosisBuilder(localizer, unknown, run=run)
        if localizer is not None:
            self._incidents = IncidentFinder(levels=levels_of(localizer.library))

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        self._incidents.see(moment, record)
        divided = _divided(moment.frame.step, record, moment.truth)
        if divided is not None:
            self._divided[self.run.rows.updates] = divided
        self._diagnosis.add(moment, record)

    @property
    def run(self) -> RunSoFar:
        """The run up to now, for all who read its rows and its lost signal."""
        return self._diagnosis.run

    @property
    def table(self) -> RunTable:
        """The run as a table, up to now."""
        return self.run.rows.table()

    @property
    def now(self) -> Standing | None:
        """How the run stands at the last update; costs little, other than a verdict."""
        return self.run.recent.standing()

    def result(self) -> RunVerdict:
        """Return the verdict up to now."""
        failures, run = self._diagnosis.result(), self.table
        history = episodes(run)
        figures = _figures(run, history.localized)
        suspected = tuple((failure.episode.first, failure.episode.last) for failure in failures)
        laser = None if self.localizer is None else self.localizer.sensor.sensors.get(LASER)
        return replace(
            RunVerdict(**figures),
            laser=laser.parameters if isinstance(laser, Laser) else None,
            draws_new=None if self.localizer is None else self.localizer.draws_new,
            localized=history.localized,
            episodes=history.episodes,
            has_laser=self._diagnosis.has_laser,
            doubts=self._diagnosis.doubts if run.known.any() else suspected,
            in_obstacles=stays_in_obstacles(run, self.localizer),
            incidents=self._incidents.incidents,
            failures=failures,
            ambiguity=most_even(self._divided),
            now=standing(run),
            odometry_alone=None if self.localizer is None else odometry_alone(run, self.localizer),
        )


def _figures(run: RunTable, localized: int | None) -> dict[str, Any]:
    """Return what a verdict has of a run's table; `localized` is the first step at which it was."""
    if not run.updates:
        return {}
    known, error_m = run.known, run.error_m
    sure, since = run.is_localized[known], run.steps[known] >= (localized or 0)
    scored = known & (np.arange(run.updates) >= FIRST_SCORED - 1)
    figures = {
        "updates": run.updates,
        "unjudged": int((~known).sum()),
        "has_truth": bool(known.any()),
        "first": int(run.steps[0]),
        "last": int(run.steps[-1]),
        "radii": run.radii,
        "left_map": tuple(
            step for step, events in zip(run.steps.tolist(), run.events, strict=True) if LEFT_MAP in events
        ),
        "converged_share": float(run.is_converged.mean()),
        "off": int((known & ~run.is_correct).sum()),
        "beyond": int(run.is_off.sum()),
        "sure": int(sure.sum()),
        "sure_lately": int(np.logical_and.accumulate(sure[::-1]).sum()),
        "kept_share": float(sure[since].mean()) if localized is not None else 1.0,
        "sure_and_wrong": _surest(run),
    }
    if known.any():
        last = int(np.flatnonzero(known)[-1])
        figures["end"] = score_step(run.estimate(last), run.truths[last])
    if scored.any():
        most = int(np.where(scored, error_m, -1.0).argmax())
        figures |= {"error_mean_m": float(error_m[scored].mean())}
        figures |= {"error_most_m": float(error_m[most]), "most_at": int(run.steps[most])}
    return figures


def _surest(run: RunTable) -> SureAndWrong | None:
    """Return the update with the largest error of those that were sure and wrong."""
    wrong = run.known & run.is_converged & ~run.is_correct
    if not wrong.any():
        return None
    most = int(np.where(wrong, run.error_m, -1.0).argmax())
    return SureAndWrong(
        int(run.steps[most]), float(run.error_m[most]), float(run.converged[most]), bool(run.bereft[most])
    )
