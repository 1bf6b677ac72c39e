"""What happened: every step in words, events as vertical lines in plots, and lanes over time.

Rerun draws one lane for every element of a state that is an array, in the order of the array (0.41), so that
all lanes of a view are one entity. It has no names for them: those are the states of a second entity, shown
in a narrow view to the left, in the color of each run.

A state lasts until the next one, an event as long as it is reported: one step, or several in a row. What is
too narrow for its word has it on the ground after it, where there is room until the next event. A
kidnapping has a color of its own, and its word begins right after it: events of the next steps join it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.causes import Failure
from maurice_mcl.scoring import events as kinds
from maurice_mcl.scoring import table
from maurice_mcl.scoring.events import KINDS, RunEvent
from maurice_mcl.values import F64, first_word

from ..drawing.arrow import row_of, text_of
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import CARRIED, FRESH, GROUND, LOST, MISSING, PALE, RGB, STATES, font_safe, packed
from ..text.causes import say_state
from ..text.comparison import BRANCH, closest
from ..text.phases import summary
from .panel import MARKDOWN, Panel, StepUpdate, set_phase, set_place

PARTLY = " · only partly drawn, see `--detail`"


class WordsPanel(Panel):
    """Logs a text about every step."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        rec.log(self._paths.text, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        set_phase(rec, update.moment, Phase.PREDICT)
        title, rest = summary(update.moment, update.record, self._scale).split("\n\n", 1)
        text = text_of(font_safe(f"{title}{'' if update.whole else PARTLY}\n\n{rest}"))
        rec.log(self._paths.text, row_of(rr.TextDocument, text=text))


def words_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show what happened in words."""
    return rrb.TextDocumentView(name="What this step did", origin=paths.text)


# First words of what else a log says that have marks of their own.
LOG_WORDS = ("bump", "slip", BRANCH, kinds.PARTED, "teleoperation", "wandering", "collision")
LINE_COLORS: Mapping[str, RGB] = {
    name: FRESH if kind.tone == kinds.ACTS else LOST if kind.tone == kinds.GRAVE else PALE
    for name, kind in KINDS.items()
    if kind.in_plots
} | dict.fromkeys(LOG_WORDS, PALE)
LINE_WIDTH, GRAVE_WIDTH = 0.8, 2.2  # the wider one is seen under another line at the same step


def word_of(name: str) -> str:
    """Return what an event is called beside its mark."""
    kind = KINDS.get(name)
    return (kind.word if kind else "") or name.replace("-", " ")


def name_of(event: RunEvent) -> str:
    """Return an event's kind; of what else the log says its first word, where that has marks of its own."""
    first = first_word(event.text)
    return first if event.kind == kinds.SESSION and first in LOG_WORDS else event.kind


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
            label, color = word_of(name), LINE_COLORS[name]
            width = GRAVE_WIDTH if color == LOST else LINE_WIDTH
            look = rr.SeriesLines(names=[label], colors=[color], widths=[width], aggregation_policy="off")
            rec.log(line, look, static=True)
            for step, time_s in places:
                set_place(rec, step, time_s, Phase.PREDICT)
                for value in (low, high, np.nan):  # the last parts it from the next line
                    rec.log(line, rr.Scalars(value))


SHARED = "/what_happened"  # the lanes of all runs of a recording: the log's, then one a run
NAMES = "/runs"  # the names of those lanes
CLOSER = "/compare/what_happened"  # of several runs: the log's, and which of them is closer to the truth
LOG, NOTICED, WHO = "log", "noticed", "who is closer"
NAMES_SHARE = 0.085  # of the width: the names of the lanes
SCREEN_PX = 1280 * (1 - NAMES_SHARE)  # width of the lanes on a small screen
LETTER_PX, AROUND_PX = 6.4, 8  # of a word, and around it
LANE_PX, ABOVE_PX = 23, 48  # of a lane, and of time axis and path above the lanes

BEFORE_THE_END = 1  # steps of a run that the viewer may leave out at the right

ROOM_STEPS = 3  # after a grave event: others there have no marks, their words stand with its own
MOST_NAMES = 64  # of what begins in the lanes; a denser drive has no room for words
TONES: Mapping[str, RGB] = {  # of what was noticed in a run; what happened to the robot is pale
    kinds.GRAVE: STATES[table.LOST],
    kinds.DOUBTFUL: STATES[table.WRONG],
    kinds.GOOD: STATES[table.LOCALIZED],
    kinds.ACTS: FRESH,
}


