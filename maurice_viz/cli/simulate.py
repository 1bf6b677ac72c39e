"""`maurice-replay simulate|survey`: a drive of the simulated robot, as files or live; its survey."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_loaders.errors import InputError

from ..running.output import by_suffix
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import MOST_SEED, argument, completed, option
from .shared.values import read_length

if TYPE_CHECKING:
    from maurice_datasets.live import Address
    from maurice_datasets.simulation import SimulationPlan

WORLD, DRIVE, CHANGES, LIVE = "World and camera", "Drive", "Since the survey", "Live robot"
LEAST_SPACING_M = 0.02
TASKS = ("tracking", "global", "kidnapped")
TIERS = ("nominal", "dim", "hard")


def _worlds(incomplete: str) -> list[str]:
    from maurice_datasets.worlds.build import shipped_worlds  # the shell asks only for this option

    return completed(shipped_worlds())(incomplete)


@dataclass(frozen=True, slots=True)
class WorldSet:
    """The world that is driven through, and its camera."""

    world: Annotated[
        str,
        option(
            "--world",
            "A world's name, or the path of a TOML file.",
            WORLD,
            metavar="NAME|FILE.toml",
            autocompletion=_worlds,
        ),
    ] = "two-rooms"
    tier: Annotated[
        str, option("--tier", "How hard the light makes it.", WORLD, **opt.one_of(TIERS, "tier"))
    ] = "nominal"
    arena_seed: Annotated[
        int,
        option(
            "--arena-seed",
            "Seed of textures, furniture, lights and the survey.",
            WORLD,
            min=0,
            max=MOST_SEED,
        ),
    ] = 0
    half_resolution: Annotated[
        bool,
        option("--half-resolution", "Read only every other column, as the CMUcam2 does, everywhere.", WORLD),
    ] = False


@dataclass(frozen=True, slots=True)
class DriveSet:
    """How the robot drives, and what has changed since the survey."""

    laser: Annotated[
        bool, option("--laser", "A robot with a laser in place of its camera, over a map.", DRIVE)
    ] = False
    seed: Annotated[
        int,
        option("--seed", "Seed of the drive, the session's light and noise.", DRIVE, min=0, max=MOST_SEED),
    ] = 0
    updates: Annotated[
        int,
        option("--updates", "Number of movements, each a step with a camera.", DRIVE, min=1, max=1_000_000),
    ] = 120
    kidnap_at: Annotated[
        int | None,
        option("--kidnap-at", "Carry the robot away after this movement. [default: halfway]", DRIVE, min=1),
    ] = None
    slip_at: Annotated[
        str,
        option(
            "--slip-at",
            "Let the wheels spin in this movement, or in a range like 34-37.",
            DRIVE,
            metavar="MOVEMENTS",
        ),
    ] = ""
    lights: Annotated[
        str,
        option(
            "--lights",
            "Changes of light, such as dim@40,off@60,daylight@20-100,on@80,drift.",
            CHANGES,
            metavar="WORDS",
        ),
    ] = ""
    moved: Annotated[
        int,
        option("--moved", "Number of pieces of furniture moved after the survey.", CHANGES, min=0, max=1000),
    ] = 0
    people: Annotated[
        int, option("--people", "Percentage of the pictures with people in view.", CHANGES, min=0, max=100)
    ] = 0
    gain: Annotated[
        str,
        option("--gain", "Gain of the session's camera.", CHANGES, **opt.one_of(("fixed", "auto"), "gain")),
    ] = "fixed"
    recording: Annotated[
        Path | None,
        option(
            "--motion-from",
            "Follow the path of a session log with truth, with its recorded odometry.",
            DRIVE,
            metavar="PATH",
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class LiveSet:
    """How a drive is served to who listens, instead of being written."""

    serve: Annotated[
        str | None,
        option(
            "--serve", "Write no files; serve the drive at this address.", LIVE, metavar="tcp://HOST:PORT"
        ),
    ] = None
    rate: Annotated[
        float | None,
        option(
            "--rate",
            "With --serve: speed as a multiple of real time; 0 never waits. [default: 1]",
            LIVE,
            min=0,
            max=1e6,
        ),
    ] = None
    no_truth: Annotated[bool, option("--no-truth", "With --serve: send neither truth nor events.", LIVE)] = (
        False
    )


def simulate(
    task: Annotated[str, argument("TASK", f"{' | '.join(TASKS)}.", **opt.one_of(TASKS, "task"))],
    world: WorldSet,
    drive: DriveSet,
    live: LiveSet,
    output: Annotated[Path | None, opt.writes("DIR", "Write session and survey to this folder.")] = None,
    lossless: Annotated[
        bool, option("--lossless", "Write pictures as PNG: a replay is then the same run as in `trials run`.")
    ] = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Simulate a drive: write session log, truth and survey to a folder, or serve it live over a socket."""
    if (output is None) == (live.serve is None):
        raise typer.BadParameter("give either -o DIR or --serve tcp://HOST:PORT")
    if live.serve is None and live != LiveSet():
        raise typer.BadParameter("--rate and --no-truth go with --serve")
    from maurice_datasets import sessions

    try:
        plan = sessions.simulation_plan(task, **asdict(world), **asdict(drive))
    except (InputError, ValueError) as problem:
        raise typer.BadParameter(str(problem)) from None
    if output is None:
        _serve(plan, live)
        return
    with listening() as listener:
        written = sessions.write_simulation(
            output, plan, lossless=lossless, force=force, progress=listener.progress
        )
    if json_output:
        print_json({"session": written.session, "survey": written.survey})
    else:
        results.print(f"{written.session}\n{written.survey}")
    note(f"now try: {shlex.join(['maurice-replay', str(written.session)])}")


