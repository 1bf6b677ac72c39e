"""The fits give the known constants back: unbiased, and within their intervals as often as these say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from maurice_mcl.filter.motion import MauriceParameters, from_header
from maurice_mcl.fitting.motion import (
    Calibration,
    Straights,
    Trials,
    Turns,
    calibrate,
    drift_rates,
    fit_drifts,
    fit_straights,
    fit_turns,
)
from maurice_mcl.fitting.statistics import Fitted, normality, r_squared, slope, slope_resampled, spread_of
from maurice_mcl.values.arrays import F64

GAIN, BIAS, SD = 1 / 1.3695, np.radians(0.2681), np.radians(4.916)
SHORT, SHORT_SD, DRIFT, DRIFT_SD = -0.0177, 0.0161, 0.15, 0.057
SEEDS = 400
FOUR_SE = 4 * np.sqrt(0.95 * 0.05 / SEEDS)


def turns_of(seed: int, count: int = 41, sd: float = SD) -> Turns:
    rng = np.random.default_rng([seed, 1])
    measured = rng.uniform(-1, 1, count) * np.pi / GAIN
    return Turns(measured, GAIN * measured + BIAS + sd * rng.standard_normal(count))


def straights_of(seed: int, count: int = 20) -> Straights:
    rng = np.random.default_rng([seed, 2])
    measured = rng.uniform(0.2, 1.5, count)
    actual = measured + SHORT + SHORT_SD * rng.standard_normal(count)
    drift = (DRIFT + DRIFT_SD * rng.standard_normal(count)) * actual
    return Straights(measured, actual, drift, ("carpet",) * count)


@pytest.fixture(scope="module")
def fits() -> list[Calibration]:
    return [calibrate(Trials(turns_of(s), straights_of(s))) for s in range(SEEDS)]


@pytest.mark.parametrize(
    ("name", "true"),
    [
        ("gain", GAIN),
        ("turn bias", BIAS),
        ("turn sd", SD),
        ("straight bias", SHORT),
        ("straight sd", SHORT_SD),
        ("drift", DRIFT),
        ("drift sd", DRIFT_SD),
    ],
)
def test_every_constant_is_unbiased_and_lies_in_19_of_20_intervals(fits, name, true):
    found = [constants(fit)[name] for fit in fits]
    values = np.array([f.value for f in found])
    slack = 0.01 * true if "sd" in name else 0.0  # the root of an unbiased variance is a little small
    assert values.mean() == pytest.approx(true, abs=4 * values.std() / np.sqrt(SEEDS) + abs(slack))
    assert np.mean([f.holds(true) for f in found]) == pytest.approx(0.95, abs=FOUR_SE)


def constants(fit: Calibration) -> dict[str, Fitted]:
    (drift,) = fit.drifts
    return {
        "gain": fit.turns.gain,
        "turn bias": fit.turns.residual.mean,
        "turn sd": fit.turns.residual.sd,
        "straight bias": fit.straights.error.mean,
        "straight sd": fit.straights.error.sd,
        "drift": drift.rate.mean,
        "drift sd": drift.rate.sd,
    }


def test_figure_5_regressed_the_other_way_gives_a_gain_that_is_too_large():
    """Noise in x pulls a slope toward zero, so that 1 / C exceeds the gain; clearest with much noise."""
    fits = [fit_turns(turns_of(seed, sd=8 * SD)) for seed in range(60)]
    gains = np.array([fit.gain.value for fit in fits])
    others = np.array([1 / fit.figure_5_slope.value for fit in fits])
    assert gains.mean() == pytest.approx(GAIN, abs=4 * gains.std() / np.sqrt(60))
    assert others.mean() > GAIN + 4 * others.std() / np.sqrt(60)
    turns = turns_of(3)
    fit = fit_turns(turns)
    cosine = turns.measured_rad @ turns.actual_rad
    cosine /= np.linalg.norm(turns.measured_rad) * np.linalg.norm(turns.actual_rad)
    assert fit.gain.value * fit.figure_5_slope.value == pytest.approx(cosine**2)
    fit = fit_turns(turns_of(1))
    assert fit.sd_if_multiplied_rad > 10 * fit.residual.sd.value


def test_exact_trials_come_back():
    measured = np.array([1.0, -2.0, 0.5])
    fit = fit_turns(Turns(measured, 0.75 * measured))
    assert fit.gain == Fitted(0.75, 0.75, 0.75)
    assert fit.figure_5_slope.value == pytest.approx(1 / 0.75)
    assert fit.r_squared == 1
    assert fit.residual.normal_p is None
    way = fit_straights(Straights(np.ones(3), np.full(3, 0.5), np.zeros(3), ("",) * 3))
    assert (way.error.mean.value, way.error.sd.value, way.scale.value) == (-0.5, 0.0, 0.5)


def test_one_sided_turns_are_told():
    both = turns_of(0)
    assert not fit_turns(both).one_sided
    assert fit_turns(Turns(np.abs(both.measured_rad), np.abs(both.actual_rad))).one_sided
    even = turns_of(0)
    assert not fit_turns(even).uneven
    left = even.measured_rad > 0
    fit = fit_turns(Turns(even.measured_rad, np.where(left, 1.3, 1.0) * even.actual_rad))
    assert fit.uneven
    assert fit.left_gain.holds(1.3 * GAIN)
    assert fit_turns(Turns(np.array([1.0, 2, -1]), np.array([1.0, 2, -2]))).right_gain is None


def test_drift_goes_by_floor_leaves_out_what_is_unknown_and_needs_two_straights():
    floors = ("wood", "carpet", "wood", None, "tiles", "wood")
    drift = np.array([0.1, 0.4, 0.3, 9.0, 0.2, np.nan])
    fits = fit_drifts(Straights(np.full(6, 2.0), np.array([1.0, 2, 1, 1, 1, 1]), drift, floors))
    assert [(f.floor, f.rate.count) for f in fits] == [("wood", 2)]
    assert fits[0].rate.mean.value == pytest.approx(0.2)


def test_the_header_is_one_that_the_motion_model_takes():
    header = calibrate(Trials(turns_of(0), straights_of(0))).motion_header()
    model = header.pop("model")
    read = from_header(MauriceParameters, header)
    assert model == "maurice"
    assert read.turn_gain == header["turn_gain"]
    assert read.drift["carpet"].bias_rad_per_m == pytest.approx(DRIFT, abs=0.06)


@pytest.mark.parametrize(
    ("turns", "straights", "said"),
    [
        (41, 0, "41 turns and no straights"),
        (0, 20, "no turns and 20 straights"),
        (1, 0, "1 turn and no straights"),
    ],
)
def test_too_few_trials_are_refused_with_their_counts(turns, straights, said):
    with pytest.raises(ValueError, match=said):
        calibrate(Trials(turns_of(0, turns), straights_of(0, straights)))


def test_trials_that_tell_nothing_are_refused():
    turns = turns_of(0)
    with pytest.raises(ValueError, match="the other way"):
        fit_turns(Turns(-turns.measured_rad, turns.actual_rad))
    with pytest.raises(ValueError, match="only zeros"):
        fit_turns(Turns(np.zeros(4), np.ones(4)))


def test_spread_follows_the_textbook():
    values = np.random.default_rng(0).normal(3, 2, 30)
    spread = spread_of(values)
    low, high = stats.t.interval(0.95, 29, values.mean(), values.std(ddof=1) / np.sqrt(30))
    assert (spread.mean.low, spread.mean.high) == pytest.approx((low, high))
    chi = stats.chi2.ppf([0.975, 0.025], 29)
    sds = values.std(ddof=1) * np.sqrt(29 / chi)
    assert (spread.sd.low, spread.sd.high) == pytest.approx(tuple(sds))
    with pytest.raises(ValueError, match="expected more than 1"):
        spread_of(np.ones(1))


def test_an_outlier_widens_the_interval_and_is_not_normal():
    values: F64 = np.append(np.random.default_rng(0).normal(0, 1, 60), 30.0)
    spread = spread_of(values)
    assert spread.normal_p is not None
    assert spread.normal_p < 0.01
    assert spread.beyond_3_sd == 1
    assert spread.sd.high - spread.sd.low > spread.sd.value / 2  # chi-square would say 0.43 of it
    assert spread == spread_of(values)  # the bootstrap repeats itself
    rng = np.random.default_rng(5)
    normal = [normality(rng.standard_normal(40)) for _ in range(200)]
    skewed = [normality(rng.exponential(size=40)) for _ in range(50)]
    assert np.mean([p is not None and p < 0.05 for p in normal]) == pytest.approx(0.05, abs=0.06)
    assert np.mean([p is not None and p < 0.05 for p in skewed]) > 0.9
    assert normality(np.ones(5)) is None
    assert normality(np.array([1.0, 2.0])) is None


def test_straights_backward_drift_to_the_other_side():
    straights = Straights(np.ones(2), np.array([0.4, -0.4]), np.array([0.1, 0.1]), ("", ""))
    assert drift_rates(straights, "") == pytest.approx([0.25, -0.25])


def test_slopes_and_r_squared():
    fit = slope_resampled(np.array([1.0, 2, 3, 4]), np.array([2.0, 4, 6, 8.4]))
    assert fit.low <= slope(np.array([1.0, 2, 3, 4]), np.array([2.0, 4, 6, 8.4])) <= fit.high
    assert np.isnan(r_squared(np.ones(3), np.zeros(3)))
    assert r_squared(np.array([0.0, 2.0]), np.array([-1.0, 1.0])) == 0