@dataclass(frozen=True, slots=True)
class Look:
    """What a lane shows from a step on: a word on a color."""

    word: str
    color: RGB
    is_mark: bool = False  # an event: its word may follow it
    follows: bool = False  # a word that follows its event

    @property
    def after(self) -> Look:
        """The word of an event on the ground, to follow it."""
        return Look(self.word, GROUND, follows=True)

    @property
    def is_grave(self) -> bool:
        """Whether its word goes before those of other events."""
        return self.is_mark and self.color == CARRIED

    def within(self, width_px: float) -> Look:
        """Return it with what so much room holds of its word: "lost" of "lost: carried away", or nothing."""
        return replace(self, word=_fitting([self.word], width_px))


def _fitting(words: Sequence[str], width_px: float) -> str:
    """Return as many words, from the first on, as so much room holds, else what is before their colons."""
    words = [*dict.fromkeys(words)]
    for count in range(len(words), 0, -1):
        states = [word.split(":")[0] for word in words[:count]]
        for some in (words[:count], states, [state.split(",")[0] for state in states]):
            text = ", ".join(some)
            if len(text) * LETTER_PX + AROUND_PX <= width_px:
                return text
    return ""


NOTHING = Look("", GROUND)
EQUALLY_CLOSE = Look("equal", MISSING)


def look_of_state(state: str, failure: Failure | None = None) -> Look:
    """Return the look of a localization status; of a lost run with its cause, where that is known."""
    return Look(say_state(state, failure), STATES[state])


def look_of_event(name: str, color: RGB) -> Look:
    """Return the look of an event."""
    return Look(word_of(name), color, is_mark=True)


@dataclass(slots=True)
class _Change:
    step: int
    name: str  # under which it is logged; its word and color are told at the end
    look: Look
    joined: list[Look] = field(default_factory=list)  # events whose words follow with that of a grave one


def _joins(look: Look, step: int, changes: Sequence[_Change]) -> bool:
    """Return whether an event, with no step between, follows a grave one, whose word needs the room."""
    if not look.is_mark or look.is_grave:
        return False
    grave = next((change for change in reversed(changes) if not change.look.follows), None)
    if grave is None or not grave.look.is_grave or step > grave.step + ROOM_STEPS:
        return False
    return step == grave.step + 1 + (len(changes[-1].joined) if changes[-1].look.follows else 0)


