"""Every figure of the thesis that trials can make, by its number there; titles and drawings are ours."""

from __future__ import annotations

from functools import partial

from . import clouds, constants, costs, drives, histograms_of_light, matching, success, traces
from . import over_particles as counts
from .material import ThesisFigure

TRAVEL = "Driven before it was lost, against the number of particles"
OVER_PARTICLES = (
    ThesisFigure(26, TRAVEL, partial(counts.before_loss, log=True)),
    ThesisFigure(27, f"{TRAVEL} (linear)", partial(counts.before_loss, log=False)),
    ThesisFigure(28, "Average error against the number of particles", counts.error),
    ThesisFigure(
        29, "Average error against the number of particles, with a fit", partial(counts.error, fitted=True)
    ),
    ThesisFigure(30, "Average error of every run", counts.error_by_run),
    ThesisFigure(37, "Global localization: final error, by what made a run fail", counts.final_error),
    ThesisFigure(
        38,
        "Global localization: distance driven until localized",
        partial(
            counts.localized_median,
            metric="localized_m",
            label="driven until localized (in)",
            features=("color",),
        ),
    ),
    ThesisFigure(39, "Global localization: time to localize", counts.time_to_localize),
    ThesisFigure(
        59,
        "Global localization: error with color and edges blended",
        partial(
            counts.by_feature,
            metric="error_mean_m",
            label="mean error of a run (in)",
            features=("color", "blended"),
        ),
    ),
    ThesisFigure(
        60,
        "Global localization: error with color alone",
        partial(
            counts.by_feature, metric="error_mean_m", label="mean error of a run (in)", features=("color",)
        ),
    ),
    ThesisFigure(
        61,
        "Global localization: time to localize, blended",
        partial(counts.localized_median, features=("color", "blended")),
    ),
    ThesisFigure(
        62,
        "Global localization: time to localize, color alone",
        partial(counts.localized_median, features=("color",)),
    ),
)
OF_PICTURES = (*constants.FIGURES, *histograms_of_light.FIGURES, *matching.FIGURES)
ALL = (
    *OVER_PARTICLES,
    *OF_PICTURES,
    *clouds.FIGURES,
    *drives.FIGURES,
    *traces.FIGURES,
    *costs.FIGURES,
    *success.FIGURES,
)
FIGURES = tuple(sorted(ALL, key=lambda entry: entry.number))
