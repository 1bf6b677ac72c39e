"""Figures about constants: the robot's motion, the noise of its camera, and what a library can tell by."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from maurice_datasets.trials.drives import survey_log
from maurice_loaders.calibration_trials import covered_pictures
from maurice_mcl.fitting.motion import calibrate
from maurice_mcl.fitting.sensor import noise_floor
from maurice_mcl.fitting.statistics import Fitted
from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.values.arrays import F32
from maurice_viz.plots.calibration import FIGURES as OF_MOTION
from maurice_viz.plots.calibration import INK, ShownFit, motion_figure, noise_figure
from maurice_viz.style import units_named

from .calibration_drive import TrialPlan, calibration_drive
from .marks import by_bin, draw_colors, remark, wrapped
from .material import EXAMPLE, Material, ThesisFigure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEED = 0  # of the simulated calibration trials: the first, not chosen


def of_motion(material: Material, name: str) -> Figure:
    """Draw a figure of calibration trials: those of the simulated robot, as `calibrate drive` makes them."""
    from matplotlib.font_manager import FontProperties

    drawing = motion_figure(name, _shown())
    drawing.legends[0].set_title(wrapped(drawing, _fitted(name, _shown())), FontProperties(size=8))
    return drawing


def _fitted(name: str, shown: ShownFit) -> str:
    """Tell what was fitted, with its interval, and what the thesis has."""
    turns, straights = shown.fit.turns, shown.fit.straights
    if "turn-residual" in name:
        sd = say(turns.residual.sd, np.degrees(1), 1)
        caption = f"sd {sd} deg, the thesis: 4.916; mean {say(turns.residual.mean, np.degrees(1), 1)}, 0.2681"
        return f"{turns.count} simulated turns; {caption}"
    if "turn" in name:
        caption = f"slope, measured over actual: {say(turns.figure_5_slope, 1, 3)}, the thesis: 1.3695"
        return f"{turns.count} simulated turns; {caption}"
    per = shown.units.per_m
    if "heading" in name:
        drifts = (
            f"{drift.floor}: {say(drift.rate.mean, np.degrees(1) / per, 2)}" for drift in shown.fit.drifts
        )
        return f"{straights.count} simulated straights; mean drift in deg/in on {', on '.join(drifts)}"
    caption = f"mean error {say(straights.error.mean, per, 2)} in, the thesis: -0.6978"
    return f"{straights.count} straights; {caption}; sd {say(straights.error.sd, per, 2)} in, 0.6356"


def say(fitted: Fitted, factor: float, digits: int) -> str:
    """Write a fitted constant with its 95 percent interval."""
    value, low, high = (round(number * factor, digits) for number in (fitted.value, fitted.low, fitted.high))
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


@cache
def _shown() -> ShownFit:
    trials = calibration_drive(SEED, TrialPlan())
    return ShownFit(trials, calibrate(trials), units_named("in"))


def noise(material: Material) -> Figure:
    """Draw the camera's noise floor, from the survey's pictures with the lens covered."""
    spec = material.spec(EXAMPLE)
    arena = material.drive.arena
    assert arena is not None  # the example is simulated
    return noise_figure(noise_floor(covered_pictures(survey_log(spec.world, arena, spec.tier))))


def most_by_bin(material: Material) -> Figure:
    """Draw the largest value of each bin over the library, with its spread over arenas."""
    most = [album.library.index["color"].relevance for album in material.several]
    drawing, axes = by_bin("largest value over the library (256 x share of pixels)")
    draw_colors(axes, np.asarray(most[0]), np.asarray(most))
    remark(drawing, _of_arenas(most))
    return drawing


def most_over_floor(material: Material) -> Figure:
    """Draw by how much the library's largest value of each bin exceeds the noise floor."""
    over = [
        album.library.index["color"].relevance - album.library.index["color"].noise_floor
        for album in material.several
    ]
    drawing, axes = by_bin("largest value less noise floor (256 x share)")
    axes.axhline(0, color=INK, linewidth=1)
    draw_colors(axes, np.asarray(over[0]), np.asarray(over))
    under = int((np.asarray(over) <= 0).any(axis=0).sum())
    below = f"{under} of {3 * BINS} bins are nowhere above the noise in some arena"
    remark(drawing, f"{_of_arenas(over)}; {below}; the thesis: down to about -40")
    return drawing


def _of_arenas(found: list[F32]) -> str:
    if len(found) == 1:
        return "one arena; more seeds show the spread over arenas"
    return f"markers: the example's arena; vertical lines: from lowest to highest of {len(found)} arenas"


TITLES = {
    4: "Measured and actual turns",
    5: "Measured against actual turns",
    6: "Actual and corrected turns",
    7: "Residual of every turn",
    8: "Residuals of turns, and a normal distribution",
    9: "Measured and actual straights on two floors",
    10: "Heading error of every straight on two floors",
    11: "Errors of straights, and a normal distribution",
}
FIGURES = (
    *(
        ThesisFigure(number, TITLES[number], partial(of_motion, name=name))
        for number, name in zip(TITLES, OF_MOTION, strict=True)
    ),
    ThesisFigure(14, "The camera's noise with the lens covered", noise),
    ThesisFigure(15, "Largest value of every bin over the library", most_by_bin),
    ThesisFigure(23, "Largest value of every bin, less the noise floor", most_over_floor),
)
