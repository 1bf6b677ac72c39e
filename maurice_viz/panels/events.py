"""What happened: every step in words, and events as lanes over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.analysis import events as kinds
from maurice_mcl.analysis import events as states
from maurice_mcl.analysis.events import KINDS, RunEvent
from maurice_mcl.analysis.failures.kinds import CAUSES, Failure
from maurice_mcl.session import Moment, first_word

from ..drawing.arrow import row_of, text_of
from ..entities import Phase, RunPaths
from ..style import FRESH, LOST, PALE, RGB, RUN_COLORS, font_safe, packed
from ..text import narration
from ..text.failure import title
from ..text.what_if import BRANCH
from .panel import MARKDOWN, DrawnRun, Panel, StepUpdate, set_phase, set_phase_only, set_place

PARTLY = " · only partly drawn, see `--detail`"


class WordsPanel(Panel):
    """Logs a text for every phase, and a summary at the end of the step."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        rec.log(self._paths.text, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        moment, record = update.moment, update.record
        if update.whole:
            for phase in (Phase.PREDICT, Phase.MEASURE, Phase.WEIGHT):
                set_phase(rec, moment, phase)
                self._log(rec, narration.phase(moment, record, phase, self._scale))
            for phase in (Phase.RESAMPLE, Phase.RESEED):
                set_phase_only(rec, moment, phase)
                self._log(rec, narration.phase(moment, record, phase, self._scale))
        set_phase(rec, moment, Phase.ESTIMATE)
        title, rest = narration.summary(moment, record, self._scale).split("\n\n", 1)
        self._log(rec, f"{title}{'' if update.whole else PARTLY}\n\n{rest}")

    def _log(self, rec: rr.RecordingStream, text: str) -> None:
        rec.log(self._paths.text, row_of(rr.TextDocument, text=text_of(font_safe(text))))


def words_view(paths: RunPaths, title: str = "What this step did") -> rrb.TextDocumentView:
    """Show what happened in words."""
    return rrb.TextDocumentView(name=title, origin=paths.text)


# Events as lanes over time. A state lasts until the next one. An event is at the left edge of its mark, which
# lasts for a share of the run that can be read on a screen, or until the next one. Only changes are logged.

LOG_LANE = "/_log"  # of all runs of a recording; lanes stand in the order of their paths
USUAL_UPDATES = 120  # if the number is not known beforehand
LEAST_HOLD = 2
MARKS_A_RUN = 8  # so many marks fill a lane: each has room for a word

DOUBTFUL, ACTS, NOTE, GOOD = RUN_COLORS
NEUTRAL = PALE
TONES = {
    kinds.GRAVE: LOST,
    kinds.DOUBTFUL: DOUBTFUL,
    kinds.GOOD: GOOD,
    kinds.ACTS: ACTS,
    kinds.NEUTRAL: NEUTRAL,
}
LEGEND = "marks begin at their event; green good, orange wrong or doubtful, blue search or acts, red lost"
LINES_LEGEND = "lines in plots: red kidnapped or off the map, pink reseeded, gray lights, slip, bump, branch"

CAUSE = "cause: "  # before the kind of a failure: a state, or a mark of its own

STATUS_COLORS: Mapping[str, RGB] = {
    states.LOCALIZED: GOOD,
    states.SEARCHING: ACTS,
    states.WRONG: DOUBTFUL,
    states.LOST: LOST,
    states.CONVERGED: GOOD,
    states.SPREAD: ACTS,
    states.PROBABLY_LOST: LOST,
    **{f"{CAUSE}{kind}": LOST for kind in CAUSES},  # in place of lost, where the cause is known
}
_OF_RUN, _OF_LOG = (
    {name: TONES[kind.tone] for name, kind in KINDS.items() if lane in kind.lanes}
    for lane in (kinds.OF_RUN, kinds.OF_LOG)
)
LOG_WORDS = ("bump", "slip")  # first words of what else a log says that have marks of their own
NOTICED_COLORS: Mapping[str, RGB] = {f"{CAUSE}{kind}": LOST for kind in CAUSES} | _OF_RUN  # the gravest first
LOG_COLORS: Mapping[str, RGB] = {
    kinds.KIDNAPPED: LOST,
    **dict.fromkeys(LOG_WORDS, NEUTRAL),
    BRANCH: NOTE,
} | _OF_LOG
SHORT = {
    **{name: kind.word or name.replace("-", " ") for name, kind in KINDS.items()},
    states.WRONG: "wrong",
    states.SEARCHING: "search",
    **{f"{CAUSE}{kind}": f"lost: {title(kind)}" for kind in CAUSES},
}  # labels of marks and states, if not their names: a state can be as short as one update
LINE_COLORS: Mapping[str, RGB] = {
    name: FRESH if kind.tone == kinds.ACTS else TONES[kind.tone]
    for name, kind in KINDS.items()
    if kind.in_plots
} | dict.fromkeys((*LOG_WORDS, BRANCH), NEUTRAL)
LINE_WIDTH, GRAVE_WIDTH = 0.8, 2.2  # the wider one is seen under another line at the same step


