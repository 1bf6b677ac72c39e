"""`maurice-replay calibrate ...`: the robot's and the camera's constants, from drives and from trials."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from rich.box import SIMPLE_HEAD
from rich.table import Table

from maurice_loaders.calibration_trials import LENGTHS
from maurice_loaders.files.writing import expect_absent
from maurice_mcl.fitting.motion import Calibration
from maurice_mcl.fitting.odometry_fit import MotionFit
from maurice_mcl.fitting.sensor import NoiseFloor
from maurice_mcl.fitting.statistics import LEAST_NORMAL_P, Fitted, Spread

from ..app.calibrate import (
    MODELS,
    CalibratedBelief,
    calibrate_belief,
    calibrate_drive,
    calibrate_motion,
    calibrate_noise,
)
from ..plots.calibration import expect_matplotlib
from ..running.output import by_suffix
from ..style import Units
from .shared import options as opt
from .shared.console import listening, note, print_json, results
from .shared.options import argument, option

DEG = 180 / math.pi


def motion(
    source: Annotated[
        Path,
        argument("TRIALS.csv", "A table of trials: what was measured, and what the robot really did."),
    ],
    outputs: Annotated[
        list[Path] | None,
        opt.writes(
            "OUT.toml|DIR", "OUT.toml: the parameters. DIR: the thesis's figures 4 to 11. Repeatable."
        ),
    ] = None,
    unit: Annotated[
        str, option("--unit", "Unit of the lengths in a CSV.", **opt.one_of(LENGTHS, "unit of lengths"))
    ] = "m",
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Fit turn gain, straight error and drift by floor, with intervals, as the thesis did (3.2)."""
    with listening() as listener:
        output, plots = map(by_suffix(outputs, (".toml", "")).get, (".toml", ""))
        if plots is not None:
            expect_matplotlib(plots)
        fitted = calibrate_motion(source, unit=unit, to=output, force=force, listener=listener)
        if plots is not None:
            drawn = fitted.figures(plots, force=force)
            note(f"{len(drawn)} figures written to {plots}")
    if json_output:
        print_json(fitted)
        return
    results.print(_motion_table(fitted.fit, fitted.units, source.name))
    if output is None:
        results.print(fitted.to_toml(), end="")
    else:
        note(f"{output} written; now try: maurice-replay SESSION --set motion={output}")


