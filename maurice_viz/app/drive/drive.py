"""Driving the simulated robot by keys while a filter follows it: teleoperation and the operator's screen.

`drive` takes keys from anywhere; the terminal in which they are typed is `cli/drive.py`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import cast

from maurice_mcl.sensor.model import SensorModel

from ...errors import SILENT, Listener, OptionError
from ...running.open import library_at
from ...running.output import OutputOptions, output_of
from ...running.run import Playback, Report, RunScores, play, remark_zeros
from ...running.run_spec import RunSpec
from ...scene import RunView, Scene
from .desk import LABEL, LASER, ROBUST, OperatorsDesk, SensorInUse, Tell

STARTS = ("global", "tracking")


def drive(
    keys: Iterable[str],
    *,
    world: str | Path = "two-rooms",
    tier: str = "nominal",
    seed: int = 0,
    arena_seed: int = 0,
    half_resolution: bool = False,
    laser: bool = False,
    preset: str | None = None,
    particles: int | None = None,
    start: str | None = None,
    folder: str | Path = "drive",
    to: str | Path | None = None,
    force: bool = False,
    output: OutputOptions | None = None,
    tell: Tell = lambda line: None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Drive the simulated robot by keys, while a filter follows it and is drawn; return its scores.

    `keys` are up, down, left and right, or letters as `HELP_TEXT` names them; "" is a moment without a key,
    at which a robot on its own goes on. World and robot are those of `maurice_datasets.simulate`, `seed` is
    also the filter's. `start` is global (the default) or tracking: whether the filter knows where it begins.
    `folder` is where "S" saves the drive to, again and again; it must be new. `to` and `output` say what is
    drawn to, as in `replay`; `tell` gets a line for the operator after every key, an empty one at the end.

    InputError for what cannot be simulated, OptionError for other arguments.

        >>> import maurice_viz as mv
        >>> scores = mv.drive(["up", "left", "k", "q"])  # doctest: +SKIP
        >>> scores.runs[0].score.updates  # doctest: +SKIP
        4
    """
    from maurice_datasets.sessions import simulation_plan
    from maurice_datasets.teleoperation import TeleoperatedRobot

    if start not in (None, *STARTS):
        raise OptionError(f"found start {start!r}, expected {' or '.join(STARTS)}")
    output = output_of("drive", output, to, force=force)
    start = start or STARTS[0]
    plan = simulation_plan(
        start,
        world=str(world),
        tier=tier,
        seed=seed,
        arena_seed=arena_seed,
        half_resolution=half_resolution,
        laser=laser,
    )
    robot = TeleoperatedRobot(plan)
    library = library_at(robot.known(listener.progress), listener)
    spec = RunSpec(preset or (LASER if laser else ROBUST), None, particles, seed)
    desk = OperatorsDesk(robot, library, spec, Path(folder), listener)
    sensor = cast(SensorModel, SensorInUse(desk))
    view = replace(RunView.of(LABEL, desk.run.localizer), localizer=None, sensor=sensor)  # judged by records
    scene = Scene(robot.info, library, has_truth=True, has_pictures=not laser, live=True)
    updates = desk.steps(keys, tell)
    playback = Playback(updates, 0, [view], scene, lambda collector: remark_zeros(collector, listener))
    return play(playback, output, listener, report=report)
