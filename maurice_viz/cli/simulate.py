"""`maurice-replay simulate|survey`: a drive of the simulated robot, as files or live; its survey."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_loaders.errors import InputError

from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import MOST_SEED, argument, completed, option, read_length

if TYPE_CHECKING:
    from maurice_datasets.live import Address, Tally

WORLD, DRIVE, LIVE = "World and camera", "Drive", "Live robot"
LEAST_SPACING_M = 0.02
TASKS = ("tracking", "global", "kidnapped")


def _worlds(incomplete: str) -> list[str]:
    from maurice_datasets.worlds.build import shipped_worlds  # the shell asks only for this option

    return completed(shipped_worlds())(incomplete)


_world = partial(option, "--world", "A world's name, or the path of a TOML file.", autocompletion=_worlds)
_tier = partial(
    option, "--tier", "nominal | dim | hard.", autocompletion=completed(("nominal", "dim", "hard"))
)
_arena_seed = partial(
    option, "--arena-seed", "Seed of textures, furniture, lights and the survey.", min=0, max=MOST_SEED
)


def simulate(
    task: Annotated[str, argument("TASK", "tracking | global | kidnapped.", autocompletion=completed(TASKS))],
    output: Annotated[
        Path | None, option("-o --output", "Write session and survey to this folder.", metavar="DIR")
    ] = None,
    world: Annotated[str, _world(panel=WORLD)] = "two-rooms",
    tier: Annotated[str, _tier(panel=WORLD)] = "nominal",
    arena_seed: Annotated[int, _arena_seed(panel=WORLD)] = 0,
    seed: Annotated[
        int,
        option("--seed", "Seed of the drive, the session's light and noise.", DRIVE, min=0, max=MOST_SEED),
    ] = 0,
    updates: Annotated[
        int,
        option(
            "--updates", "Number of times the robot moves and takes a picture.", DRIVE, min=1, max=1_000_000
        ),
    ] = 120,
    kidnap_at: Annotated[
        int | None,
        option("--kidnap-at", "Carry the robot away after this step. [default: halfway]", DRIVE, min=1),
    ] = None,
    slip_at: Annotated[
        str, option("--slip-at", "Let the wheels spin at this step, or at a range like 34-37.", DRIVE)
    ] = "",
    lights: Annotated[
        str, option("--lights", "Changes of light, such as dim@40,off@60,daylight@20-100,on@80,drift.", WORLD)
    ] = "",
    moved: Annotated[
        int,
        option("--moved", "Number of pieces of furniture moved after the survey.", WORLD, min=0, max=1000),
    ] = 0,
    people: Annotated[
        int,
        option("--people", "Percentage of the pictures with people in view.", WORLD, min=0, max=100),
    ] = 0,
    gain: Annotated[str, option("--gain", "The session's camera: fixed | auto.", WORLD)] = "fixed",
    half_resolution: Annotated[
        bool,
        option(
            "--half-resolution",
            "Read only every other column, as the CMUcam2 does, in survey and session.",
            WORLD,
        ),
    ] = False,
    motion_from: Annotated[
        Path | None,
        option(
            "--motion-from",
            "Follow a recorded path with its odometry: a session log with truth, or a folder with gt.txt, "
            "odom_pose.txt and odom_quaternion.txt.",
            DRIVE,
            metavar="PATH",
        ),
    ] = None,
    serve: Annotated[
        str | None,
        option(
            "--serve",
            "Write no files; serve the drive live at this address.",
            LIVE,
            metavar="tcp://HOST:PORT",
        ),
    ] = None,
    rate: Annotated[
        float | None,
        option(
            "--rate",
            "With --serve: speed as a multiple of real time; 0 never waits. [default: 1]",
            LIVE,
            min=0,
            max=1e6,
        ),
    ] = None,
    no_truth: Annotated[
        bool, option("--no-truth", "With --serve: send neither truth nor events.", LIVE)
    ] = False,
    lossless: Annotated[
        bool, option("--lossless", "Write pictures as PNG: a replay is then the same run as in `trials run`.")
    ] = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
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
            slip_at=slip_at,
            lights=lights,
            moved=moved,
            people=people,
            gain=gain,
            half_resolution=half_resolution,
            recording=motion_from,
        )
        address = None if serve is None else live.parse_address(serve)
    except (InputError, ValueError) as problem:
        raise typer.BadParameter(str(problem)) from None
    with listening() as listener:
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
            made = sessions.write_simulation(
                output, plan, lossless=lossless, force=force, progress=listener.progress
            )
            _report(made.session, made.survey, json_output)


def _announce(address: Address) -> None:
    """Print the address at once, for a program that waits for that line."""
    print(address, flush=True)


def _account(tally: Tally) -> None:
    note(f"readers: {tally.readers}, lines left out for slow ones: {tally.dropped}")


def _report(session: Path, survey: Path, json_output: bool) -> None:
    if json_output:
        print_json({"session": session, "survey": survey})
    else:
        results.print(f"{session}\n{survey}")
    note(f"now try: maurice-replay {session}")


def survey(
    output: Annotated[
        Path | None, option("-o --output", "Write the survey to this folder.", metavar="DIR")
    ] = None,
    world: Annotated[str, _world()] = "two-rooms",
    tier: Annotated[str, _tier()] = "nominal",
    arena_seed: Annotated[int, _arena_seed()] = 0,
    spacing: Annotated[
        str | None, option("--spacing", "Distance between nodes, like 18in or 0.6m. [default: the world's]")
    ] = None,
    headings: Annotated[
        int | None, option("--headings", "References per node. [default: the world's]", min=1, max=360)
    ] = None,
    poses: Annotated[
        Path | None,
        option("--poses", "Take only these: x_m, y_m, heading_deg, as from `library check`.", metavar="CSV"),
    ] = None,
    contact_sheet: Annotated[
        Path | None,
        option("--contact-sheet", "Draw 24 views of the world (.png or .jpg).", metavar="OUT.png"),
    ] = None,
    half_resolution: Annotated[
        bool, option("--half-resolution", "Read only every other column, as the CMUcam2 does.")
    ] = False,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Take the reference pictures of a simulated world, and some with the lens covered."""
    if output is None and contact_sheet is None:
        raise typer.BadParameter("give -o DIR, or --contact-sheet OUT.png, or both")
    if contact_sheet is not None and contact_sheet.suffix not in (".png", ".jpg"):
        raise typer.BadParameter(f"--contact-sheet ends in .png or .jpg, found {str(contact_sheet)!r}")
    spacing_m = None if spacing is None else read_length(spacing, "--spacing", LEAST_SPACING_M)
    if poses is not None and (spacing is not None or headings is not None):
        raise typer.BadParameter("--poses names every reference: --spacing and --headings do not apply")
    from maurice_datasets.surveys import read_poses, surveyed_world, write_survey_folder

    from ..plots.sheets import write_contact_sheet

    made: dict[str, object] = {}
    with listening() as listener:
        chosen = None if poses is None else read_poses(poses)
        drawn = surveyed_world(world, arena_seed, tier, spacing_m, headings)
        how: dict[str, Any] = {
            "half_resolution": half_resolution,
            "force": force,
            "progress": listener.progress,
        }
        if contact_sheet is not None:
            write_contact_sheet(contact_sheet, drawn, arena_seed, **how)
            made["contact_sheet"] = str(contact_sheet)
        if output is not None:
            log = write_survey_folder(output, drawn, arena_seed, poses=chosen, **how)
            count = len(drawn.nodes) * drawn.headings if chosen is None else len(chosen)
            made |= {"survey": str(log), "references": count}
    if json_output:
        print_json(made)
        return
    results.print("\n".join(str(path) for key, path in made.items() if key != "references"))
    if output is not None:
        first = made["survey"] if chosen is None else f"SURVEY --add {made['survey']}"
        note(f"now try: maurice-replay library build {first} -o LIBRARY")