class Lanes:
    """Draws lanes into one entity. What names mean is told anew when causes and lengths are known."""

    def __init__(self, path: str, heads: Sequence[Look]) -> None:
        """Take what stands left of each lane, its name in its color; two lanes may have the same name."""
        self._path, self._heads = path, {f"{number} {head.word}": head for number, head in enumerate(heads)}
        self._changes: list[list[_Change]] = [[] for _ in heads]
        self._times_s: dict[int, float] = {}  # of all steps
        self._looks: dict[str, Look] = {}  # of the names that are logged

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the names of the lanes."""
        _describe(rec, names_of(self._path), self._heads)

    def draw(self, rec: rr.RecordingStream, step: int, time_s: float, looks: Sequence[Look]) -> None:
        """Begin what each lane shows from this step on, where it is another than before."""
        self._times_s[step] = time_s
        before = [changes[-1] if changes else _Change(step, "", NOTHING) for changes in self._changes]
        is_first = not any(self._changes)
        for changes, last, look in zip(self._changes, before, looks, strict=True):
            joined = [look] if _joins(look, step, changes) else []
            look = NOTHING if joined else look
            if look is NOTHING and (last.look.is_mark or last.look.follows):
                look = last.look.after  # after an event its word follows
            if look != last.look:
                changes.append(_Change(step, self._name(rec, look), look))
            if joined:
                changes[-1].joined += joined
        now = [changes[-1] if changes else last for changes, last in zip(self._changes, before, strict=True)]
        if any(change is not last for change, last in zip(now, before, strict=True)):
            set_place(rec, step, time_s, Phase.PREDICT)
            if is_first:
                rec.log(names_of(self._path), rr.StateChange(state=[font_safe(name) for name in self._heads]))
            rec.log(self._path, rr.StateChange(state=[font_safe(change.name) for change in now]))

    def explain(
        self, rec: rr.RecordingStream, lane: int, first: int, last: int, old: Sequence[Look], new: Look
    ) -> None:
        """Give what is shown between two steps another look, also where it began before them."""
        changes = self._changes[lane]
        for change in changes:
            if first <= change.step <= last and change.look in old:
                change.look = new
        earlier = [change for change in changes if change.step <= first]
        if not earlier or earlier[-1].step == first or earlier[-1].look not in old:
            return
        own = changes[len(earlier)].step if len(earlier) < len(changes) else last + 2
        after = min(last + 1, own)
        later = {change.step for some in self._changes for change in some if first < change.step <= after}
        begins = [first, *sorted(later - {after})]  # the viewer parts a lane wherever another changes again
        widest = max(range(len(begins)), key=lambda k: [*begins, after][k + 1] - begins[k])
        looks = [new if k == widest else replace(new, word="") for k in range(len(begins))]
        if after in self._times_s and after < own:
            begins, looks = [*begins, after], [*looks, earlier[-1].look]
        more = [_Change(step, self._name(rec, look), look) for step, look in zip(begins, looks, strict=True)]
        changes[len(earlier) : len(earlier)] = more
        for step in begins:
            now = [[change.name for change in some if change.step <= step][-1:] for some in self._changes]
            set_place(rec, step, self._times_s[step], Phase.PREDICT)
            rec.log(self._path, rr.StateChange(state=[font_safe("".join(name)) for name in now]))

    def finish(self, rec: rr.RecordingStream, steps: int) -> None:
        """Tell what names mean, with words only where there is room for them in a run of so many steps."""
        step_px = SCREEN_PX / max(steps, 1)
        for changes in self._changes:
            end_of_last = steps - BEFORE_THE_END if steps > BEFORE_THE_END else steps + 1
            ends = [*(change.step for change in changes[1:]), end_of_last][: len(changes)]
            untold: list[Look] = []  # events before that have no room for their words themselves
            for change, end in zip(changes, ends, strict=True):
                look, width = change.look, (end - change.step) * step_px
                if look.follows:
                    events = sorted([*untold, *change.joined], key=lambda event: not event.is_grave)
                    look = replace(look, word=_fitting([event.word for event in events], width))
                else:
                    look = look.within(width)
                untold = [*untold, change.look] if look.is_mark and not look.word else []
                if change.name in self._looks:
                    self._looks[change.name] = look
        _describe(rec, self._path, self._looks)

    def _name(self, rec: rr.RecordingStream, look: Look) -> str:
        """Return a name of its own for a change; once there are many, one for all of the same look."""
        if look is NOTHING:
            return ""
        own = f"{look.word} {sum(map(len, self._changes))}"
        name = own if len(self._looks) < MOST_NAMES else f"{look.word}, {look.color}"
        if name not in self._looks:
            self._looks[name] = look if name == own else replace(look, word="")
            _describe(rec, self._path, self._looks)
        return name


def _describe(rec: rr.RecordingStream, path: str, looks: Mapping[str, Look]) -> None:
    """Log word and color of names, static."""
    labels = [font_safe(look.word) or " " for look in looks.values()]
    colors = np.array([packed(look.color) for look in looks.values()], np.uint32)
    values = [font_safe(name) for name in looks]
    rec.log(path, rr.StateConfiguration(values=values, labels=labels, colors=colors), static=True)


class LanesDrawing:
    """Draws the lanes of all runs of a recording together, and for each run its own with what it noticed."""

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._runs, self._scale = rec, runs, scene.scale
        log, noticed, who = Look(LOG, PALE), Look(NOTICED, PALE), Look(WHO, PALE)
        named = [Look(run.short, run.color) for run in runs]
        self._shared = Lanes(SHARED, [log, *named])
        self._own = [
            Lanes(own_path(run.paths), [log, name, noticed]) for run, name in zip(runs, named, strict=True)
        ]
        self._closer = [Lanes(CLOSER, [log, who])] if len(runs) > 1 and scene.has_truth else []
        self._truth: F64 | None = None  # the first run's at the update before
        self._steps = 0
        for lanes in (self._shared, *self._own, *self._closer):
            lanes.prepare(rec)

    def see(self, updates: Sequence[StepUpdate]) -> None:
        """Draw an update of all runs, in their order."""
        moment = updates[0].moment
        step, time_s = moment.frame.step, moment.frame.time_s
        log, self._steps = self._log(updates[0]), max(step, self._steps)
        states = [look_of_state(update.status) if update.status else NOTHING for update in updates]
        self._shared.draw(self._rec, step, time_s, [log, *states])
        for lanes, update, state in zip(self._own, updates, states, strict=True):
            lanes.draw(self._rec, step, time_s, [log, state, gravest(update, kinds.OF_RUN)])
        for lanes in self._closer:
            lanes.draw(self._rec, step, time_s, [log, self._look_of_closest(updates)])

    def _look_of_closest(self, updates: Sequence[StepUpdate]) -> Look:
        """Return the name and the color of the run that is closest to the truth, if one is."""
        steps = {
            run.label: (update.moment, update.record) for run, update in zip(self._runs, updates, strict=True)
        }
        label = closest(steps, self._runs[0].radii)
        colors = (Look(run.short, run.color) for run in self._runs if run.label == label)
        return next(colors, EQUALLY_CLOSE)

    def _log(self, update: StepUpdate) -> Look:
        """Return what the log says at an update of the first run; of a kidnapping how far it was."""
        log, truth, before = gravest(update, kinds.OF_LOG), update.moment.truth, self._truth
        self._truth = truth
        if log.word != kinds.KIDNAPPED or truth is None or before is None:
            return log
        carried = self._scale.say(float(np.hypot(*(truth - before)[:2])))
        return replace(log, word=f"kidnapped: carried {carried}")

    def end(self, failures: Mapping[str, Sequence[Failure]]) -> None:
        """Draw all again: why a run was lost, by the run's label, and words where there is room for them."""
        lost = [look_of_state(state) for state in (table.LOST, table.PROBABLY_LOST)]
        together = look_of_state(table.CONVERGED)  # without truth, of a run that is doubted only at the end
        for number, run in enumerate(self._runs):
            for failure in failures.get(run.label, ()):
                first, last = failure.episode.first, failure.episode.last
                old, cause = [*lost, together], look_of_state(table.LOST, failure)
                self._shared.explain(self._rec, 1 + number, first, last, old, cause)
                self._own[number].explain(self._rec, 1, first, last, old, cause)
        for lanes in (self._shared, *self._own, *self._closer):
            lanes.finish(self._rec, self._steps)


