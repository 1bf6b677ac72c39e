"""Calibrating a robot's motion and its camera's noise from recorded trials; the belief of saved runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders import calibration_trials
from maurice_loaders.config_files import motion_to_toml
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import drive_segments
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.fitting.belief import BeliefCalibration, BeliefJudge
from maurice_mcl.fitting.motion import Calibration, Trials
from maurice_mcl.fitting.motion import calibrate as fit_trials
from maurice_mcl.fitting.odometry import LinearMaurice, LinearModel, LinearOdometry, MotionSegment
from maurice_mcl.fitting.odometry_fit import MotionConstant, MotionFit, fit_motion
from maurice_mcl.fitting.sensor import NoiseFloor, noise_floor
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.values import F64, Arena, SessionInfo, expected_one_of, plain

from ..errors import SILENT, Listener, OptionError
from ..running.open import open_session
from ..running.saved_steps import Pictures, Restored, restored_together
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
        origin = f"from {turns} turns and {straights} straights of {self.source.name}"
        return motion_to_toml(
            self.fit.motion_header(), (origin, "noise is once a movement; drift is by floor")
        )

    def to_json(self) -> dict[str, Any]:
        """Return every constant in meters and radians, and the header's robot.motion."""
        return plain(self.fit) | {"motion": plain(self.fit.motion_header())}

    def figures(self, to: str | Path, *, force: bool = False) -> list[Path]:
        """Draw the thesis's figures 4 to 11 into a folder and return their paths.

        Raises InputError without matplotlib, and where one exists (unless `force`).
        """
        from ..plots.calibration import ShownFit, draw_motion, expect_matplotlib

        expect_matplotlib(Path(to))
        return draw_motion(ShownFit(self.trials, self.fit, self.units), Path(to), force=force)

    @property
    def warnings(self) -> list[str]:
        """What a reader of the constants should know: outliers, uneven turns."""
        fit = self.fit
        warnings = []
        errors = {"turn residuals": fit.turns.residual, "straight errors": fit.straights.error}
        errors |= {f"drifts on {drift.floor}".removesuffix(" on "): drift.rate for drift in fit.drifts}
        for what, spread in errors.items():
            if spread.beyond_3_sd > 1 + 0.0027 * spread.count:  # more than chance puts there; one is no news
                number = f"{spread.beyond_3_sd} of {spread.count} {what}"
                effect = "they are not left out, and make the sd larger"
                warnings.append(f"{number} lie beyond 3 sd: slips, perhaps; {effect}")
        if fit.turns.one_sided:
            warnings.append("most turns go one way, so gain and bias of turns cannot be separated well")
        left, right = fit.turns.left_gain, fit.turns.right_gain
        if fit.turns.uneven and left and right:
            gains = f"{left.value:.4f} ({left.low:.4f} to {left.high:.4f}) to the left and {right.value:.4f}"
            warnings.append(
                f"turns have gains of {gains} ({right.low:.4f} to {right.high:.4f}) to the right: not one"
            )
        if not fit.drifts:
            warnings.append(
                "no floor has two straights with a known heading error, so that no drift was fitted"
            )
        return warnings


