"""Localization status and events: the few updates of a run that a person wants to look at.

Each kind has one definition (docs/saved-runs.md); what only later updates show is reported when known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..filter.localizer import ALL_ZERO, EXPANDED, LEFT_MAP, NO_NUMBER, RESAMPLED, RESEEDED
from ..values.arrays import F64, dot
from ..values.geometry import INCH_M
from ..values.records import AVERAGES, LIBRARY, RecoveryTest, StepRecord
from ..values.session import KIDNAPPED as KIDNAPPED
from ..values.session import Moment, first_word
from .episodes import Episode, RunSoFar
from .lost_signal import LostSignal
from .metrics import StepScore, score_step
from .modes import ModeTracker, TrackedMode
from .table import LOCALIZED, LOST, PROBABLY_LOST, SEARCHING

Say = Callable[[float], str]  # writes a length in meters, with its unit


def in_meters(length_m: float) -> str:
    """Return a length as text: "0.32 m"."""
    return f"{length_m:.2f} m"


# Detectors, one per idea: each turns a value at every update into an occasional event.


# When something counts as an event; chosen so that each line of a list matters to a person.
DIP_UNDER = 0.1  # share of particles; a filter that resamples is nearly always far above it
DIP_OVER = 0.3  # share above which a dip has ended: one dip is one event
BEYOND_SD = 3.0  # standard deviations; a consistent cloud exceeds it in 1.1 % of updates (two axes)
WITHIN_SD = 2.0  # below which an excursion has ended
CLAIM_SHARE = 0.5  # share of the weight in the cluster above which it counts as a claim
BEYOND_FOR = 2  # updates in a row; single ones are chance or a mode switch
LEAST_SD_M = INCH_M  # lower bound on a cloud's width: the accuracy of the truth
LEADER_SHARE = 0.3  # share of the weight that a mode needs to take over
LEAD_SHARE = 0.1  # lead over the last leader, or two equals would alternate


@dataclass(slots=True)
class Dip:
    """Detects when a value falls below a threshold, once until it rises above a higher one."""

    _down: bool = False

    def see(self, share: float) -> float | None:
        """Return the value where a dip begins."""
        begins = not self._down and share < DIP_UNDER
        self._down = share < (DIP_OVER if self._down else DIP_UNDER)
        return share if begins else None


@dataclass(slots=True)
class BeyondSigma:
    """Detects when the truth leaves the estimate's cluster, once per excursion."""

    _running: int = 0  # updates beyond
    _out: bool = False

    def see(self, record: StepRecord, truth: F64, say: Say) -> str | None:
        """Return a line where an excursion is certain."""
        claims = record.estimate.mass > CLAIM_SHARE
        off_sd = deviations(record, truth) if claims else 0.0
        self._running = self._running + 1 if off_sd > BEYOND_SD else 0
        known = not self._out and self._running >= BEYOND_FOR
        self._out = known or (self._out and off_sd >= WITHIN_SD)
        if not known:
            return None
        off = say(float(np.hypot(*(truth[:2] - record.estimate.pose[:2]))))
        return f"truth {off} from the estimate: {off_sd:.1f} standard deviations"


def deviations(record: StepRecord, truth: F64) -> float:
    """Return the Mahalanobis distance of the truth from the estimate, by its cluster with a least sd."""
    middle = record.estimate.pose[:2] - record.weighted.origin
    reach_m = record.estimate.radii.cluster_m
    x, y = (record.weighted.poses[:, axis] - np.float32(middle[axis]) for axis in (0, 1))
    weights = record.weighted.weights * (x * x + y * y <= reach_m**2)
    total = float(weights.sum()) or 1.0
    xx, yy, xy = (dot(weights, product) / total for product in (x * x, y * y, x * y))
    xx, yy = xx + LEAST_SD_M**2, yy + LEAST_SD_M**2
    dx, dy = (truth[:2] - record.estimate.pose[:2]).tolist()
    return math.sqrt((yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy))


