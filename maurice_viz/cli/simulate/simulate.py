"""`maurice-replay simulate TASK`: a drive of the simulated robot, as files or live over a socket."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from maurice_loaders.errors import InputError

from ..console import listening, note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

if TYPE_CHECKING:
    from maurice_datasets.live import Address, Tally

MOST_SEED = 2**32 - 1
WORLD, DRIVE, LIVE = "World and camera", "Drive", "Live robot"

TaskArgument = Annotated[
    str, typer.Argument(metavar="TASK", help="tracking | global | kidnapped.", show_default=False)
]
FolderOption = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Write session and survey to this folder."),
]
WorldOption = Annotated[
    str, typer.Option("--world", help="A world's name, or the path of a TOML file.", rich_help_panel=WORLD)
]
TierOption = Annotated[str, typer.Option("--tier", help="nominal | dim | hard.", rich_help_panel=WORLD)]
ArenaSeedOption = Annotated[
    int,
    typer.Option(
        "--arena-seed",
        min=0,
        max=MOST_SEED,
        help="Seed of textures, furniture, lights and the survey.",
        rich_help_panel=WORLD,
    ),
]
SeedOption = Annotated[
    int,
    typer.Option(
        "--seed",
        min=0,
        max=MOST_SEED,
        help="Seed of the drive, the session's light and noise.",
        rich_help_panel=DRIVE,
    ),
]
UpdatesOption = Annotated[
    int,
    typer.Option(
        "--updates",
        min=1,
        max=1_000_000,
        help="Number of times the robot moves and takes a picture.",
        rich_help_panel=DRIVE,
    ),
]
KidnapOption = Annotated[
    int | None,
    typer.Option(
        "--kidnap-at",
        min=1,
        help="Carry the robot away after this update. [default: halfway]",
        rich_help_panel=DRIVE,
    ),
]
LightsOption = Annotated[
    str,
    typer.Option(
        "--lights", help="Changes of light, like dim@40,off@60 (docs/conditions.md).", rich_help_panel=WORLD
    ),
]
MovedOption = Annotated[
    int,
    typer.Option(
        "--moved",
        min=0,
        max=1000,
        help="Number of pieces of furniture moved after the survey.",
        rich_help_panel=WORLD,
    ),
]
GainOption = Annotated[
    str, typer.Option("--gain", help="The session's camera: fixed | auto.", rich_help_panel=WORLD)
]
MotionOption = Annotated[
    Path | None,
    typer.Option(
        "--motion-from",
        metavar="PATH",
        help="Follow a recorded path with its odometry: a session log with truth, or a folder with gt.txt, "
        "odom_pose.txt and odom_quaternion.txt.",
        rich_help_panel=DRIVE,
    ),
]
HalfOption = Annotated[
    bool,
    typer.Option(
        "--half-resolution",
        help="Read only every other column, as the CMUcam2 does, in survey and session.",
        rich_help_panel=WORLD,
    ),
]
ServeOption = Annotated[
    str | None,
    typer.Option(
        "--serve",
        metavar="tcp://HOST:PORT",
        help="Write no files; serve the drive live at this address.",
        rich_help_panel=LIVE,
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        min=0,
        max=1e6,
        help="With --serve: speed as a multiple of real time; 0 never waits. [default: 1]",
        rich_help_panel=LIVE,
    ),
]
NoTruthOption = Annotated[
    bool,
    typer.Option("--no-truth", help="With --serve: send neither truth nor events.", rich_help_panel=LIVE),
]


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
    """Simulate a drive: write session log, truth and survey to a folder, or serve it live over a socket."""
    if (output is None) == (serve is None):
        raise typer.BadParameter("give either -o DIR or --serve tcp://HOST:PORT")
    if serve is None and (rate is not None or no_truth):
        raise typer.BadParameter("--rate and --no-truth go with --serve")
    from maurice_datasets import live, sessions

    try:
        plan = sessions.simulation_plan(
            task,
            world=world,
            tier=tier,
            arena_seed=arena_seed,
            seed=seed,
            updates=updates,
            kidnap_at=kidnap_at,
            lights=lights,
            moved=moved,
            gain=gain,
            half_resolution=half_resolution,
            recording=motion_from,
        )
        address = None if serve is None else live.parse_address(serve)
    except (InputError, ValueError) as problem:
        raise typer.BadParameter(str(problem)) from None
    with one_line_errors(), listening() as listener:
        if address is not None:
            live.serve(
                plan,
                address,
                1.0 if rate is None else rate,
                truth=not no_truth,
                ready=_announce,
                over=_account,
                progress=listener.progress,
            )
        elif output is not None:
            made = sessions.write_simulation(output, plan, force=force, progress=listener.progress)
            _report(made.session, made.survey, json_output)


def _announce(address: Address) -> None:
    """Print the address at once, for a program that waits for that line."""
    print(address, flush=True)


def _account(tally: Tally) -> None:
    """Report how many readers there were and how many lines they missed."""
    note(f"readers: {tally.readers}, lines left out for slow ones: {tally.dropped}")


def _report(session: Path, survey: Path, json_output: bool) -> None:
    if json_output:
        results.print_json(json.dumps({"session": str(session), "survey": str(survey)}))
    else:
        results.print(f"{session}\n{survey}")
    note(f"now try: maurice-replay {session}")