def noise(
    source: Annotated[
        Path,
        argument(
            "SOURCE", "A survey log or its folder, or a folder of pictures taken with the lens covered."
        ),
    ],
    output: Annotated[Path | None, opt.writes("OUT.png", "Draw the thesis's figures 13 and 14.")] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Measure the camera's noise floor in pictures taken with the lens covered."""
    with listening() as listener:
        if output is not None:
            expect_matplotlib(output)
            expect_absent(output, force=force)
        measured = calibrate_noise(source, listener=listener)
        if output is not None:
            measured.figures(output, force=force)
            note(f"{output} written")
    if json_output:
        print_json(measured)
    else:
        results.print(_noise_table(measured.floor, source.name))


def drive(
    sessions: Annotated[
        list[Path], argument("SESSION...", "Recordings of any format with odometry and truth.")
    ],
    reading: opt.ReadingSet,
    model: Annotated[
        str | None,
        option(
            "--model",
            f"{' | '.join(MODELS)}. [default: the header's, or odometry]",
            metavar="NAME",
            autocompletion=opt.completed(MODELS),
        ),
    ] = None,
    output: Annotated[Path | None, opt.writes("OUT.toml", "Write the parameters here.")] = None,
    force: opt.Force = False,
    json_output: opt.Json = False,
) -> None:
    """Fit the noise of the odometry to drives with truth, with intervals; says what the log cannot tell."""
    with listening() as listener:
        fitted = calibrate_drive(
            *sessions, model=model, reading=reading.options(), to=output, force=force, listener=listener
        )
    if json_output:
        print_json(fitted)
        return
    results.print(_drive_table(fitted.fit, ", ".join(source.name for source in fitted.sources)))
    if output is None:
        results.print(fitted.to_toml(), end="")
    else:
        note(f"{output} written; now try: maurice-replay SESSION --set motion={output}")


def belief(
    runs: Annotated[list[Path], argument("RUN...", "Saved runs with truth, or comparisons.")],
    lost: Annotated[bool, option("--lost", "Also count runs that were lost or kidnapped.")] = False,
    json_output: opt.Json = False,
) -> None:
    """Check how often the regions of a cloud hold the truth, and which exponent of the likelihood fits."""
    with listening() as listener:
        beliefs = calibrate_belief(*runs, lost=lost, listener=listener)
    if json_output:
        print_json(beliefs)
        return
    for belief in beliefs:
        results.print(_belief_table(belief))


def _belief_table(belief: CalibratedBelief) -> Table:
    calibration = belief.calibration
    runs = f"{calibration.runs} run{'s' * (calibration.runs != 1)}"
    title = f"belief of {belief.label}: {calibration.updates} steps of {runs}"
    table = Table(title=title, title_justify="left")
    for heading in ("quantity", "found", "95 % interval", "if calibrated"):
        table.add_column(heading, justify="left" if heading == "quantity" else "right")
    shares = [
        (f"truth in the {100 * region.level:.0f} % region", region.held, f"{100 * region.level:.0f} %")
        for region in calibration.regions
    ]
    shares.append(("truth in two-sigma ellipse", calibration.ellipse, "86.5 % (normal)"))
    for what, share, expected in shares:
        table.add_row(what, *_cells(share, 100, 1, " %"), expected)
    within = "{:.2f} to {:.2f}".format(*calibration.nees_expected)
    table.add_row("NEES, mean", *_cells(calibration.nees, 1, 2), f"3 ({within})")
    table.add_row(
        "exponent of single pictures",
        *_cells(calibration.exponent, 1, 2),
        f"1: it is {calibration.likelihood}",
    )
    table.add_row("exponent for right regions", *_cells(calibration.coverage_exponent, 1, 2), "1")
    table.caption = (
        f"sensor.sharpness was {belief.sharpness:g}; {belief.better_sharpness:.2g} would make the regions "
        "right: run again and check"
    )
    return table


TOLD_FROM_M, TOLD_FROM_DEG = 0.001, 0.05  # a smaller noise of the truth is not told


def _drive_table(fit: MotionFit, name: str) -> Table:
    title = f"{fit.model} model of {name}, {fit.segments} movements between true poses"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("constant", "fitted", "95 % interval", "default"):
        table.add_column(heading, justify="left" if heading == "constant" else "right")
    for constant in fit.constants:
        fitted = constant.fitted
        value, within = (f"{fitted.value:.4g}", f"{fitted.low:.4g} to {fitted.high:.4g}")
        name = constant.name
        if not constant.told:
            value, within, name = "-", "-", f"{name}\n  not told: {constant.why}"
        table.add_row(name, value, within, f"{constant.default:.4g}")
    table.caption = "in meters and radians"
    if fit.truth_sd_m > TOLD_FROM_M or fit.truth_sd_rad > math.radians(TOLD_FROM_DEG):
        off = f"{fit.truth_sd_m:.2g} m on an axis and {math.degrees(fit.truth_sd_rad):.2g} degrees"
        table.caption += f"; the truth itself is off by {off} (sd): what does not grow with the movement"
    if not all(constant.told for constant in fit.constants):
        table.caption += "; what the log does not tell keeps its default"
    return table


def _motion_table(fit: Calibration, units: Units, name: str) -> Table:
    table = Table(title=f"motion of {name}", title_justify="left")
    for heading in ("constant", "value", "95 % interval", "from"):
        table.add_column(heading, justify="left" if heading in ("constant", "from") else "right")
    turns, straights, per_m = fit.turns, fit.straights, units.per_m
    gain_note = f"{turns.count} turns, R² {turns.r_squared:.4f}"
    table.add_row("turn gain, actual / measured", *_cells(turns.gain, 1, 4), gain_note)
    table.add_row("slope of figure 5, measured / actual", *_cells(turns.figure_5_slope, 1, 4), "bootstrap")
    _spread_rows(table, "turn residual (deg)", turns.residual, DEG, 3)
    wrong = f"{turns.sd_if_multiplied_rad * DEG:.3f}"
    table.add_row("  sd, gain the wrong way round (deg)", wrong, "", "thesis: multiply or divide")
    scale_note = f"{straights.count} straights, R² {straights.r_squared:.4f}"
    table.add_row("straight scale, actual / measured", *_cells(straights.scale, 1, 4), scale_note)
    _spread_rows(table, f"straight error ({units.name})", straights.error, per_m, 4)
    for drift in fit.drifts:
        floor = f" on {drift.floor}" if drift.floor else ""
        _spread_rows(table, f"drift{floor} (deg/{units.name})", drift.rate, DEG / per_m, 4)
    return table


def _spread_rows(table: Table, what: str, spread: Spread, factor: float, digits: int) -> None:
    table.add_row(f"{what}, mean", *_cells(spread.mean, factor, digits), _normality(spread))
    far = f"; {spread.beyond_3_sd} beyond 3 sd" if spread.beyond_3_sd else ""
    table.add_row("  sd", *_cells(spread.sd, factor, digits), f"{spread.count} values{far}")


def _cells(fitted: Fitted, factor: float, digits: int, unit: str = "") -> tuple[str, str]:
    value, low, high = (f"{v * factor:.{digits}f}" for v in (fitted.value, fitted.low, fitted.high))
    return value + unit, "too few drives" if math.isnan(fitted.low) else f"{low} to {high}{unit}"


def _normality(spread: Spread) -> str:
    if spread.normal_p is None:
        return "all alike" if spread.count > 2 else "too few to test"
    return f"{'not ' if spread.normal_p < LEAST_NORMAL_P else ''}normal, p {spread.normal_p:.2g}"


def _noise_table(floor: NoiseFloor, name: str) -> Table:
    table = Table(title=f"noise of {name}, {floor.frames} covered frames", title_justify="left")
    columns = ("color", "peak", "sd between frames", "largest sd of a bin", "at pixel values", "mean value")
    for column in columns:
        table.add_column(column, justify="left" if column == "color" else "right")
    for peak, level in zip(floor.peaks(), floor.level, strict=True):
        values = f"{peak.first_value} to {peak.last_value}"
        numbers = (f"{peak.count:.2f}", _or_none(peak.sd), _or_none(peak.largest_bin_sd), values)
        table.add_row(peak.color, *numbers, f"{level:.1f}")
    table.caption = "peaks: of 256 pixels, how many are in one bin of 8 values (from 16)"
    return table


def _or_none(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
