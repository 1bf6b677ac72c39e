"""The operator's desk: a robot, the filter that follows it, and what every key does to both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.filter.branch import branched, recovery_evidence
from maurice_mcl.reasons.second_opinion import SecondOpinion
from maurice_mcl.scoring.comparison import Step
from maurice_mcl.values import INCH_M, Library, Moment

from ...errors import Listener
from ...playback import FilterRun
from ...running.filters import Filter
from ...running.open import make_runs
from ...scene import Scene
from ...text.comparison import BRANCH

if TYPE_CHECKING:
    from maurice_datasets.robot.behaviors import Command
    from maurice_datasets.teleoperation import TeleoperatedRobot

LABEL = "filter"  # of the run, whose preset changes on the way
STRIDE_M, TURN_RAD = 9 * INCH_M, float(np.radians(30))  # of one key
ROBUST, LASER = "robust", "laser"  # the presets to begin with
PRESETS, LASER_PRESETS = ("thesis", "refined", ROBUST, "precise"), (LASER, "amcl")  # by keys 1, 2, ...
COMMANDS: Mapping[str, Command] = {
    "up": (None, STRIDE_M),
    "down": (None, -STRIDE_M),
    "left": (TURN_RAD, 0.0),
    "right": (-TURN_RAD, 0.0),
}
LETTERS = {"w": "up", "s": "down", "a": "left", "d": "right"}  # that drive as the arrows do
HELP, LOOK, CARRY, BUMP, LIGHT, PAUSE, ALONE, SAVE = "?", " ", "k", "b", "l", "p", "A", "S"
QUIT = ("q", "\x04")  # Ctrl-D, too
HELP_TEXT = (
    "arrows or wasd drive, space looks, A: on its own, p pauses, k carries it away, b bumps it, "
    "l changes the light, {presets}, S saves, q ends"
)
Tell = Callable[[str], None]  # shows a line of status in place of the last one


class OperatorsDesk:
    """A robot, the filter that follows it, and what every key does to both."""

    def __init__(
        self, robot: TeleoperatedRobot, library: Library, spec: Filter, folder: Path, listener: Listener
    ) -> None:
        self.run = make_runs(robot, library, [spec], listener)[0]
        self._robot, self._library, self._spec = robot, library, spec
        self._folder, self._saved, self._listener = folder, False, listener
        self._presets = LASER_PRESETS if robot.set_up.plan.laser else PRESETS
        self._runs: dict[str, FilterRun] = {str(spec.preset): self.run}  # by preset
        self._state = self.run.localizer.initialize(self.run.start)
        self._opinion = SecondOpinion.beside(self.run.localizer)
        self._evidences: list[float] = []  # what recovery was told by the sensor that is in use
        self._is_alone = self._is_paused = False
        self._told = ""  # what a key did that moved nothing
        self._notes: tuple[str, ...] = ()  # for the next update's events
        self._scale = Scene(robot.info, library, has_truth=True).scale
        self._moves = {key: COMMANDS[LETTERS.get(key, key)] for key in (*LETTERS, *COMMANDS)}
        self._acts: dict[str, Callable[[], Moment | None]] = {
            LOOK: robot.look,
            CARRY: robot.carry,
            BUMP: robot.bump,
            LIGHT: self._change_light,
            PAUSE: self._pause,
            ALONE: self._let_go,
            SAVE: self._save,
            HELP: self._help,
            "": lambda: self._move(None) if self._is_alone else None,
        }

    def steps(self, keys: Iterable[str], tell: Tell) -> Iterator[Mapping[str, Step]]:
        """Yield a step of the filter for the first picture, and for every one that a key leads to."""
        try:
            yield self._step(self._robot.look())
            tell(f"{self._status()} | {HELP}: help")
            for key in keys:
                if key in QUIT:
                    return
                moment = self._act(key)
                if moment is not None:
                    yield self._step(moment)
                if moment is not None or self._told:
                    tell(self._status())
        finally:
            tell("")

    def _act(self, key: str) -> Moment | None:
        """Do what a key says; return the moment of the picture that it led to, if it led to one."""
        self._told = ""
        if self._is_paused and key not in (PAUSE, SAVE, HELP):
            self._told = f"paused; {PAUSE} goes on" if key else ""
            return None
        if key in self._moves:
            self._is_alone = False
            return self._move(self._moves[key])
        if key.isdigit() and 0 < int(key) <= len(self._presets):
            self._go_on_with(self._presets[int(key) - 1])
            return None
        if key not in self._acts:
            self._told = f"{key!r} does nothing; {HELP}: help"
            return None
        return self._acts[key]()

    def _move(self, command: Command | None) -> Moment:
        before = self._robot.behavior
        moment = self._robot.drive(command)
        if self._robot.behavior != before:
            self._notes = (*self._notes, self._robot.behavior)
        return moment

    def _step(self, moment: Moment) -> Mapping[str, Step]:
        """Return the filter's step at a moment; what the operator changed is among its events."""
        self._state, record = self.run.localizer.step(self._state, moment.frame)
        self._evidences.append(recovery_evidence(record))
        if self._opinion is not None:
            record = self._opinion.added_to(record)
        events, self._notes = (*moment.events, *self._notes), ()
        ordered = sorted(events, key=lambda text: not text.startswith(BRANCH))  # lanes show the first one
        self._last = replace(moment, events=tuple(ordered)), record
        return {LABEL: self._last}

    def _go_on_with(self, preset: str) -> None:
        """Let another preset go on from the present belief."""
        if preset not in self._runs:
            spec = replace(self._spec, preset=preset)
            self._runs[preset] = make_runs(self._robot, self._library, [spec], self._listener)[0]
        before, self.run = self.run, self._runs[preset]
        localizer, size = self.run.localizer, self.run.localizer.particles
        if localizer is not before.localizer:
            self._evidences = []  # another sensor's are no measure of this one's
            self._state = branched(localizer, self._state.step, self._state.belief, (), size)
            self._opinion = SecondOpinion.beside(localizer)
            self._notes = (*self._notes, f"{BRANCH} with preset {preset}")
        self._spec = replace(self._spec, preset=preset)
        self._told = f"{preset} goes on from here"

    def _change_light(self) -> Moment | None:
        moment = self._robot.change_light()
        self._told = "" if moment is not None else "a laser sees no light"
        return moment

    def _pause(self) -> None:
        self._is_paused = not self._is_paused
        self._told = f"paused; {PAUSE} goes on" if self._is_paused else "goes on"

    def _let_go(self) -> None:
        self._is_alone = not self._is_alone
        self._told = f"on its own; {ALONE} or an arrow takes over" if self._is_alone else "by hand"

    def _save(self) -> None:
        try:
            paths = self._robot.save(self._folder, force=self._saved, progress=self._listener.progress)
        except InputError as problem:
            self._told = str(problem)
            return
        self._saved = True
        self._told = f"saved: {paths.session}"

    def _help(self) -> None:
        presets = ", ".join(f"{number}: {name}" for number, name in enumerate(self._presets, start=1))
        self._told = HELP_TEXT.format(presets=presets)

    def _status(self) -> str:
        """Return a line: "step 12 | 3.1 in off | robust | bump, collision avoidance"."""
        moment, record = self._last
        off_m = float(np.hypot(*(record.estimate.pose - self._robot.pose)[:2]))
        happened = [text for text in moment.events if not text.startswith("floor")]
        parts = [f"step {moment.frame.step}", f"{self._scale.say(off_m)} off", str(self._spec.preset)]
        by = [self._robot.behavior] if self._robot.behavior else []
        message = self._told or ", ".join(dict.fromkeys([*happened, *by]))
        return " | ".join([*parts, message] if message else parts)


class SensorInUse:
    """The sensor model of the filter in use, for panels: another preset may have another one.

    Pose sensors that have panels are those of the first preset.
    """

    def __init__(self, desk: OperatorsDesk) -> None:
        self._desk = desk
        self.sensors = desk.run.localizer.sensor.sensors

    def __getattr__(self, name: str) -> Any:
        return getattr(self._desk.run.localizer.sensor, name)