@dataclass(slots=True)
class EventLines:
    """Remembers when events were, and draws them as vertical lines into plots at the end of a run."""

    _seen: dict[str, list[tuple[int, float]]] = field(default_factory=dict)  # steps and times, by name

    def see(self, step: int, time_s: float, names: Iterable[str]) -> None:
        """Remember the events of an update."""
        for name in set(names) & set(LINE_COLORS):
            self._seen.setdefault(name, []).append((step, time_s))

    def draw(self, rec: rr.RecordingStream, path: str, low: float, high: float) -> None:
        """Draw all into the plot of the values at `path`, from the lowest to the highest."""
        for name, places in self._seen.items():
            line = f"{path}/events/{name}"
            label, color = SHORT.get(name, name), LINE_COLORS[name]
            width = GRAVE_WIDTH if color == LOST else LINE_WIDTH
            look = rr.SeriesLines(names=[label], colors=[color], widths=[width], aggregation_policy="off")
            rec.log(line, look, static=True)
            for step, time_s in places:
                set_place(rec, step, time_s, Phase.ESTIMATE)
                for value in (low, high, np.nan):  # the last parts it from the next line
                    rec.log(line, rr.Scalars(value))


BRIEF = " (brief)"  # added to the name of what is too short for its word on a screen
WORDS_A_RUN = 32  # so many words have room beside each other in a lane