@dataclass(slots=True)
class Leader:
    """Detects when another mode becomes the heaviest, by enough and far enough away."""

    _leader: TrackedMode | None = None

    def see(self, modes: Sequence[TrackedMode], say: Say) -> str | None:
        """Return a line where another mode takes over; the first leader does not count."""
        if not modes:
            return None
        first, last = modes[0], self._leader
        now = next((m for m in modes if last is not None and m.identity == last.identity), None)
        behind = first.estimate.mass - (now.estimate.mass if now else 0.0)
        if now is not None and (now is first or behind < LEAD_SHARE):
            self._leader = now
            return None
        if first.estimate.mass < LEADER_SHARE:
            return None
        self._leader = first
        if last is None:
            return None
        old = (now or last).estimate
        jumped_m = float(np.hypot(*(first.estimate.pose[:2] - old.pose[:2])))
        if jumped_m < first.estimate.radii.cluster_m:  # the same place to a person
            return None
        share_left = f"{now.estimate.mass:.0%}" if now else "gone"
        share = f"{first.estimate.mass:.0%}"
        return (
            f"mode {first.identity} ({share}) leads, {say(jumped_m)} from mode {last.identity} ({share_left})"
        )


# What a person reads: the kinds of event, and the detector that reports them for one run.

FAILURE = "failure"
CARRIED_AWAY = "the robot was carried away"
LIGHTS_CHANGED, SESSION = "lights-changed", "session"  # and KIDNAPPED
ESS_DIP, ALL_WEIGHTS_ZERO, MODE_SWITCH = "ess-dip", "all-weights-zero", "mode-switch"
BEYOND_THREE_SIGMA, PARTED = "beyond-three-sigma", "parted"
RECOVERED, LEFT_THE_MAP = "recovered", "left-the-map"  # and LOCALIZED and LOST, which begin the states

GRAVE, DOUBTFUL, GOOD, ACTS, NEUTRAL = "grave", "doubtful", "good", "acts", "neutral"
OF_LOG, OF_RUN = "log", "run"  # where a kind is told: by the log, or noticed in a run


@dataclass(frozen=True, slots=True)
class EventKind:
    """A kind of event; whatever lists, draws, pictures or documents events follows from these fields."""

    meaning: str  # in a line
    tone: str = NEUTRAL  # what it says of the run: one of the tones above
    lanes: tuple[str, ...] = (OF_RUN,)  # in which it is marked
    word: str = ""  # of marks, where the name is too long
    in_plots: bool = False  # whether it is a line in plots
    is_routine: bool = False  # so frequent that lists of important events leave it out


_FAILED = "why the run was lost, at the step at which the cause shows first"
_DOUBTED = "without truth: it knew where it was, and a second opinion contradicts it now"
_LEFT = "every particle drove out of free space: the cloud stays where it was"
_ZERO = "no particle is in free space, or none has a likelihood: weights cannot be updated"
_LOGGED = "anything else that the log says: a bump, a slip, another floor"
KINDS: Mapping[str, EventKind] = {
    FAILURE: EventKind(_FAILED, GRAVE, ()),  # lanes mark it by the kind of its cause
    KIDNAPPED: EventKind("the log says that the robot was carried away", GRAVE, (OF_LOG,), in_plots=True),
    LIGHTS_CHANGED: EventKind("the log says that the light changed", NEUTRAL, (OF_LOG,), "lights", True),
    SESSION: EventKind(_LOGGED, NEUTRAL, (OF_LOG,), "log"),
    LOST: EventKind("at four steps in a row beyond the lost radius, or more than 45 degrees off", GRAVE),
    PROBABLY_LOST: EventKind(_DOUBTED, GRAVE),
    LEFT_THE_MAP: EventKind(_LEFT, GRAVE, word="left map", in_plots=True),
    ALL_WEIGHTS_ZERO: EventKind(_ZERO, GRAVE, word="all zero", in_plots=True),
    RECOVERED: EventKind("localized again after it was lost or kidnapped", GOOD),
    LOCALIZED: EventKind("converged and correct at 4 of 5 steps, for the first time", GOOD),
    MODE_SWITCH: EventKind(
        "another mode has become the heaviest: the estimate jumps", DOUBTFUL, word="estimate jumps"
    ),
    BEYOND_THREE_SIGMA: EventKind(
        "the truth lies more than three standard deviations from the estimate", DOUBTFUL, word="3 sigma"
    ),
    ESS_DIP: EventKind("very few particles hold nearly all weight", DOUBTFUL, word="few heavy"),
    PARTED: EventKind("two runs of a comparison diverge from here", DOUBTFUL, (OF_LOG, OF_RUN)),
    RESEEDED: EventKind("fresh particles are drawn; steps in a row are one line", ACTS, in_plots=True),
    EXPANDED: EventKind("the whole cloud was spread", ACTS, in_plots=True),
    RESAMPLED: EventKind("the cloud was resampled", ACTS, (), is_routine=True),
}  # the gravest first: the order of the events of one step, of marks, and of pictures