def calibrate_motion(
    source: str | Path,
    *,
    unit: str = "m",
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> MotionCalibration:
    """Fit turn gain, straight error and drift per floor to trials, as the thesis did (section 3.2).

    `source` is a CSV of trials (lengths in `unit`); for a drive with truth there is `calibrate_drive`. `to`
    writes the parameters as TOML, for a replay's motion. Raises OptionError for an unknown unit, and
    InputError for a source with too few trials or a file that exists (unless `force`).

        >>> import maurice_viz as mv
        >>> fitted = mv.calibrate_motion("trials.csv")  # doctest: +SKIP
        >>> round(fitted.fit.turns.gain.value, 2)  # doctest: +SKIP
        0.73
        >>> len(fitted.figures("figures"))  # doctest: +SKIP
        8
    """
    path = Path(source)
    if unit not in calibration_trials.LENGTHS:
        lengths = ", ".join(calibration_trials.LENGTHS)
        raise OptionError(f"a unit of length is one of {lengths}, found {unit!r}")
    if to is not None:
        expect_absent(Path(to), force=force)
    if path.suffix.lower() != ".csv":
        advice = "of a drive with truth, calibrate drive --model maurice fits the constants"
        raise InputError(path, f"expected a table of trials (.csv); {advice}")
    trials = calibration_trials.read_trials(path, unit)
    units = units_named("in" if unit == "in" else "m")
    try:
        calibration = MotionCalibration(path, trials, fit_trials(trials), units)
    except ValueError as problem:
        raise InputError(path, str(problem)) from None
    if to is not None:
        write_whole(Path(to), calibration.to_toml().encode(), force=force)
    for text in calibration.warnings:
        listener.warning(f"note: {text}")
    return calibration


@dataclass(frozen=True, slots=True, eq=False)
class NoiseCalibration:
    """The noise floor of a camera."""

    source: Path
    floor: NoiseFloor

    def to_json(self) -> dict[str, Any]:
        """Return the peaks and the whole histograms."""
        facts = {name: getattr(self.floor, name) for name in ("frames", "level", "mean", "sd")}
        return plain(facts | {"peaks": self.floor.peaks()})

    def figures(self, to: str | Path, *, force: bool = False) -> list[Path]:
        """Draw the thesis's figures 13 and 14 into a file (.png) and return its path.

        Raises InputError without matplotlib, and where the file exists (unless `force`).
        """
        from ..plots.calibration import draw_noise, expect_matplotlib

        expect_matplotlib(Path(to))
        draw_noise(self.floor, Path(to), force=force)
        return [Path(to)]


def calibrate_noise(source: str | Path, *, listener: Listener = SILENT) -> NoiseCalibration:
    """Measure the camera's noise floor in pictures taken with the lens covered.

    `source` is a survey log or its folder, or a folder of such pictures. Raises InputError if there are
    none.

        >>> import maurice_viz as mv
        >>> mv.calibrate_noise("survey.log").floor.frames
        1
    """
    floor = noise_floor(calibration_trials.covered_pictures(Path(source)))
    if floor.lit:
        listener.warning(f"note: the mean pixel value is {floor.level.mean():.0f}; was the lens covered?")
    return NoiseCalibration(Path(source), floor)


def _stands(constant: MotionConstant) -> str:
    """Return what the value is of a constant that a log does not tell by itself."""
    return "the default" if constant.value == constant.default else "what fits with it"


MODELS = ("odometry", "maurice")
LEAST_MAST_M = 0.02  # a place of the truth that is nearer the wheels' center is not told
SCALE_TOLERANCE = 0.01  # a scale that is surely farther from 1 is no noise


@dataclass(frozen=True, slots=True)
class DriveCalibration:
    """A motion model fitted to drives with truth, with intervals."""

    sources: tuple[Path, ...]
    fit: MotionFit

    def to_toml(self) -> str:
        """Return the constants as TOML for a replay, and which of them the log does not tell."""
        names = ", ".join(source.name for source in self.sources)
        comments = [f"from {self.fit.segments} movements of {names}"]
        comments += [
            f"{constant.name}: {_stands(constant)}, {constant.why}"
            for constant in self.fit.constants
            if not constant.told
        ]
        return motion_to_toml(self.fit.motion_header(), tuple(comments))

    def to_json(self) -> dict[str, Any]:
        """Return every constant with its interval, and the header's robot.motion."""
        return plain(self.fit) | {"motion": plain(self.fit.motion_header())}

    @property
    def warnings(self) -> list[str]:
        """What the log cannot tell, and movements that no constant explains."""
        fit = self.fit
        warnings = [
            f"{constant.name}: {constant.why}; {_stands(constant)} stands"
            for constant in fit.constants
            if not constant.told
        ]
        scales = {"ways": ("odometry_scale", fit.way_scale), "turns": ("turn_scale", fit.turn_scale)}
        for what, (key, scale) in scales.items():
            if scale is not None and (scale.low > 1 + SCALE_TOLERANCE or scale.high < 1 - SCALE_TOLERANCE):
                within = f"{scale.value:.3f} ({scale.low:.3f} to {scale.high:.3f})"
                advice = f"correct that with --reading {key}={scale.value:.3f} and fit again"
                warnings.append(
                    f"{what} are really {within} times as measured, which counts as noise; {advice}"
                )
        warnings += _mast_words(fit)
        if fit.far > 1 + fit.segments / 1000:
            warnings.append(f"{fit.far} of {fit.segments} movements are far beyond the noise: slips, perhaps")
        return warnings


def _mast_words(fit: MotionFit) -> list[str]:
    """Say where on the robot the truth is measured, if that is clearly not the wheels' center."""
    places = {"truth_ahead_m": fit.ahead_m, "truth_left_m": fit.left_m}
    away = {
        name: place
        for name, place in places.items()
        if place is not None and not place.holds(0) and abs(place.value) > LEAST_MAST_M
    }
    if not away:
        return []
    typed = " ".join(f"--reading {name}={place.value:.3f}" for name, place in away.items())
    within = " and ".join(f"{p.value:.3f} m ({p.low:.3f} to {p.high:.3f})" for p in away.values())
    words = " and ".join("ahead of" if name == "truth_ahead_m" else "left of" for name in away)
    return [
        f"the truth is of a place {within} {words} the wheels' center, taken out here; elsewhere use {typed}"
    ]


def calibrate_drive(
    *sources: str | Path,
    model: str | None = None,
    reading: Reading | None = None,
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> DriveCalibration:
    """Fit the constants of a motion model to recordings with odometry and truth, of any format.

    `model` is one of MODELS; None: the one that the first recording's header names, or the odometry model.
    `to` writes the constants as TOML, for a replay's motion. A constant that the recordings cannot tell keeps
    its default, and the listener is told why. Raises OptionError for an unknown model, and InputError for
    recordings with fewer than ten movements between true poses, or a file that exists (unless `force`).

        >>> import maurice_viz as mv
        >>> found = mv.calibrate_drive("session.log", model="odometry")
        >>> len(found.fit.constants)
        4
    """
    paths = tuple(Path(source) for source in sources)
    if not paths:
        raise OptionError("found no recording, expected one or more")
    if model not in (None, *MODELS):
        raise OptionError(f"found the model {model!r}, {expected_one_of(model, MODELS)}")
    if to is not None:
        expect_absent(Path(to), force=force)
    options = reading or Reading()
    drives = [_driven(path, options, listener) for path in paths]
    segments, info = [segment for drive, _ in drives for segment in drive], drives[0][1]
    named = (info.motion or {}).get("model", "maurice" if info.motion else "odometry")
    chosen: LinearModel = LinearOdometry()
    if (model or named) == "maurice":
        floor_of = partial(_floor_between, info.arena)
        named = [(segment, floor_of(segment.before[:2], segment.after[:2])) for segment in segments]
        segments = [segment for segment, floor in named if floor is not None]  # others tell no floor's drift
        floors = {floor or "" for _, floor in named if floor is not None}
        chosen = LinearMaurice(tuple(sorted(floors)), floor_of)
    try:
        calibration = DriveCalibration(paths, fit_motion(segments, chosen))
    except ValueError as problem:
        raise InputError(paths[0], str(problem)) from None
    if to is not None:
        write_whole(Path(to), calibration.to_toml().encode(), force=force)
    for text in calibration.warnings:
        listener.warning(f"note: {text}")
    return calibration


def _driven(path: Path, options: Reading, listener: Listener) -> tuple[list[MotionSegment], SessionInfo]:
    """Return the movements between true poses of a recording."""
    session = open_session(path, options, listener)
    return list(drive_segments(session)), session.info


SAMPLES = 9  # points of a way at which the floor is looked up


def _floor_between(arena: Arena | None, start: F64, end: F64) -> str | None:
    """Name the floor of a straight way between two points (2,); "" without one, None across several."""
    if arena is None:
        return ""
    names = {_floor_at(arena, point) for point in np.linspace(start, end, SAMPLES)}
    return names.pop() if len(names) == 1 else None


def _floor_at(arena: Arena, point: F64) -> str:
    """Name the topmost floor at a point (2,); "" where there is none."""
    return next((floor.name for floor in reversed(arena.floors) if floor.depth_m(point[None])[0] >= 0), "")


# Whether saved runs believe what is true: how often the regions of their clouds hold the true pose.


@dataclass(frozen=True, slots=True)
class CalibratedBelief:
    """What was found for all runs of one label."""

    label: str
    calibration: BeliefCalibration
    left_out: int  # runs that were lost or kidnapped: their regions cannot hold the truth
    sharpness: float  # of the likelihood, as these runs had it

    @property
    def better_sharpness(self) -> float:
        """The value of `sensor.sharpness` under which the 90 % region would hold the truth in 90 %."""
        return self.sharpness * self.calibration.coverage_exponent.value

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        own = plain(self, "better_sharpness")
        del own["calibration"]
        return own | plain(self.calibration, "likelihood")


def calibrate_belief(
    *runs: str | Path, lost: bool = False, listener: Listener = SILENT
) -> list[CalibratedBelief]:
    """Judge the belief of saved runs with truth: one result per label, over all runs of that label.

    A run that was lost or kidnapped is left out, unless `lost`: its regions cannot hold the truth. Raises
    InputError for what is no saved run, and where no run is left; OptionError without any run.

        >>> import maurice_viz as mv
        >>> [belief] = mv.calibrate_belief("my-run")
        >>> [region.level for region in belief.calibration.regions]
        [0.5, 0.9, 0.99]
    """
    if not runs:
        raise OptionError("found no saved run, expected one or more")
    labelled: dict[str, list[SavedRun]] = {}
    for path in runs:
        for saved in open_runs(Path(path)):
            labelled.setdefault(saved.manifest.label, []).append(saved)
    return [_calibrated(label, alike, lost=lost, listener=listener) for label, alike in labelled.items()]


def _calibrated(label: str, runs: Sequence[SavedRun], *, lost: bool, listener: Listener) -> CalibratedBelief:
    judge, left_out = BeliefJudge(), 0
    for number, run in enumerate(runs, 1):
        listener.progress(number, len(runs), f"belief of {label}")
        judge.begin(run.manifest.session.sha256)
        if not _judged(judge, run) and not lost:
            judge.drop()
            left_out += 1
    if left_out == len(runs):
        what = "each of these runs was" if left_out > 1 else "the run was"
        raise InputError(runs[0].folder, f"{what} lost or kidnapped, which is left out; --lost counts it too")
    try:
        calibration = judge.result()
    except ValueError as problem:
        raise InputError(runs[0].folder, str(problem)) from None
    if left_out:
        listener.warning(
            f"note: {label}: {left_out} of {len(runs)} runs were lost or kidnapped and are left out"
        )
    return CalibratedBelief(label, calibration, left_out, runs[0].configuration.parameters.sensor.sharpness)


def _judged(judge: BeliefJudge, run: SavedRun) -> bool:
    """Add the updates of a run; return whether it was healthy."""
    rows = TableRows()
    for moment, records in restored_together([Restored(run, None)], Pictures()):
        [record] = records.values()
        judge.add(record, moment.truth)
        rows.add(moment, record)
    table = rows.table()
    return not table.kidnapped.any() and score_table(table).lost is not True
