"""Calibrating the robot's motion and the camera's noise from recorded trials."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from maurice_loaders.calibration import (
    METERS,
    covered_pictures,
    is_odometry_folder,
    mishaps,
    read_trials,
    trials_from_folder,
    trials_from_session,
    write_trials,
)
from maurice_loaders.config_files import motion_to_toml
from maurice_loaders.errors import InputError
from maurice_loaders.files import expect_absent, write_whole
from maurice_loaders.session_log.records import read_header
from maurice_mcl.calibration.motion import Calibration, Trials
from maurice_mcl.calibration.motion import calibrate as fit_trials
from maurice_mcl.calibration.sensor import NoiseFloor, noise_floor

from ..errors import OptionError
from ..listener import SILENT, Listener
from ..style import Units, units_named


@dataclass(frozen=True, slots=True, eq=False)
class MotionCalibration:
    """The motion of a robot, fitted to trials, with intervals."""

    source: Path
    trials: Trials
    fit: Calibration  # meters and radians
    units: Units  # in which people read lengths of these trials

    def to_toml(self) -> str:
        """Return the parameters as TOML, with the trials that they were fitted to as a comment."""
        turns, straights = self.fit.turns.count, self.fit.straights.count
        made = f"from {turns} turns and {straights} straights of {self.source.name}"
        return motion_to_toml(self.fit.motion_header(), (made, "noise is once a movement; drift is by floor"))

    def to_json(self) -> dict[str, Any]:
        """Return every constant in meters and radians, and the header's robot.motion."""
        found: dict[str, Any] = _no_nan(asdict(self.fit))
        return found | {"motion": self.fit.motion_header()}

    @property
    def warnings(self) -> list[str]:
        """What a reader of the constants should know: movements left out, outliers, uneven turns."""
        fit = self.fit
        said = []
        if fit.left_out:
            why = "too small, bent, several between two truths, or of doubtful truth"
            said.append(f"{fit.left_out} movements were left out: {why}")
        errors = {"turn residuals": fit.turns.residual, "straight errors": fit.straights.error}
        errors |= {f"drifts on {drift.floor}".removesuffix(" on "): drift.rate for drift in fit.drifts}
        for what, spread in errors.items():
            if spread.beyond_3_sd > 1 + 0.0027 * spread.count:  # more than chance puts there; one is no news
                number = f"{spread.beyond_3_sd} of {spread.count} {what}"
                kept = "they are not left out, and make the sd larger"
                said.append(f"{number} lie beyond 3 sd: slips, perhaps; {kept}")
        if fit.turns.one_sided:
            said.append("most turns go one way, so gain and bias of turns cannot be separated well")
        left, right = fit.turns.left_gain, fit.turns.right_gain
        if fit.turns.uneven and left and right:
            gains = f"{left.value:.4f} ({left.low:.4f} to {left.high:.4f}) to the left and {right.value:.4f}"
            said.append(
                f"turns have gains of {gains} ({right.low:.4f} to {right.high:.4f}) to the right: not one"
            )
        if not fit.drifts:
            said.append("no floor has two straights with a known heading error, so that no drift was fitted")
        return said


