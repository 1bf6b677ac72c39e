"""Events: the few updates of a run at which something happened that a person would want to look at.

Each kind has one precise definition (docs/events.md). Thresholds that are not part of the scores' definitions
(`maurice_mcl.analysis.metrics`) stand in `EventThresholds`. Nothing here reaches back into the filter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ..filter.localizer import ALL_ZERO, EXPANDED, RESAMPLED, RESEEDED
from ..records import StepRecord
from ..session import Moment
from .localization_status import LocalizationStatus
from .metrics import score_step
from .modes import ModeTracker, TrackedMode
from .watchers import BeyondSigma, Burst, Dip, EventThresholds, Leader, in_meters
from .watchers import Say as Say

KIDNAPPED, LIGHTS_CHANGED, SESSION = "kidnapped", "lights-changed", "session"
ESS_DIP, ALL_WEIGHTS_ZERO, MODE_SWITCH = "ess-dip", "all-weights-zero", "mode-switch"
BEYOND_THREE_SIGMA, PARTED, BOOKMARK = "beyond-three-sigma", "parted", "bookmark"
LOCALIZED, LOST, RECOVERED = "localized", "lost", "recovered"

KINDS: Mapping[str, str] = {
    KIDNAPPED: "the log says that the robot was carried away",
    LIGHTS_CHANGED: "the log says that the light changed",
    SESSION: "anything else that the log says: a bump, a slip, another floor",
    LOCALIZED: "converged and correct in 4 of 5 updates, for the first time",
    LOST: "for four updates in a row more than 36 in or 45 degrees off",
    RECOVERED: "localized again after it was lost or kidnapped",
    BEYOND_THREE_SIGMA: "the truth lies more than three standard deviations from the estimate",
    MODE_SWITCH: "another mode has become the heaviest: the estimate jumps",
    RESEEDED: "a burst of reseeding begins: particles are drawn afresh",
    EXPANDED: "the whole cloud was spread",
    ESS_DIP: "very few particles hold nearly all weight",
    ALL_WEIGHTS_ZERO: "no particle was where the picture could be from; the old weights stay",
    PARTED: "two runs of a comparison go different ways from here",
    BOOKMARK: "a note of one's own",
    RESAMPLED: "the cloud was resampled",
}  # the order in which events of one step are listed


@dataclass(frozen=True, slots=True)
class RunEvent:
    """Something that happened at one update, in a line."""

    step: int  # at which it is known
    time_s: float  # of that step, since the session's first record
    kind: str  # a key of KINDS
    text: str  # one line for people

    @property
    def is_routine(self) -> bool:
        """Return whether it happens so often that a list of what matters leaves it out."""
        return self.kind == RESAMPLED or (self.kind == SESSION and self.text.split()[:1] == ["floor"])


@dataclass(slots=True)
class EventDetector:
    """Watches one run and says what happened, in order; a few numbers and one per particle are kept.

    Give the first update first. Without truth the kinds that need it never happen. `say` writes lengths:
    `maurice_viz.style.Scale.say` writes them in the session's units.
    """

    say: Say = in_meters
    thresholds: EventThresholds = field(default_factory=EventThresholds)
    bookmarks: Mapping[int, Sequence[str]] = field(default_factory=dict)  # notes of one's own, by step
    modes: tuple[TrackedMode, ...] = ()  # of the last update seen, heaviest first
    state: str = ""  # of the belief at the last update seen: a key of localization_status.STATES
    _tracker: ModeTracker = field(default_factory=ModeTracker)
    _status: LocalizationStatus = field(default_factory=LocalizationStatus)
    _dip: Dip = field(default_factory=Dip)
    _beyond: BeyondSigma = field(default_factory=BeyondSigma)
    _leader: Leader = field(default_factory=Leader)
    _bursts: dict[str, Burst] = field(default_factory=lambda: {RESEEDED: Burst(), ALL_ZERO: Burst()})

    def see(self, moment: Moment, record: StepRecord) -> tuple[RunEvent, ...]:
        """Take in the next update; return what happened at it, in the order of KINDS."""
        step, time_s = moment.frame.step, moment.frame.time_s
        self.modes = self._tracker.see(record)
        noted = [(BOOKMARK, note) for note in self.bookmarks.get(step, ())]
        happened = [
            *noted,
            *_told(moment.events),
            *self._of_filter(step, record),
            *self._judged(moment, record),
        ]
        order = list(KINDS)
        happened.sort(key=lambda one: order.index(one[0]))
        return tuple(RunEvent(step, time_s, kind, text) for kind, text in happened)

    def _of_filter(self, step: int, record: StepRecord) -> Iterator[tuple[str, str]]:
        """What the filter itself noticed, and what its weights and modes say."""
        limits, size = self.thresholds, record.weighted.size
        if self._begins(ALL_ZERO, step, record):
            yield ALL_WEIGHTS_ZERO, "no particle was in free space, so that the old weights stay"
        if (share := self._dip.see(record.effective_sample_size / size, limits)) is not None:
            yield ESS_DIP, f"effective sample size {record.effective_sample_size:.0f} of {size} ({share:.1%})"
        if self._begins(RESEEDED, step, record):
            yield RESEEDED, _reseeded(record)
        if EXPANDED in record.events:
            yield EXPANDED, f"the whole cloud was spread (evidence {_nats(record)})"
        if RESAMPLED in record.events:
            yield RESAMPLED, f"effective sample size {record.effective_sample_size:.0f} of {size}"
        if (text := self._leader.see(self.modes, limits, self.say)) is not None:
            yield MODE_SWITCH, text

    def _judged(self, moment: Moment, record: StepRecord) -> Iterator[tuple[str, str]]:
        """What only the truth can tell."""
        score = score_step(record.estimate, moment.truth)
        carried_off = any(kind == KIDNAPPED for kind, _ in _told(moment.events))
        yield from self._status.see(moment.frame.step, score, carried_off, self.say)
        self.state = self._status.state
        if moment.truth is not None:
            text = self._beyond.see(record, moment.truth, self.thresholds, self.say)
            if text is not None:
                yield BEYOND_THREE_SIGMA, text

    def _begins(self, name: str, step: int, record: StepRecord) -> bool:
        return self._bursts[name].begins(step, name in record.events, self.thresholds)


def _told(texts: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Sort what a log says by its first word (docs/session-log.md)."""
    kinds = {"kidnapped": KIDNAPPED, "lights": LIGHTS_CHANGED}
    for text in texts:
        line = " ".join(text.split())
        first = line.split(" ")[0].lower()
        said = "the robot was carried away" if line == "kidnapped" else line
        yield kinds.get(first, SESSION), said


def _reseeded(record: StepRecord) -> str:
    if record.injected is None:
        return "particles drawn afresh"
    count = f"{int(record.injected.sum())} of {record.belief.size} particles drawn afresh"
    return f"{count} (evidence {_nats(record)})"


def _nats(record: StepRecord) -> str:
    return f"{record.calibrated_evidence:.1f} nats"