def _serve(plan: SimulationPlan, options: LiveSet) -> None:
    from maurice_datasets import live

    try:
        address = live.parse_address(str(options.serve))
    except ValueError as problem:
        raise typer.BadParameter(str(problem)) from None
    with listening() as listener:
        live.serve(
            plan,
            address,
            1.0 if options.rate is None else options.rate,
            truth=not options.no_truth,
            ready=_announce,
            over=lambda tally: note(
                f"readers: {tally.readers}, lines left out for slow ones: {tally.dropped}"
            ),
            progress=listener.progress,
        )


def _announce(address: Address) -> None:
    """Print the address at once, for a program that waits for that line."""
    print(address, flush=True)


def survey(
    files: Annotated[
        list[Path],
        opt.writes(
            "DIR|OUT.png",
            "DIR: write the survey to this folder. OUT.png: draw 24 views of the world. Repeatable.",
        ),
    ],
    world: WorldSet,
    spacing: Annotated[
        str | None,
        option(
            "--spacing",
            "Distance between nodes, like 18in or 0.6m. [default: the world's]",
            metavar="LENGTH",
        ),
    ] = None,
    headings: Annotated[
        int | None, option("--headings", "References per node. [default: the world's]", min=1, max=360)
    ] = None,
    poses: Annotated[
        Path | None,
        option("--poses", "Take only these: x_m, y_m, heading_deg, as from `library check`.", metavar="CSV"),
    ] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Take the reference pictures of a simulated world, and some with the lens covered."""
    outputs = by_suffix(files, ("", ".png", ".jpg"))
    folder = outputs.pop("", None)
    spacing_m = None if spacing is None else read_length(spacing, "--spacing", LEAST_SPACING_M)
    if poses is not None and (spacing is not None or headings is not None):
        raise typer.BadParameter("--poses names every reference: --spacing and --headings do not apply")
    from maurice_datasets.surveys import read_poses, surveyed_world, write_survey_folder

    from ..plots.sheets import write_contact_sheet

    written: dict[str, object] = {}
    with listening() as listener:
        chosen = None if poses is None else read_poses(poses)
        surveyed = surveyed_world(world.world, world.arena_seed, world.tier, spacing_m, headings)
        how: dict[str, Any] = {"half_resolution": world.half_resolution, "force": force}
        how |= {"progress": listener.progress}
        for views in outputs.values():
            write_contact_sheet(views, surveyed, world.arena_seed, **how)
            written["contact_sheet"] = str(views)
        if folder is not None:
            log = write_survey_folder(folder, surveyed, world.arena_seed, poses=chosen, **how)
            count = len(surveyed.nodes) * surveyed.headings if chosen is None else len(chosen)
            written |= {"survey": str(log), "references": count}
    if json_output:
        print_json(written)
        return
    results.print("\n".join(str(path) for key, path in written.items() if key != "references"))
    if folder is not None:
        first = written["survey"] if chosen is None else f"SURVEY --add {written['survey']}"
        note(f"now try: maurice-replay library build {first} -o LIBRARY")