@dataclass(frozen=True, slots=True)
class RunEvent:
    """Something that happened at one step, or at several in a row, in a line."""

    step: int  # at which it is known, or begins
    time_s: float  # of that step, since the session's first record
    kind: str  # a key of KINDS
    text: str  # one line for people
    last: int | None = None  # the last of several steps in a row; None: a single one
    continues: bool = False  # whether the step before had the same
    fresh: int = 0  # particles drawn

    @property
    def is_routine(self) -> bool:
        """Return whether it is so frequent that a list of important events leaves it out."""
        return KINDS[self.kind].is_routine or (self.kind == SESSION and first_word(self.text) == "floor")


def joined(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return events in order, with those that continue an earlier one joined to it."""
    lines = list[RunEvent]()
    first_steps: dict[str, int] = {}
    for event in events:
        if not event.continues or event.kind not in first_steps:
            first_steps[event.kind] = len(lines)
            lines.append(event)
            continue
        first = lines[first_steps[event.kind]]
        fresh = first.fresh + event.fresh
        drawn = f": {fresh} fresh in all" if fresh else ""
        text = f"{first.text.split(UNTIL)[0]}{UNTIL}{event.step}{drawn}"
        lines[first_steps[event.kind]] = replace(first, text=text, last=event.step, fresh=fresh)
    return lines


UNTIL = "; until step "


@dataclass(slots=True)
class EventDetector:
    """Detects the events of one run; `say` formats lengths. By itself it follows the run, too."""

    say: Say = in_meters
    modes: tuple[TrackedMode, ...] = ()  # of the last update seen, heaviest first
    state: str = ""  # of the belief at the last update seen: a key of STATES
    knows: float | None = None  # the probability that its estimate is right, without truth
    _own: RunSoFar = field(default_factory=RunSoFar)  # where nobody else follows the run
    _tracker: ModeTracker = field(default_factory=ModeTracker)
    _dip: Dip = field(default_factory=Dip)
    _beyond: BeyondSigma = field(default_factory=BeyondSigma)
    _leader: Leader = field(default_factory=Leader)
    _before: frozenset[str] = frozenset()  # events of the filter at the update before

    def see(self, moment: Moment, record: StepRecord, run: RunSoFar | None = None) -> tuple[RunEvent, ...]:
        """Process the next update; return its events in the order of KINDS.

        `run` is what another one who follows it has of it, with this update.
        """
        if run is None:
            run = self._own
            run.add(moment, record)
        step, time_s = moment.frame.step, moment.frame.time_s
        self.modes = self._tracker.see(record)
        happened = [
            *logged(moment.events),
            *self._of_filter(record),
            *self._judged(moment, record, run),
        ]
        fresh = 0 if record.injected is None else int(record.injected.sum())
        order, before = list(KINDS), self._before
        self._before = frozenset(record.events)
        happened.sort(key=lambda event: order.index(event[0]))
        return tuple(
            RunEvent(
                step,
                time_s,
                kind,
                text,
                continues=FILTER_NAMES.get(kind) in before,
                fresh=fresh if kind == RESEEDED else 0,
            )
            for kind, text in happened
        )

    def _of_filter(self, record: StepRecord) -> Iterator[tuple[str, str]]:
        size = record.weighted.size
        if ALL_ZERO in record.events:
            why = "no particle is in free space"
            if NO_NUMBER in record.events:
                why = "likelihoods are no numbers, since a channel or the library holds NaN"
            yield ALL_WEIGHTS_ZERO, f"{why}: the weights cannot be updated"
        if LEFT_MAP in record.events:
            yield LEFT_THE_MAP, "every particle drove out of free space: the cloud stays where it was"
        if (share := self._dip.see(record.effective_sample_size / size)) is not None:
            worth = f"{record.effective_sample_size:.0f} of {size} ({share:.1%})"
            yield ESS_DIP, f"few particles have nearly all the weight: effective sample size {worth}"
        if RESEEDED in record.events:
            yield RESEEDED, _reseeded(record)
        if EXPANDED in record.events:
            yield EXPANDED, _expanded(record)
        if RESAMPLED in record.events:
            yield RESAMPLED, f"effective sample size {record.effective_sample_size:.0f} of {size}"
        if (text := self._leader.see(self.modes, self.say)) is not None:
            yield MODE_SWITCH, text

    def _judged(self, moment: Moment, record: StepRecord, run: RunSoFar) -> Iterator[tuple[str, str]]:
        rows, score = run.recent.table(), score_step(record.estimate, moment.truth)
        changes = run.recent.episodes().changes
        run.recent.standing()  # lets go of rows
        self.state, self.knows = rows.states[-1], run.signal.knows
        if rows.doubted[-1] and not rows.doubted[-2:-1].any():
            yield PROBABLY_LOST, _doubts(run.signal)
        for update, episode in changes:
            if update == rows.updates - 1:
                yield _say_change(episode, score, self.say)
        if moment.truth is None:
            return
        text = self._beyond.see(record, moment.truth, self.say)
        if text is not None:
            yield BEYOND_THREE_SIGMA, text


# events that can last several steps, and what a record calls them
FILTER_NAMES = {ALL_WEIGHTS_ZERO: ALL_ZERO, LEFT_THE_MAP: LEFT_MAP, RESEEDED: RESEEDED, EXPANDED: EXPANDED}


def _say_change(episode: Episode, score: StepScore, say: Say) -> tuple[str, str]:
    """Return kind and text of an episode in which a run is now known to be lost, or localized (again)."""
    if episode.localized is not None:
        kind = LOCALIZED if episode.kind == SEARCHING else RECOVERED
        again = "localized" if kind == LOCALIZED else f"{episode.account}; localized again"
        return kind, f"{again} from step {episode.localized} on"
    off_m, off_rad = score.error_m or 0.0, score.heading_error_rad or 0.0
    sure = ", sure of it" if score.converged else ""
    off = f"now {say(off_m)} and {np.degrees(off_rad):.0f} deg off{sure}"
    return LOST, f"{episode.account}; {off}" if episode.kind != SEARCHING else f"not localized yet; {off}"


def logged(texts: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield kind and text of a log's events, by their first word (docs/session-log.md)."""
    kinds = {KIDNAPPED: KIDNAPPED, "lights": LIGHTS_CHANGED}
    for text in texts:
        line = " ".join(text.split())
        yield kinds.get(first_word(line), SESSION), CARRIED_AWAY if line == KIDNAPPED else line


def _doubts(signal: LostSignal) -> str:
    knows = signal.knows or 0.0
    chance = f"{knows:.0%}" if knows >= LEAST_CHANCE else f"under {LEAST_CHANCE:.0%}"
    return f"without truth: right with a probability of {chance}, what it sees fits elsewhere"


LEAST_CHANCE = 0.01  # a smaller probability is written as below it


def _reseeded(record: StepRecord) -> str:
    if record.injected is None:
        return "fresh particles"
    count = f"{int(record.injected.sum())} of {record.belief.size} fresh"
    if record.recovery_test is None:
        return f"{count} (fit of this picture {record.calibrated_evidence:.1f} nats)"
    return f"{say_recovery_test(record.recovery_test)}: {count}"


def _expanded(record: StepRecord) -> str:
    test = record.recovery_test
    fit = f"fit of this picture {record.calibrated_evidence:.1f} nats"
    why = fit if test is None else say_recovery_test(test)
    return f"{why}: the whole cloud was spread"


def say_recovery_test(test: RecoveryTest) -> str:
    """Say what recovery compared: "this picture fits badly (-10.7 nats, threshold -9.1)"."""
    what, limit = {
        AVERAGES: ("pictures fit badly of late", "long-term average"),
        LIBRARY: ("the cloud matches this picture worse than the library's mean", "threshold"),
    }.get(test.compared, ("this picture fits badly", "threshold"))
    if not np.isfinite(test.found):
        return f"no particle in free space ({limit} {test.threshold:.1f} nats)"
    difference = abs(test.threshold - test.found)
    digits = (
        1 if not 0 < difference < 0.1 else min(-math.floor(math.log10(difference)), 6)
    )  # so that they differ
    return f"{what} ({test.found:.{digits}f} nats, {limit} {test.threshold:.{digits}f})"