@dataclass(slots=True)
class _Lane:
    """One lane: a name lasts until the next one. In the end, what is too short for its word loses it."""

    path: str
    colors: Mapping[str, RGB]
    at_end: bool = False  # whether all is drawn in the end, so that causes, known only then, have room
    _changes: list[tuple[int, float, str]] = field(default_factory=list)  # step, time, name

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what names look like, static."""
        shades = [rr.components.Color(packed(color)) for color in self.colors.values()]
        labels = [SHORT.get(name, name.replace("-", " ")) for name in self.colors]
        values = [*self.colors, *(f"{name}{BRIEF}" for name in self.colors)]
        style = rr.StateConfiguration(
            values=values, labels=[*labels, *([" "] * len(labels))], colors=shades + shades
        )
        rec.log(self.path, style, static=True)

    def change(self, rec: rr.RecordingStream, moment: Moment, name: str) -> None:
        """Begin a name, or nothing."""
        self._changes.append((moment.frame.step, moment.frame.time_s, name))
        self._put(rec, -1, self._changes[-1])

    def rename(self, rec: rr.RecordingStream, first: int, last: int, old: str, new: str) -> None:
        """Give what was called `old` from one step to another a new name."""
        for k, (step, time_s, name) in enumerate(self._changes):
            if first <= step <= last and name == old:
                self._put(rec, k, (step, time_s, new))

    def insert(
        self, rec: rr.RecordingStream, step: int, times_s: Mapping[int, float], hold: int, name: str
    ) -> None:
        """Mark a step that is over, for so many steps, or half of them where other marks follow."""
        if self.at_end:
            self._make_room(step, step + hold // 2, times_s)
        before = [k for k, one in enumerate(self._changes) if one[0] < step]
        after = next((one[0] for one in self._changes if one[0] > step), None)
        at = len(before)
        same = at < len(self._changes) and self._changes[at][0] == step
        if not same:
            self._changes.insert(at, (step, times_s[step], name))
        self._put(rec, at, (step, times_s[step], name))
        end = step + hold
        if (after is None or after > end) and end in times_s:
            self._changes.insert(at + 1, (end, times_s[end], ""))
            self._put(rec, at + 1, self._changes[at + 1])

    def _make_room(self, first: int, end: int, times_s: Mapping[int, float]) -> None:
        """Let the last mark that began between two steps begin at the second one; the others give way."""
        inside = [k for k, one in enumerate(self._changes) if first < one[0] < end]
        if not inside:
            return
        last = self._changes[inside[-1]][2]
        del self._changes[inside[0] : inside[-1] + 1]
        if end in times_s and all(one[0] != end for one in self._changes):
            self._changes.insert(inside[0], (end, times_s[end], last))

    def _put(self, rec: rr.RecordingStream, k: int, change: tuple[int, float, str]) -> None:
        self._changes[k] = step, time_s, name = change
        if self.at_end:
            return
        set_place(rec, step, time_s, Phase.ESTIMATE)
        rec.log(self.path, rr.StateChange(state=name) if name else rr.StateChange.from_fields(state=[]))

    def finish(self, rec: rr.RecordingStream, steps: int) -> None:
        """Take the word from what lasted less than its share of a run of so many steps."""
        if self.at_end:
            self.at_end = False
            for k, change in enumerate(self._changes):
                self._put(rec, k, change)
        for (step, time_s, name), (after, _, _) in pairwise(self._changes):
            if name and (after - step) * WORDS_A_RUN < steps:
                set_place(rec, step, time_s, Phase.ESTIMATE)
                rec.log(self.path, rr.StateChange(state=f"{name}{BRIEF}"))


@dataclass(slots=True)
class _Marks:
    """A lane of events: shows the first event of a step for `hold_steps`, then nothing."""

    lane: _Lane
    hold_steps: int
    _until: int | None = None  # the step from which nothing is shown; None: nothing is shown

    def draw(self, rec: rr.RecordingStream, moment: Moment, names: Iterable[str]) -> None:
        step = moment.frame.step
        found = sorted(set(names) & set(self.lane.colors), key=list(self.lane.colors).index)
        if found:
            self.lane.change(rec, moment, found[0])
            self._until = step + self.hold_steps
        elif self._until is not None and step >= self._until:
            self.lane.change(rec, moment, "")
            self._until = None


class EventsPanel(Panel):
    """Draws the lanes of one run, status and what was noticed; and the log's, once for all runs."""

    def __init__(self, run: DrawnRun) -> None:
        super().__init__(run)
        hold_steps = hold_for(run.updates or USUAL_UPDATES)
        self._status, self._now, self._step = _Lane(status_path(run.paths), STATUS_COLORS), "", 0
        self._times_s: dict[int, float] = {}  # of each step drawn
        known = run.updates > 0  # else it is live, and marks are drawn as they come
        noticed = _Lane(noticed_path(run.paths), NOTICED_COLORS, at_end=known)
        self._noticed = _Marks(noticed, hold_steps)
        self._log = _Marks(_Lane(LOG_LANE, LOG_COLORS), hold_steps) if run.draws_scene else None
        marks = [self._noticed, *([self._log] if self._log else [])]
        self._lanes = [self._status, *(one.lane for one in marks)]

    def prepare(self, rec: rr.RecordingStream) -> None:
        for lane in self._lanes:
            lane.prepare(rec)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        self._step = update.moment.frame.step
        self._times_s[self._step] = update.moment.frame.time_s
        set_phase(rec, update.moment, Phase.ESTIMATE)
        if update.status != self._now:
            self._status.change(rec, update.moment, update.status)
            self._now = update.status
        shown = [event for event in update.events if not event.is_routine]
        self._noticed.draw(rec, update.moment, [event.kind for event in shown])
        if self._log is not None:
            self._log.draw(rec, update.moment, [name_of(event) for event in shown])

    def diagnosed(self, rec: rr.RecordingStream, failures: Sequence[Failure]) -> None:
        for one in failures:
            name = f"{CAUSE}{one.kind}"
            self._status.rename(rec, one.lost, one.last, states.LOST, name)
            self._status.rename(rec, one.lost, one.last, states.PROBABLY_LOST, name)
            if one.first in self._times_s:
                self._noticed.lane.insert(rec, one.first, self._times_s, self._noticed.hold_steps, name)

    def finish(self, rec: rr.RecordingStream) -> None:
        for lane in self._lanes:
            lane.finish(rec, self._step)


def hold_for(updates: int) -> int:
    """Return for how many steps a mark lasts, in a run of this many updates."""
    return max(LEAST_HOLD, round(updates / MARKS_A_RUN))


def status_path(paths: RunPaths) -> str:
    """Return the lane of the localization status."""
    return paths.at("events", "belief")


def noticed_path(paths: RunPaths) -> str:
    """Return the lane of what was noticed in a run."""
    return paths.at("events", "noticed")


def events_view(labels: Sequence[str], title: str = "Events", brief: bool = False) -> rrb.StateTimelineView:
    """Show the lanes of some runs and of the log, with the meaning of the colors in the title.

    Each lane takes 35 pixels, title and time axis together 45: 150 pixels for one run, 220 for two. `brief`
    leaves out what was noticed in each run.
    """
    runs = [RunPaths(label) for label in labels]
    contents = [status_path(paths) if brief else f"{paths.at('events')}/**" for paths in runs]
    return rrb.StateTimelineView(
        name=f"{title}: {LEGEND}; {LINES_LEGEND}", origin="/", contents=[*contents, LOG_LANE]
    )


def name_of(event: RunEvent) -> str:
    """Return an event's kind; of what else the log says its first word, where lanes know it."""
    first = first_word(event.text)
    return first if event.kind == kinds.SESSION and first in LOG_COLORS else event.kind


def line_names(texts: tuple[str, ...]) -> list[str]:
    """Return the names of what a log says at an update."""
    return [name_of(RunEvent(0, 0.0, kind, text)) for kind, text in kinds.logged(texts)]
