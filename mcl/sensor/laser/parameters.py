"""Settings of a laser: which model, and AMCL's and Beluga's constants with Nav2's defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ...values import SHARE, choice, number, truth, whole

AMCLS = ("likelihood_field", "likelihood_field_prob", "beam")
BELUGAS = tuple(f"beluga_{name}" for name in AMCLS)
MODELS = ("calibrated", *AMCLS, *BELUGAS)


@dataclass(frozen=True, slots=True)
class LaserParameters:
    """The model of a laser. "calibrated" is ours; the others are AMCL's, and Beluga's where they say so.

    Of the constants, "calibrated" heeds `max_beams` and the two ranges; it has its own in `models`.
    """

    model: Annotated[str, choice(*MODELS)] = "calibrated"
    max_beams: Annotated[int, whole(2, 100_000)] = 60  # of a scan, evenly chosen
    z_hit: Annotated[float, SHARE] = 0.5  # weight of beams that end at what the map has
    z_short: Annotated[float, SHARE] = 0.05  # that end before it; "beam" only
    z_max: Annotated[float, SHARE] = 0.05  # that hit nothing; "beam" only
    z_rand: Annotated[float, SHARE] = 0.5  # that end anywhere
    sigma_hit: Annotated[float, number(0.001, 100)] = 0.2  # meters
    lambda_short: Annotated[float, number(0.0001, 1000)] = 0.1  # per meter
    laser_likelihood_max_dist: Annotated[float, number(0.01, 1000)] = (
        2.0  # meters; farther counts as this far
    )
    model_unknown_space: Annotated[bool, truth] = False  # Beluga's fields only: any range is as likely there
    do_beamskip: Annotated[bool, truth] = False  # "likelihood_field_prob" only, as all that follow
    beam_skip_distance: Annotated[float, number(0, 1000)] = 0.5  # meters; a nearer beam agrees with the map
    beam_skip_threshold: Annotated[float, SHARE] = 0.3  # share of particles with which a beam must agree
    beam_skip_error_threshold: Annotated[float, SHARE] = 0.9  # share of beams that may be skipped
    laser_min_range: Annotated[float, number(-1, 1e9)] = -1.0  # meters; -1: the scan's own
    laser_max_range: Annotated[float, number(-1, 1e9)] = -1.0  # meters; -1: the scan's own
