"""What a calibration says: a table for people, JSON for programs, TOML for the filter."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from rich.table import Table

from maurice_loaders.config_files import motion_to_toml
from maurice_mcl.calibration.motion import Calibration
from maurice_mcl.calibration.noise import NoiseFloor
from maurice_mcl.calibration.statistics import NOT_NORMAL, Fitted, Spread

from ..style import Units

DEG = 180 / math.pi


def motion_table(fit: Calibration, units: Units, name: str) -> Table:
    """List every constant with its interval, angles in degrees and lengths in display units."""
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
    table.add_row(f"{what}, mean", *_cells(spread.mean, factor, digits), _judged(spread))
    far = f"; {spread.beyond_3_sd} beyond 3 sd" if spread.beyond_3_sd else ""
    table.add_row("  sd", *_cells(spread.sd, factor, digits), f"{spread.count} values{far}")


def _cells(fitted: Fitted, factor: float, digits: int) -> tuple[str, str]:
    value, low, high = (f"{v * factor:.{digits}f}" for v in (fitted.value, fitted.low, fitted.high))
    return value, f"{low} to {high}"


def _judged(spread: Spread) -> str:
    if spread.normal_p is None:
        return "all alike" if spread.count > 2 else "too few to test"
    return f"{'not ' if spread.normal_p < NOT_NORMAL else ''}normal, p {spread.normal_p:.2g}"


def motion_toml(fit: Calibration, name: str) -> str:
    """Give the parameters as TOML, with what they were made from as comments."""
    said = f"from {fit.turns.count} turns and {fit.straights.count} straights of {name}"
    return motion_to_toml(fit.motion_header(), (said, "noise is once a movement; drift is by floor"))


def motion_json(fit: Calibration) -> dict[str, Any]:
    """Give everything that was fitted, in metres and radians, and the header's robot.motion."""
    found: dict[str, Any] = _no_nan(asdict(fit))
    return found | {"motion": fit.motion_header()}


def warnings_of(fit: Calibration) -> list[str]:
    """Say what a reader of the table should know."""
    said = []
    if fit.left_out:
        why = "too small, bent, several between two truths, or of doubtful truth"
        said.append(f"{fit.left_out} movements were left out: {why}")
    errors = {"turn residuals": fit.turns.residual, "straight errors": fit.straights.error}
    errors |= {f"drifts on {drift.floor}".removesuffix(" on "): drift.rate for drift in fit.drifts}
    said += [_far_out(what, spread) for what, spread in errors.items() if _has_far_out(spread)]
    if fit.turns.one_sided:
        said.append("turns go mostly one way, so that gain and bias of turns cannot be told apart well")
    left, right = fit.turns.left_gain, fit.turns.right_gain
    if fit.turns.uneven and left and right:
        gains = f"{left.value:.4f} ({left.low:.4f} to {left.high:.4f}) to the left and {right.value:.4f}"
        said.append(
            f"turns have gains of {gains} ({right.low:.4f} to {right.high:.4f}) to the right: not one"
        )
    if not fit.drifts:
        said.append("no floor has two straights with a known heading error, so that no drift was fitted")
    return said


def _has_far_out(spread: Spread) -> bool:
    """Tell whether more values lie beyond 3 sd than chance puts there, 27 in 10,000 (one is no news)."""
    return spread.beyond_3_sd > 1 + 0.0027 * spread.count


def _far_out(what: str, spread: Spread) -> str:
    number = f"{spread.beyond_3_sd} of {spread.count} {what}"
    return f"{number} lie beyond 3 sd: slips, perhaps; they are not left out, and make the sd larger"


def noise_table(floor: NoiseFloor, name: str) -> Table:
    """List the peak of each color."""
    table = Table(title=f"noise of {name}, {floor.frames} covered frames", title_justify="left")
    columns = ("color", "peak", "sd between frames", "largest sd of a bin", "at pixel values", "mean value")
    for column in columns:
        table.add_column(column, justify="left" if column == "color" else "right")
    for peak, level in zip(floor.peaks(), floor.level, strict=True):
        values = f"{peak.first_value} to {peak.last_value}"
        numbers = (f"{peak.count:.2f}", _or_none(peak.sd), _or_none(peak.largest_bin_sd), values)
        table.add_row(peak.color, *numbers, f"{level:.1f}")
    table.caption = "peaks are 256 x share of pixels, in bins of 8 values from 16"
    return table


def noise_json(floor: NoiseFloor) -> dict[str, Any]:
    """Give peaks and whole histograms."""
    found: dict[str, Any] = {
        "frames": floor.frames,
        "peaks": [asdict(peak) for peak in floor.peaks()],
        "level": floor.level.tolist(),
        "mean": floor.mean.tolist(),
        "sd": floor.sd.tolist(),
    }
    return dict(_no_nan(found))


def _or_none(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def _no_nan(value: Any) -> Any:
    """Turn what is not finite into null, which JSON has."""
    if isinstance(value, dict):
        return {key: _no_nan(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_no_nan(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
