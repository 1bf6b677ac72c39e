"""What happened: every step in words, and events as lanes over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.causes import CAUSES, Failure
from maurice_mcl.scoring import events as kinds
from maurice_mcl.scoring import events as states
from maurice_mcl.scoring.events import KINDS, RunEvent
from maurice_mcl.values.session import Moment, first_word

from ..drawing.arrow import row_of, text_of
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import FRESH, GROUND, LOST, PALE, RGB, RUN_COLORS, font_safe, packed
from ..text import narration
from ..text.what_if import BRANCH
from .panel import MARKDOWN, Panel, StepUpdate, set_phase, set_phase_only, set_place

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


# Events as lanes over time. A state lasts until the next one; a mark lasts as long as its event: one step, or
# several in a row. Both begin at the first phase of their step. One step is too narrow for a word, so
# the word of a mark follows it, on the ground of the lane. Only changes are logged.

LOG_LANE = "/_log"  # of all runs of a recording; lanes stand in the order of their paths
USUAL_UPDATES = 120  # if the number is not known beforehand
LEAST_HOLD = 2
MARKS_A_RUN = 8  # so many words of marks fill a lane

DOUBTFUL, ACTS, NOTE, GOOD = RUN_COLORS
NEUTRAL = PALE
TONES = {
    kinds.GRAVE: LOST,
    kinds.DOUBTFUL: DOUBTFUL,
    kinds.GOOD: GOOD,
    kinds.ACTS: ACTS,
    kinds.NEUTRAL: NEUTRAL,
}
LEGEND = "words follow their mark; green good, orange wrong or doubtful, blue search or acts, red lost"
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
    **{f"{CAUSE}{kind}": f"lost: {cause.title}" for kind, cause in CAUSES.items()},
}  # labels of states, lines and words, if not their names
WORDS = {
    f"{CAUSE}{kind}": f"cause: {cause.title}" for kind, cause in CAUSES.items()
}  # of marks: it need not be lost yet
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
    _before: set[str] = field(default_factory=set)  # names of the update before

    def see(self, step: int, time_s: float, names: Iterable[str]) -> None:
        """Remember the events of an update."""
        now = set(names) & set(LINE_COLORS)
        for name in now - self._before:  # what lasts several steps is one line
            self._seen.setdefault(name, []).append((step, time_s))
        self._before = now

    def draw(self, rec: rr.RecordingStream, path: str, low: float, high: float) -> None:
        """Draw all into the plot of the values at `path`, from the lowest to the highest."""
        for name, places in self._seen.items():
            line = f"{path}/events/{name}"
            label, color = SHORT.get(name, name), LINE_COLORS[name]
            width = GRAVE_WIDTH if color == LOST else LINE_WIDTH
            look = rr.SeriesLines(names=[label], colors=[color], widths=[width], aggregation_policy="off")
            rec.log(line, look, static=True)
            for step, time_s in places:
                set_place(rec, step, time_s, Phase.PREDICT)
                for value in (low, high, np.nan):  # the last parts it from the next line
                    rec.log(line, rr.Scalars(value))


BRIEF = " (brief)"  # added to the name of a state that is too short for its word on a screen
WORD = " (word)"  # added to the name of a mark whose word follows it
WORDS_A_RUN = 32  # so many words have room beside each other in a lane


@dataclass(slots=True)
class _Lane:
    """One lane: a name lasts until the next one. In the end, what is too short for its word loses it."""

    path: str
    colors: Mapping[str, RGB]
    changes: list[tuple[int, float, str]] = field(default_factory=list)  # step, time, name; "": nothing

    def prepare(self, rec: rr.RecordingStream, *, marks: bool = False) -> None:
        """Log what names look like, static; marks have no words of their own, which follow them."""
        named = {name: SHORT.get(name, name.replace("-", " ")) for name in self.colors}
        looks = [(name, named[name], color) for name, color in self.colors.items()]
        brief = [(f"{name}{BRIEF}", " ", color) for name, _, color in looks]
        if marks:
            words = [(f"{name}{WORD}", WORDS.get(name, label), GROUND) for name, label, _ in looks]
            looks, brief = [(name, " ", color) for name, _, color in looks], words
        values, labels, colors = zip(*looks, *brief, strict=True)
        shades = [rr.components.Color(packed(color)) for color in colors]
        rec.log(self.path, rr.StateConfiguration(values=values, labels=labels, colors=shades), static=True)

    def change(self, rec: rr.RecordingStream, step: int, time_s: float, name: str) -> None:
        """Begin a name, or nothing, where it is another one than before."""
        if name == (self.changes[-1][2] if self.changes else ""):
            return
        self.changes.append((step, time_s, name))
        self._log(rec, step, time_s, name)

    def rename(self, rec: rr.RecordingStream, first: int, last: int, old: str, new: str) -> None:
        """Give what was called `old` from one step to another a new name."""
        for k, (step, time_s, name) in enumerate(self.changes):
            if first <= step <= last and name == old:
                self.changes[k] = step, time_s, new
                self._log(rec, step, time_s, new)

    def shorten(self, rec: rr.RecordingStream, steps: int) -> None:
        """Take the word from what lasted less than its share of a run of so many steps."""
        for (step, time_s, name), (after, _, _) in pairwise(self.changes):
            if name and (after - step) * WORDS_A_RUN < steps:
                self._log(rec, step, time_s, f"{name}{BRIEF}")

    def _log(self, rec: rr.RecordingStream, step: int, time_s: float, name: str) -> None:
        set_place(rec, step, time_s, Phase.PREDICT)
        rec.log(self.path, rr.StateChange(state=name) if name else rr.StateChange.from_fields(state=[]))


@dataclass(slots=True)
class _Marks:
    """A lane of events: at each step the gravest one; after it, for some steps, the word of the gravest."""

    lane: _Lane
    hold_steps: int
    at_end: bool  # whether all is drawn in the end, with the causes that are known only then
    _rows: dict[int, tuple[float, str]] = field(default_factory=dict)  # time and name, by step, until drawn
    _word: str = ""
    _until: int = 0  # the step from which that word is not shown any more

    def draw(self, rec: rr.RecordingStream, moment: Moment, names: Iterable[str]) -> None:
        """Take the events of the next step."""
        step, time_s = moment.frame.step, moment.frame.time_s
        name = min(set(names) & set(self.lane.colors), key=list(self.lane.colors).index, default="")
        if self.at_end:
            self._rows[step] = time_s, name
        else:
            self._show(rec, step, time_s, name)

    def mark(self, step: int, name: str) -> None:
        """Show a name at a step that is over, instead of what was there."""
        if step in self._rows:
            self._rows[step] = self._rows[step][0], name

    def finish(self, rec: rr.RecordingStream) -> None:
        """Draw what was kept."""
        for step, (time_s, name) in self._rows.items():
            self._show(rec, step, time_s, name)
        self._rows = {}

    def _show(self, rec: rr.RecordingStream, step: int, time_s: float, name: str) -> None:
        order, is_over = list(self.lane.colors).index, step >= self._until
        if name and (not self._word or is_over or order(name) < order(self._word)):
            self._word, self._until = name, step + self.hold_steps
        elif is_over:
            self._word = ""
        self.lane.change(rec, step, time_s, name or (f"{self._word}{WORD}" if self._word else ""))


class EventsPanel(Panel):
    """Draws the lanes of one run, status and what was noticed; and the log's, once for all runs."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        hold_steps, known = hold_for(scene.updates or USUAL_UPDATES), scene.updates > 0  # else it is live
        self._status, self._step = _Lane(status_path(run.paths), STATUS_COLORS), 0
        self._noticed = _Marks(_Lane(noticed_path(run.paths), NOTICED_COLORS), hold_steps, known)
        self._log = _Marks(_Lane(LOG_LANE, LOG_COLORS), hold_steps, False) if run.number == 0 else None

    def prepare(self, rec: rr.RecordingStream) -> None:
        self._status.prepare(rec)
        for marks in filter(None, (self._noticed, self._log)):
            marks.lane.prepare(rec, marks=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        moment = update.moment
        self._step = moment.frame.step
        self._status.change(rec, self._step, moment.frame.time_s, update.status)
        shown = [event for event in update.events if not event.is_routine]
        self._noticed.draw(rec, moment, [event.kind for event in shown])
        if self._log is not None:
            self._log.draw(rec, moment, [name_of(event) for event in shown])

    def diagnosed(self, rec: rr.RecordingStream, failures: Sequence[Failure]) -> None:
        for failure in failures:
            name, episode = f"{CAUSE}{failure.kind}", failure.episode
            self._status.rename(rec, episode.first, episode.last, states.LOST, name)
            self._status.rename(rec, episode.first, episode.last, states.PROBABLY_LOST, name)
            self._noticed.mark(failure.first, name)

    def finish(self, rec: rr.RecordingStream) -> None:
        self._noticed.finish(rec)
        self._status.shorten(rec, self._step)


def hold_for(updates: int) -> int:
    """Return for how many steps the word of a mark is shown, in a run of this many updates."""
    return max(LEAST_HOLD, round(updates / MARKS_A_RUN))


def status_path(paths: RunPaths) -> str:
    """Return the lane of the localization status."""
    return paths.at("events", "belief")


def noticed_path(paths: RunPaths) -> str:
    """Return the lane of what was noticed in a run."""
    return paths.at("events", "noticed")


def events_view(runs: Sequence[RunView], brief: bool = False) -> rrb.StateTimelineView:
    """Show the lanes of some runs and of the log, with the meaning of the colors in the title.

    Each lane takes 35 pixels, title and time axis together 45: 150 pixels for one run, 220 for two. `brief`
    leaves out what was noticed in each run.
    """
    contents = [status_path(run.paths) if brief else f"{run.paths.at('events')}/**" for run in runs]
    return rrb.StateTimelineView(
        name=f"Events: {LEGEND}; {LINES_LEGEND}", origin="/", contents=[*contents, LOG_LANE]
    )


def name_of(event: RunEvent) -> str:
    """Return an event's kind; of what else the log says its first word, where lanes know it."""
    first = first_word(event.text)
    return first if event.kind == kinds.SESSION and first in LOG_COLORS else event.kind


def line_names(texts: tuple[str, ...]) -> list[str]:
    """Return the names of what a log says at an update."""
    return [name_of(RunEvent(0, 0.0, kind, text)) for kind, text in kinds.logged(texts)]
