"""`maurice-replay simulate TASK`: the simulated robot drives, into files or live over a socket."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..console import note, progress, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

if TYPE_CHECKING:
    from maurice_datasets.live import Address, Tally
    from maurice_datasets.simulation import SimulationPlan

MOST_SEED = 2**32 - 1

TaskArgument = Annotated[
    str, typer.Argument(metavar="TASK", help="tracking | global | kidnapped.", show_default=False)
]
FolderOption = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Write session and survey to this folder."),
]
WorldOption = Annotated[str, typer.Option("--world", help="A world's name, or the path of a TOML file.")]
TierOption = Annotated[str, typer.Option("--tier", help="nominal | dim | hard.")]
ArenaSeedOption = Annotated[
    int,
    typer.Option("--arena-seed", min=0, max=MOST_SEED, help="Textures, furniture, lights and the survey."),
]
SeedOption = Annotated[
    int,
    typer.Option(
        "--seed", min=0, max=MOST_SEED, help="The drive, the session's light, noise; not the survey."
    ),
]
UpdatesOption = Annotated[
    int, typer.Option("--updates", min=1, max=1_000_000, help="How often the robot moves and looks.")
]
KidnapOption = Annotated[
    int | None,
    typer.Option("--kidnap-at", min=1, help="Carried away after this update. [default: half way]"),
]
LightsOption = Annotated[
    str, typer.Option("--lights", help="Changes of light, like dim@40,off@60 (docs/conditions.md).")
]
MovedOption = Annotated[
    int, typer.Option("--moved", min=0, max=1000, help="Pieces of furniture moved after the survey.")
]
GainOption = Annotated[str, typer.Option("--gain", help="The session's camera: fixed | auto.")]
MotionOption = Annotated[
    Path | None,
    typer.Option(
        "--motion-from",
        metavar="PATH",
        help="Follow a recorded path with its odometry: a session log with truth, or a folder with gt.txt, "
        "odom_pose.txt and odom_quaternion.txt.",
    ),
]
HalfOption = Annotated[
    bool,
    typer.Option(
        "--half-resolution", help="Survey and session read every other column only, as the CMUcam2."
    ),
]
ServeOption = Annotated[
    str | None,
    typer.Option(
        "--serve", metavar="tcp://HOST:PORT", help="Write no files: be the live robot at this address."
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option("--rate", min=0, max=1e6, help="With --serve: times real time; 0 never waits. [default: 1]"),
]
NoTruthOption = Annotated[
    bool, typer.Option("--no-truth", help="With --serve: say neither truth nor events.")
]


@dataclass(frozen=True, slots=True)
class Live:
    """Where and how fast a live robot speaks."""

    address: Address
    rate: float
    truth: bool


def simulate(
    task: TaskArgument,
    output: FolderOption = None,
    world: WorldOption = "two-rooms",
    tier: TierOption = "nominal",
    arena_seed: ArenaSeedOption = 0,
    seed: SeedOption = 0,
    updates: UpdatesOption = 120,
    kidnap_at: KidnapOption = None,
    lights: LightsOption = "",
    moved: MovedOption = 0,
    gain: GainOption = "fixed",
    half_resolution: HalfOption = False,
    motion_from: MotionOption = None,
    serve: ServeOption = None,
    rate: RateOption = None,
    no_truth: NoTruthOption = False,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Let the simulated robot drive: session log, truth and survey into a folder, or live over a socket."""
    if (output is None) == (serve is None):
        raise typer.BadParameter("give either -o DIR or --serve tcp://HOST:PORT")
    from maurice_datasets.render.conditions import parse_lights
    from maurice_datasets.simulation import SimulationPlan
    from maurice_datasets.tasks import TASKS

    if task not in TASKS:
        raise typer.BadParameter(f"no task called {task!r}; there are {', '.join(TASKS)}")
    try:
        changes = parse_lights(lights)
        plan = SimulationPlan(
            task=TASKS[task],
            world=world,
            tier=tier,
            arena_seed=arena_seed,
            seed=seed,
            updates=updates,
            kidnap_at=kidnap_at,
            lights=changes,
            moved=moved,
            gain=gain,
            half_resolution=half_resolution,
            recording=motion_from,
        )
        live = _live(serve, rate, no_truth)
    except ValueError as problem:
        raise typer.BadParameter(str(problem)) from None
    _run(plan, output, live, force, json_output)


def _live(serve: str | None, rate: float | None, no_truth: bool) -> Live | None:
    from maurice_datasets.live import parse_address

    if serve is None:
        if rate is not None or no_truth:
            raise ValueError("--rate and --no-truth go with --serve")
        return None
    return Live(parse_address(serve), 1.0 if rate is None else rate, not no_truth)


def _run(
    plan: SimulationPlan, output: Path | None, live: Live | None, force: bool, json_output: bool
) -> None:
    with one_line_errors(), progress("arena") as advance:
        if live is not None:
            from maurice_datasets.live import serve

            serve(
                plan,
                live.address,
                live.rate,
                truth=live.truth,
                ready=_announce,
                over=_account,
                progress=advance,
            )
        elif output is not None:
            from maurice_datasets.sessions import write_simulation

            written = write_simulation(output, plan, force=force, progress=advance)
            _tell(written.session, written.survey, json_output)


def _announce(address: Address) -> None:
    """Print where the robot speaks, at once, for whoever waits for that line."""
    print(address, flush=True)


def _account(tally: Tally) -> None:
    """Say what became of the lines."""
    note(f"readers: {tally.readers}, lines left out for slow ones: {tally.dropped}")


def _tell(session: Path, survey: Path, json_output: bool) -> None:
    if json_output:
        results.print_json(json.dumps({"session": str(session), "survey": str(survey)}))
    else:
        results.print(f"{session}\n{survey}")
    note(f"now try: maurice-replay {session}")