def calibrate_motion(
    source: str | Path,
    *,
    unit: str = "m",
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> MotionCalibration:
    """Fit turn gain, straight error and drift per floor to trials, as the thesis did (sections 3.2 and 3.3).

    `source` is a session log with truth, a CSV of trials (lengths in `unit`), or a folder of odometry beside
    truth. `to` writes the parameters as TOML, for a replay's motion. Raises OptionError for an unknown unit,
    and InputError for a source with too few trials or a file that exists (unless `force`).

        >>> import maurice_viz as mv
        >>> fitted = mv.calibrate_motion(mv.make_trials("trials.csv"))
        >>> round(fitted.fit.turns.gain.value, 2)
        0.73
    """
    path = Path(source)
    if unit not in METERS:
        raise OptionError(f"a unit of length is one of {', '.join(METERS)}, found {unit!r}")
    if to is not None:
        expect_absent(Path(to), force=force)
    trials, units = _trials(path, unit)
    try:
        found = MotionCalibration(path, trials, fit_trials(trials), units)
    except ValueError as problem:
        raise InputError(path, str(problem)) from None
    if to is not None:
        write_whole(Path(to), found.to_toml().encode(), force=force)
    for text in (*_mishaps(path), *found.warnings):
        listener.warning(f"note: {text}")
    return found


def calibrate_noise(source: str | Path, *, listener: Listener = SILENT) -> NoiseFloor:
    """Measure the camera's noise floor in pictures taken with the lens covered.

    `source` is a survey log or its folder, or a folder of such pictures. Raises InputError if there are
    none.

        >>> import maurice_viz as mv
        >>> mv.calibrate_noise("survey.log").frames
        1
    """
    found = noise_floor(covered_pictures(Path(source)))
    if found.lit:
        listener.warning(f"note: the mean pixel value is {found.level.mean():.0f}; was the lens covered?")
    return found


def noise_json(floor: NoiseFloor) -> dict[str, Any]:
    """Return the peaks and the whole histograms of a noise floor as JSON."""
    found: dict[str, Any] = {
        "frames": floor.frames,
        "peaks": [asdict(peak) for peak in floor.peaks()],
        "level": floor.level.tolist(),
        "mean": floor.mean.tolist(),
        "sd": floor.sd.tolist(),
    }
    return dict(_no_nan(found))


def make_trials(to: str | Path, *, trials: int = 41, seed: int = 0, force: bool = False) -> Path:
    """Write a CSV of calibration trials of the simulated Maurice and return its path.

    So many turns, and so many straights on both floors, in meters and radians. Raises InputError if the
    file exists (unless `force`).

        >>> import maurice_viz as mv
        >>> mv.make_trials("trials.csv", trials=5).name
        'trials.csv'
    """
    from maurice_datasets.robot.motion import TrialPlan, calibration_drive

    path = Path(to)
    expect_absent(path, force=force)
    write_trials(path, calibration_drive(seed, TrialPlan(trials, trials)), force=force)
    return path


def figures(
    source: str | Path | MotionCalibration | NoiseFloor,
    to: str | Path,
    *,
    unit: str = "m",
    force: bool = False,
) -> list[Path]:
    """Draw the figures of the thesis about a calibration and return their paths. Needs matplotlib.

    Figures 4 to 11 of a motion calibration, or of the trials that `source` names, go to the folder `to`;
    figures 13 and 14 of a noise floor to the file `to` (.png). Raises InputError without matplotlib and where
    a file exists (unless `force`).

        >>> import maurice_viz as mv
        >>> files = mv.figures(mv.make_trials("trials.csv"), "figures")
        >>> len(files)
        8
    """
    from ..plots.calibration import Shown, draw_motion, draw_noise, expect_matplotlib

    target = Path(to)
    expect_matplotlib(target)
    if isinstance(source, NoiseFloor):
        draw_noise(source, target, force=force)
        return [target]
    made = source if isinstance(source, MotionCalibration) else calibrate_motion(source, unit=unit)
    return draw_motion(Shown(made.trials, made.fit, made.units), target, force=force)


def _trials(source: Path, unit: str) -> tuple[Trials, Units]:
    """Read trials of any kind, with the units in which people read their lengths."""
    if source.is_dir():
        logs = sorted(source.glob("*.log"))
        if logs and not is_odometry_folder(source):
            raise InputError(source, f"found a folder without odometry tables; did you mean {logs[0]}?")
        return trials_from_folder(source), units_named("m")
    if source.suffix.lower() == ".csv":
        return read_trials(source, unit), units_named("in" if unit == "in" else "m")
    trials = trials_from_session(source)
    return trials, units_named(read_header(source)[0].display_units)


def _mishaps(source: Path) -> list[str]:
    """Report the slips and bumps of a session log, which the constants contain as well."""
    if source.is_dir() or source.suffix.lower() == ".csv":
        return []
    found = [f"{count} of {word}" for word, count in mishaps(source).items() if count]
    return [f"the log has events: {', '.join(found)}; these movements are not left out"] if found else []


def _no_nan(value: Any) -> Any:
    """Turn what is not finite into null, which JSON has."""
    if isinstance(value, dict):
        return {key: _no_nan(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_no_nan(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