def own_path(paths: RunPaths) -> str:
    """Return the lanes of one run: the log's, its status, what was noticed in it."""
    return paths.at("what_happened")


def names_of(path: str) -> str:
    """Return where the names of lanes are."""
    return path.replace(SHARED, NAMES)


def gravest(update: StepUpdate, lane: str) -> Look:
    """Return the gravest event of an update that stands in this kind of lane; nothing if there is none."""
    for event in update.events:  # in the order of KINDS, the gravest first
        kind = KINDS[event.kind]
        if lane in kind.lanes and not event.is_routine:
            tone = PALE if lane == kinds.OF_LOG else TONES.get(kind.tone, PALE)
            return look_of_event(name_of(event), CARRIED if event.kind == kinds.KIDNAPPED else tone)
    return NOTHING


def lanes_view(path: str) -> rrb.Horizontal:
    """Show lanes, with their names to the left."""
    until_cursor = rr.TimeRange(
        start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.cursor_relative(seq=0)
    )  # the names are the same at all times, and so the time cursor stands at their right edge
    names = rrb.StateTimelineView(
        name="Lanes",
        titlebar=False,
        origin="/",
        contents=[names_of(path)],
        time_view=rrb.TimeAxis(view_range=until_cursor),
    )
    lanes = rrb.StateTimelineView(name="What happened", titlebar=False, origin="/", contents=[path])
    return rrb.Horizontal(names, lanes, column_shares=[NAMES_SHARE, 1 - NAMES_SHARE])


def lanes_px(count: int) -> int:
    """Return the height of so many lanes, in pixels."""
    return ABOVE_PX + LANE_PX * count
