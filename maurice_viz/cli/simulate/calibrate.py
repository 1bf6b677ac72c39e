"""`maurice-replay calibrate motion|noise|drive`: the robot's and the camera's constants from trials."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from maurice_loaders.calibration.covered_pictures import covered_pictures
from maurice_loaders.calibration.trials import METRES, mishaps, read_trials, trials_from_session, write_trials
from maurice_loaders.errors import InputError
from maurice_loaders.formats.odometry_folder import is_odometry_folder, trials_from_folder
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_loaders.session_log.records import read_header
from maurice_mcl.calibration.motion import Calibration, Trials
from maurice_mcl.calibration.motion import calibrate as fit_trials
from maurice_mcl.calibration.noise import noise_floor

from ...style import Units, units_named
from ...text.calibration import motion_json, motion_table, motion_toml, noise_json, noise_table, warnings_of
from ..console import note, results
from ..errors import one_line_errors
from ..options import ForceOption, JsonOption

calibrate = typer.Typer(
    help="Fit the robot's motion or the camera's noise to recorded trials.", no_args_is_help=True
)


def _check_unit(value: str) -> str:
    if value not in METRES:
        raise typer.BadParameter(f"a unit of length is one of {', '.join(METRES)}, found {value!r}")
    return value


@calibrate.command()
def motion(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            show_default=False,
            help="A session log with truth, a CSV of trials, or a folder of odometry beside truth.",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT.toml", help="Write the parameters here.")
    ] = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", metavar="DIR", help="Draw the thesis's figures 4 to 11.")
    ] = None,
    unit: Annotated[
        str,
        typer.Option(help=f"Of lengths in a CSV: {' | '.join(METRES)}.", callback=_check_unit),
    ] = "m",
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Fit turn gain, straight error and drift by floor, with intervals, as the thesis did (3.2, 3.3)."""
    with one_line_errors():
        if output is not None:
            expect_absent(output, force=force)
        if plots is not None:
            from ...plots.figure import expect_matplotlib

            expect_matplotlib(plots)
        trials, units = _trials(source, unit)
        fit = _fitted(source, trials)
        toml = motion_toml(fit, source.name)
        if output is not None:
            write_whole(output, toml.encode(), force=force)
        if plots is not None:
            from ...plots.calibration import Shown, draw_motion

            drawn = draw_motion(Shown(trials, fit, units), plots, force=force)
            note(f"{len(drawn)} figures written to {plots}")
    for text in (*_told(source), *warnings_of(fit)):
        note(f"note: {text}")
    if json_output:
        results.print_json(json.dumps(motion_json(fit)))
        return
    results.print(motion_table(fit, units, source.name))
    if output is None:
        results.print(toml, end="")
    else:
        note(f"{output} written; now try: maurice-replay SESSION --motion {output}")


@calibrate.command()
def noise(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            show_default=False,
            help="A survey log or its folder, or a folder of pictures taken with the lens covered.",
        ),
    ],
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="OUT.png", help="Draw the thesis's figures 13 and 14.")
    ] = None,
    force: ForceOption = False,
    json_output: JsonOption = False,
) -> None:
    """Measure the camera's noise floor in pictures taken with the lens covered."""
    with one_line_errors():
        if plot is not None:
            from ...plots.figure import expect_matplotlib

            expect_matplotlib(plot)
            expect_absent(plot, force=force)
        found = noise_floor(covered_pictures(source))
        if plot is not None:
            from ...plots.calibration import draw_noise

            draw_noise(found, plot, force=force)
            note(f"{plot} written")
    if found.lit:
        note(f"note: the mean pixel value is {found.level.mean():.0f}; was the lens covered?")
    if json_output:
        results.print_json(json.dumps(noise_json(found)))
    else:
        results.print(noise_table(found, source.name))


@calibrate.command()
def drive(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT.csv", help="The table to write.", show_default=False),
    ],
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="The same seed gives the same trials.")] = 0,
    trials: Annotated[
        int, typer.Option(min=1, max=100_000, help="So many turns, and so many straights.")
    ] = 41,
    force: ForceOption = False,
) -> None:
    """Make a table of calibration trials with the simulated Maurice: turns, and straights on both floors."""
    from maurice_datasets.robot.calibration_drive import TrialPlan, calibration_drive

    with one_line_errors():
        expect_absent(output, force=force)
        write_trials(output, calibration_drive(seed, TrialPlan(trials, trials)), force=force)
    results.print(f"{output}: {trials} turns, {trials} straights")
    note(f"now try: maurice-replay calibrate motion {output}")


def _trials(source: Path, unit: str) -> tuple[Trials, Units]:
    """Read trials from whatever was named, and say in which units they are shown."""
    if source.is_dir():
        return trials_from_folder(_odometry_folder(source)), units_named("m")
    if source.suffix.lower() == ".csv":
        return read_trials(source, unit), units_named("in" if unit == "in" else "m")
    trials = trials_from_session(source)
    return trials, units_named(read_header(source)[0].display_units)


def _told(source: Path) -> list[str]:
    """Say what a session log tells of slips and bumps, which are in the constants as well."""
    if source.is_dir() or source.suffix.lower() == ".csv":
        return []
    found = [f"{count} of {word}" for word, count in mishaps(source).items() if count]
    return [f"the log has events: {', '.join(found)}; these movements are not left out"] if found else []


def _odometry_folder(folder: Path) -> Path:
    """Give the folder back, or say which log in it was perhaps meant."""
    logs = sorted(folder.glob("*.log"))
    if logs and not is_odometry_folder(folder):
        raise InputError(folder, f"found a folder without odometry tables; did you mean {logs[0]}?")
    return folder


def _fitted(source: Path, trials: Trials) -> Calibration:
    try:
        return fit_trials(trials)
    except ValueError as problem:
        raise InputError(source, str(problem)) from None
