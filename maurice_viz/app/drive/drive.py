"""Driving the simulated robot by keys while a filter follows it: teleoperation and the operator's screen.

`drive` takes keys from anywhere; the terminal in which they are typed is `cli/drive.py`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from maurice_mcl.sensor.model import SensorModel

from ...errors import SILENT, Listener, OptionError
from ...running.filters import AnyFilter, filter_of
from ...running.open import library_at
from ...running.output import Output, output_of
from ...running.run import Playback, Report, RunScores, play, remark_zeros
from ...scene import RunView, Scene
from .desk import LABEL, LASER, ROBUST, OperatorsDesk, SensorInUse, Tell

if TYPE_CHECKING:
    from maurice_datasets.simulation import SimulationPlan

STARTS = ("global", "tracking")


def drive(
    keys: Iterable[str],
    plan: SimulationPlan | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    folder: str | Path = "drive",
    to: str | Path | None = None,
    force: bool = False,
    output: Output | None = None,
    tell: Tell = lambda line: None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Drive the simulated robot by keys, while a filter follows it and is drawn; return its scores.

    `keys` are up, down, left and right, or letters as `HELP_TEXT` names them; "" is a moment without a key,
    at which a robot on its own goes on. `plan` is a `maurice_datasets.simulation_plan`: of the task global
    (the default) the filter does not know where it begins, of tracking it does. `folder` is where "S" saves
    the drive to, again and again; it must be new. `to` and `output` say what is drawn to, as in `replay`;
    `tell` gets a line for the operator after every key, an empty one at the end.

    InputError for what cannot be simulated, OptionError for other arguments.

        >>> import maurice_viz as mv
        >>> scores = mv.drive(["up", "left", "k", "q"])  # doctest: +SKIP
        >>> scores.runs[0].score.updates  # doctest: +SKIP
        4
    """
    from maurice_datasets.sessions import simulation_plan
    from maurice_datasets.teleoperation import TeleoperatedRobot

    plan = plan or simulation_plan(STARTS[0])
    if plan.task.name not in STARTS:
        raise OptionError(f"found task {plan.task.name!r}, expected {' or '.join(STARTS)}")
    output = output_of("drive", output, to, force=force)
    robot = TeleoperatedRobot(plan)
    library = library_at(robot.known(listener.progress), listener)
    base, laser = filter_of(filter), plan.laser
    spec = base if base.preset else base.set(preset=LASER if laser else ROBUST)
    desk = OperatorsDesk(robot, library, spec, Path(folder), listener)
    sensor = cast(SensorModel, SensorInUse(desk))
    view = replace(RunView.of(LABEL, desk.run.localizer), localizer=None, sensor=sensor)  # judged by records
    scene = Scene(robot.info, library, has_truth=True, has_pictures=not laser, live=True)
    updates = desk.steps(keys, tell)
    playback = Playback(updates, 0, [view], scene, lambda collector: remark_zeros(collector, listener))
    return play(playback, output, listener, report=report)
