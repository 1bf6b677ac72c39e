"""A run as a table: one row per update, the same columns wherever a run is kept (docs/python.md).

Scores, episodes, traces, reports and trials are functions of it. A cloud is not part of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..filter.estimate import CIRCLE_M, share_within
from ..filter.localizer import RESAMPLED, Localizer
from ..values.arrays import F32, F64, I32, Bool
from ..values.geometry import compose, wrap_angle
from ..values.library import USUAL, Radii
from ..values.records import Estimate, StepRecord
from ..values.session import Moment
from .lost_signal import LostSignal

if TYPE_CHECKING:
    import polars as pl

LOST_RAD, RIGHT_RAD = float(np.deg2rad(45)), float(np.deg2rad(30))
CONVERGED_SHARE = 0.9
UNKNOWN_POSE: F64 = np.full(3, np.nan)
POSE, PLANE = ("x_m", "y_m", "heading_rad"), ("x_m", "y_m")

LOST_FOR = 4  # updates in a row
LOCALIZED_OF = (4, 5)  # in at least 4 of the 5 updates that start there

KIDNAPPED, LOST, SEARCHING, PROBABLY_LOST = "kidnapped", "lost", "searching", "probably-lost"
LOCALIZED, PROBABLY_LOCALIZED = "localized", "probably localized"
WRONG, CONVERGED, SPREAD = "wrong and confident", "converged", "spread"

STATES: Mapping[str, str] = {
    LOCALIZED: "converged and correct",
    SEARCHING: "not converged, or not correct and not converged",
    WRONG: "converged and not correct: nothing in the cloud warns of it",
    LOST: "too far off at four steps in a row, and still so",
    CONVERGED: "truth not known: at least 90 % of the weight near the estimate",
    SPREAD: "truth not known: less than that",
    PROBABLY_LOST: "truth not known: what it sees fits elsewhere, whatever the cloud says",
}
WORDS = {PROBABLY_LOST: "probably lost", KIDNAPPED: "carried away, as the log says"}


@dataclass(frozen=True, slots=True)
class Standing:
    """How a run stands; probably so where no truth is known, and the lost signal tells.

    `state` is LOCALIZED, SEARCHING, KIDNAPPED (until it is known how the run takes that), LOST,
    PROBABLY_LOCALIZED or PROBABLY_LOST.
    """

    state: str
    since: int  # step from which on that is so
    places: int = 1  # that fit what is sensed about as well, the estimate's among them, without truth

    @property
    def is_lost(self) -> bool:
        """Whether it is lost, or probably so."""
        return self.state in (LOST, PROBABLY_LOST)

    @property
    def is_bad(self) -> bool:
        """Whether it is lost, or was carried away and has not found itself yet."""
        return self.is_lost or self.state == KIDNAPPED

    @property
    def words(self) -> str:
        """The state in words."""
        words = WORDS.get(self.state, self.state)
        return words if self.places < 2 else f"{words}, at one of {self.places} places that look alike"


@dataclass(frozen=True, eq=False, repr=False)
class RunTable:
    """One run of U updates in numbers: meters, radians, seconds; NaN where something is not known.

    The first columns are those of the drive, the others those of the run. What scores mean by right, lost
    and converged is computed from them (docs/evaluation.md).

        >>> import maurice_mcl as mcl
        >>> table = mcl.table(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
        >>> bool((table.error_m < table.radii.right_m).all())
        True
    """

    seed: int
    radii: Radii  # by which it is judged
    steps: I32  # (U,) of the frames
    times_s: F64  # (U,) since the session's first record
    truths: F64  # (U, 3)
    odometry_m: F64  # (U,) driven since the update before, by odometry
    odometry: F64  # (U, 3) by odometry alone, from the first true pose, or from the start
    reckoned: F64  # (U, 2) places by odometry and motion model alone, from the start of a filter that has one
    kidnapped: Bool  # (U,) whether the log says that the robot was carried away
    given: Bool  # (U,) whether somebody gave the localizer a pose
    poses: F64  # (U, 3) the scored estimates, in the map's frame
    sd_m: F64  # (U, 2) their spread along x and y
    heading_sd_rad: F64  # (U,)
    mass: F64  # (U,) share of the weight that stands behind each
    confidence: F64  # (U,) share of the weight within `radii.confidence_m`
    converged: F64  # (U,) ... within `radii.cluster_m`
    circle: F64  # (U,) ... within `CIRCLE_M`
    mean_poses: F64  # (U, 3) the weighted means of the whole cloud
    mean_sd_m: F64  # (U, 2) the spread of the whole cloud along x and y
    effective_sample_size: F64  # (U,) before resampling
    log_evidence: F64  # (U,)
    calibrated_evidence: F64  # (U,)
    weighted: I32  # (U,) how many particles were weighted
    particles: I32  # (U,) how many there are after the update
    parents: I32  # (U,) how many different particles these are copies of
    fresh: I32  # (U,) how many of them recovery drew
    bereft: Bool  # (U,) whether no particle was near the truth, and it was not localized
    knows: F64  # (U,) probability that it knows where it is, without truth (`lost_signal`)
    doubted: Bool  # (U,) whether it is probably lost, without truth
    places: I32  # (U,) that fit what was sensed about as well, the estimate's among them; 0: not known
    events: tuple[tuple[str, ...], ...]  # (U,) as in `StepRecord.events`
    before: Standing | None = None  # how a run stood at the first row, where these are only its last ones

    def __repr__(self) -> str:
        """Return how long it is."""
        return f"RunTable({self.updates} updates, seed {self.seed})"

    @property
    def updates(self) -> int:
        """The number of updates U."""
        return len(self.steps)

    @cached_property
    def known(self) -> Bool:
        """Where (U,) the truth is known."""
        return ~np.isnan(self.truths[:, 0])

    @property
    def true_m(self) -> F64:
        """How far the robot has driven up to each update (U,), by the truth."""
        updates, legs_m = np.flatnonzero(self.known), np.zeros(self.updates)
        legs_m[updates[1:]] = np.hypot(*np.diff(self.truths[updates, :2], axis=0).T)
        return legs_m.cumsum()

    @property
    def driven_m(self) -> F64:
        """How far the robot has driven (U,): by the truth, by odometry while no truth is known."""
        return np.where(np.logical_or.accumulate(self.known), self.true_m, self.odometry_m.cumsum())

    @cached_property
    def error_m(self) -> F64:
        """Position error (U,)."""
        off = self.poses - self.truths
        return np.hypot(off[:, 0], off[:, 1])

    @cached_property
    def heading_error_rad(self) -> F64:
        """Heading error (U,), without sign."""
        return np.abs(wrap_angle((self.poses - self.truths)[:, 2]))

    @cached_property
    def is_converged(self) -> Bool:
        """Whether (U,) at least 90 % of the weight is near the estimate."""
        return self.converged >= CONVERGED_SHARE

    @cached_property
    def is_correct(self) -> Bool:
        """Whether (U,) the estimate is right; False where the truth is not known."""
        return (self.error_m <= self.radii.right_m) & (self.heading_error_rad <= RIGHT_RAD)

    @cached_property
    def is_off(self) -> Bool:
        """Whether (U,) it is too far off: lost after four in a row. False where the truth is not known."""
        return (self.error_m > self.radii.lost_m) | (self.heading_error_rad > LOST_RAD)

    @property
    def knew_before(self) -> bool:
        """Whether it was localized at the first row, where these are only its last ones."""
        return self.before is not None and self.before.state == LOCALIZED

    @cached_property
    def is_calm(self) -> Bool:
        """Whether (U,) it is localized, and neither carried away nor doubted."""
        return self.is_localized & ~self.kidnapped & ~self.doubted

    @cached_property
    def judged(self) -> NDArray[np.intp]:
        """The updates (J,) at which something can begin or end: with a true pose, or a kidnapping."""
        return np.flatnonzero(self.known | self.kidnapped)

    @cached_property
    def is_localized(self) -> Bool:
        """Converged and correct (U,)."""
        return self.is_converged & self.is_correct

    @cached_property
    def is_lost(self) -> Bool:
        """Whether (U,) it is lost: too far off at four updates in a row, and still so, once it knew where."""
        lost = np.zeros(self.updates, bool)
        if not self.is_off.any():
            return lost
        judged, knew = self.judged, knew_at(self)
        if knew is not None:
            late = np.arange(len(judged)) >= knew
            lost[judged] = late & (in_a_row(self.is_off[judged]) >= LOST_FOR)
        return lost & self.known

    @property
    def states(self) -> tuple[str, ...]:
        """The localization status (U,): keys of STATES."""
        unknown, converged = ~self.known, self.is_converged
        states = np.full(self.updates, SEARCHING, object)
        states[converged] = WRONG  # of several that hold the last
        states[self.is_lost] = LOST
        states[self.is_localized] = LOCALIZED
        states[unknown] = SPREAD
        states[unknown & converged] = CONVERGED
        states[unknown & self.doubted] = PROBABLY_LOST
        return tuple(states.tolist())

    @property
    def spread_m(self) -> F64:
        """Standard deviation of the whole cloud (U,)."""
        return np.hypot(self.mean_sd_m[:, 0], self.mean_sd_m[:, 1])

    @property
    def ess_share(self) -> F64:
        """Effective sample size (U,) over the number of particles that were weighted."""
        return self.effective_sample_size / self.weighted

    def estimate(self, update: int) -> Estimate:
        """Return the scored estimate of an update, counted from 0."""
        sd_x_m, sd_y_m = self.sd_m[update].tolist()
        return Estimate(
            pose=self.poses[update],
            sd_m=(sd_x_m, sd_y_m),
            heading_sd_rad=float(self.heading_sd_rad[update]),
            mass=float(self.mass[update]),
            confidence=float(self.confidence[update]),
            converged=float(self.converged[update]),
            radii=self.radii,
        )

    def frame(self) -> pl.DataFrame:
        """Return the table as a polars frame, one row per update, null where something is not known.

        docs/python.md lists the columns.

            >>> import maurice_mcl as mcl
            >>> table = mcl.table(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
            >>> table.frame().select("step", "error_m").height
            6
        """
        import polars as pl  # a run without tables does without it

        columns: dict[str, Any] = {"step": self.steps, "time_s": self.times_s}
        for name, poses in {"truth": self.truths, "estimate": self.poses, "odometry": self.odometry}.items():
            columns |= {f"{name}_{axis}": poses[:, k] for k, axis in enumerate(POSE)}
        known = self.known
        columns |= {"error_m": self.error_m, "heading_error_rad": self.heading_error_rad}
        judged = {"correct": self.is_correct, "off": self.is_off, "localized": self.is_localized}
        for name, flags in judged.items():
            columns[name] = pl.Series(flags).set(pl.Series(~known), None)
        columns |= {name: getattr(self, name) for name in FRAMED}
        columns |= {f"estimate_sd_{axis}": self.sd_m[:, k] for k, axis in enumerate(PLANE)}
        columns["state"] = pl.Series(self.states, dtype=pl.String)
        columns["events"] = pl.Series([list(events) for events in self.events], dtype=pl.List(pl.String))
        return pl.DataFrame(columns).with_columns(pl.selectors.float().fill_nan(None))


FRAMED = (
    "is_converged",
    "confidence",
    "converged",
    "mass",
    "spread_m",
    "heading_sd_rad",
    "effective_sample_size",
    "ess_share",
    "knows",
    "log_evidence",
    "calibrated_evidence",
    "weighted",
    "particles",
    "parents",
    "fresh",
    "bereft",
    "odometry_m",
    "kidnapped",
)  # columns that a frame has by their own names

# Axes and types of the columns; of the others: one float.
SIZES = dict.fromkeys(("truths", "odometry", "poses", "mean_poses"), (3,))
SIZES |= dict.fromkeys(("reckoned", "sd_m", "mean_sd_m"), (2,))
KINDS = dict.fromkeys(("steps", "weighted", "particles", "parents", "fresh", "places"), "int32")
KINDS |= dict.fromkeys(("kidnapped", "given", "bereft", "doubted"), "bool")
OF_THE_DRIVE = ("steps", "times_s", "truths", "odometry_m", "odometry", "reckoned", "kidnapped", "given")
OTHERS = (*OF_THE_DRIVE, "seed", "radii", "events", "before")
OF_A_RUN = tuple(column.name for column in fields(RunTable) if column.name not in OTHERS)
FIRST_ROOM = 64  # updates; doubled as often as it takes


@dataclass(slots=True)
class TableRows:
    """The rows of R runs on one drive, while they are made: an update, then what each run made of it."""

    runs: int = 1
    start: F64 | None = None  # (3,) where odometry alone begins, where no truth is known there
    particles: int = 0  # of a run, where nothing changes it
    radii: Radii = USUAL  # of the last update
    localizer: Localizer | None = None  # by whose motion model odometry alone is moved from the start
    updates: int = 0
    _columns: dict[str, NDArray[Any]] = field(default_factory=dict)  # (room, ...), of a run (room, R, ...)
    _events: list[list[tuple[str, ...]]] = field(default_factory=list)  # (R,) for each update
    _pose: F32 | None = None  # (1, 3) moved by the motion model, relative to the library's origin
    _whole: RunTable | None = None  # of all rows, until another one comes

    def add(
        self,
        moment: Moment,
        record: StepRecord,
        signal: LostSignal | None = None,
        *,
        bereft: bool = False,
    ) -> None:
        """Keep the next update of a single run, with what the lost signal, which read it, says of it."""
        self.begin(moment)
        self.put(0, record)
        row = self.updates - 1
        self._columns["bereft"][row] = bereft
        if signal is not None:
            self._columns["knows"][row] = np.nan if signal.knows is None else signal.knows
            self._columns["doubted"][row] = signal.probably_lost
            self._columns["places"][row] = signal.places

    def begin(self, moment: Moment) -> None:
        """Make room for an update."""
        self._make_room()
        self._whole = None
        frame, row = moment.frame, self.updates
        drive = {
            "steps": frame.step,
            "times_s": frame.time_s,
            "truths": UNKNOWN_POSE if moment.truth is None else moment.truth,
            "odometry_m": length_of(frame.motions),
            "odometry": self._followed(frame.motions, moment.truth),
            "reckoned": self._reckoned(frame.motions),
            "kidnapped": moment.kidnapped,
            "given": bool(moment.told("given")),
        }
        for name, value in drive.items():
            self._columns[name][row] = value
        self._columns["knows"][row] = np.nan
        self._events.append([()] * self.runs)
        self.updates += 1

    def _make_room(self) -> None:
        """Double the room where it is full."""
        room = len(self._columns["steps"]) if self._columns else 0
        if self.updates < room:
            return
        for name in (*OF_THE_DRIVE, *OF_A_RUN):
            runs = () if name in OF_THE_DRIVE else (self.runs,)
            shape = (max(room, FIRST_ROOM), *runs, *SIZES.get(name, ()))
            more = np.zeros(shape, KINDS.get(name, "float64"))
            self._columns[name] = np.concatenate([self._columns[name], more]) if room else more

    def _followed(self, motions: F64, truth: F64 | None) -> F64:
        """Add up the odometry, uncorrected, from the first true pose, or from the start."""
        if not self.updates and truth is not None:
            return truth
        start = UNKNOWN_POSE if self.start is None else self.start
        pose: F64 = self._columns["odometry"][self.updates - 1] if self.updates else start
        for motion in motions:
            pose = compose(pose, motion)
        return pose

    def _reckoned(self, motions: F64) -> F64:
        """Move a place (2,) by the motion model without its noise, as a filter without sensors does."""
        localizer = self.localizer
        if localizer is None or localizer.motion is None or self.start is None:
            return UNKNOWN_POSE[:2]
        origin = localizer.library.origin
        if self._pose is None:
            self._pose = (self.start - [*origin, 0.0]).astype(np.float32)[None]
        for motion in motions:
            self._pose = localizer.motion.move(self._pose, origin, motion, np.zeros((1, 3), np.float32))
        return self._pose[0, :2] + origin

    def put(self, run: int, record: StepRecord) -> None:
        """Keep the numbers of a record."""
        scored, mean, parents = record.estimate, record.mean_estimate, record.parents
        self.radii = scored.radii
        own = record.belief.size if parents is None else np.count_nonzero(np.bincount(parents[parents >= 0]))
        values: dict[str, Any] = {
            "poses": scored.pose,
            "sd_m": scored.sd_m,
            "heading_sd_rad": scored.heading_sd_rad,
            "mass": scored.mass,
            "confidence": scored.confidence,
            "converged": scored.converged,
            "circle": share_within(record.weighted, scored.pose, CIRCLE_M),
            "mean_poses": mean.pose,
            "mean_sd_m": mean.sd_m,
            "effective_sample_size": record.effective_sample_size,
            "log_evidence": record.log_evidence,
            "calibrated_evidence": record.calibrated_evidence,
            "weighted": record.weighted.size,
            "particles": record.belief.size,
            "parents": own,
            "fresh": 0 if record.injected is None else int(record.injected.sum()),
        }
        for name, value in values.items():
            self._columns[name][self.updates - 1, run] = value
        self._events[-1][run] = record.events

    def put_some(self, runs: NDArray[np.intp], columns: dict[str, NDArray[Any]]) -> None:
        """Keep the numbers of some runs in which nothing out of the ordinary happened."""
        row, events = self.updates - 1, self._events[-1]
        for name in ("weighted", "particles"):
            self._columns[name][row, runs] = self.particles
        for name in columns.keys() & self._columns.keys():
            self._columns[name][row, runs] = columns[name]
        for run, resampled in zip(runs.tolist(), columns["resampled"].tolist(), strict=True):
            events[run] = (RESAMPLED,) if resampled else ()

    def table(self, seed: int = 0, first: int = 0, before: Standing | None = None) -> RunTable:
        """Return the only run so far, or its rows from one on, at which it stood in this way."""
        if first or before is not None:
            return self.tables([seed], first, before)[0]
        if self._whole is None or self._whole.seed != seed:  # who asks for it asks for the same figures of it
            self._whole = self.tables([seed])[0]
        return self._whole

    def tables(
        self, seeds: Sequence[int], first: int = 0, before: Standing | None = None
    ) -> tuple[RunTable, ...]:
        """Return the runs so far, one by one, or their rows from one on."""
        self._make_room()  # an empty table has columns, too
        rows = slice(first, self.updates)
        columns = {name: column[rows] for name, column in self._columns.items()}  # rows never change
        drive = {name: columns[name] for name in OF_THE_DRIVE}
        return tuple(
            RunTable(
                seed=seed,
                radii=self.radii,
                events=tuple(events[run] for events in self._events[rows]),
                before=before,
                **(drive | {name: columns[name][:, run] for name in OF_A_RUN}),
            )
            for run, seed in enumerate(seeds)
        )


def in_a_row(flags: Bool) -> I32:
    """Return at how many updates in a row, up to each (U,), a flag was set."""
    updates = np.arange(1, len(flags) + 1, dtype=np.int32)
    return updates - np.maximum.accumulate(np.where(flags, 0, updates))


def mostly(flags: Bool) -> Bool:
    """Return where (n,) five updates begin of which the first and at least four have a flag set."""
    (least, window), begins = LOCALIZED_OF, np.zeros(len(flags), bool)
    total = np.concatenate([[0], np.cumsum(flags)])
    begins[: max(len(flags) - window + 1, 0)] = total[window:] - total[:-window] >= least
    return begins & flags


def endings(run: RunTable) -> Bool:
    """Return from which judged updates (J,) on a run is localized: in four of five, not carried away."""
    window, kidnapped = LOCALIZED_OF[1], run.kidnapped[run.judged]
    total, stays = np.concatenate([[0], np.cumsum(kidnapped)]), np.zeros(len(kidnapped), bool)
    count = max(len(kidnapped) - window + 1, 0)
    stays[:count] = total[window:] == total[1 : count + 1]
    return stays & mostly(run.is_localized[run.judged])


def knew_at(run: RunTable) -> int | None:
    """Return from which of the judged updates on a run knew where it was; None: from none.

    Right from the start if it was localized then, or right at four of the first five, however wide its cloud
    was: a single one may be chance in a small room. Else at the last of the five that first localize it.
    """
    judged = run.judged
    if run.knew_before:
        return 0
    known = np.flatnonzero(run.known[judged])
    if not len(known):
        return None
    first, window = int(known[0]), LOCALIZED_OF[1]
    if run.is_localized[judged[first]]:
        return first
    if mostly(run.is_correct[judged[first : first + window]])[0]:
        return first + window - 1
    localized = np.flatnonzero(endings(run)[first:])
    return first + int(localized[0]) + window - 1 if len(localized) else None


def length_of(motions: F64) -> float:
    """Return how far movements (M, 3) drive."""
    return float(np.hypot(motions[:, 0], motions[:, 1]).sum())
