"""The simulated robot's constants come back from its own trials, as often as the intervals say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.thesis.calibration_drive import TrialPlan, calibration_drive
from maurice_datasets.robot.motion import Chassis
from maurice_mcl.fitting.motion import Calibration, calibrate

CHASSIS = Chassis()
SEEDS = 60
CONSTANTS = ("turn_gain", "turn_bias", "turn_sd", "straight_bias", "straight_sd", "wood", "carpet")


def held(fit: Calibration) -> dict[str, bool]:
    """Say which of the chassis's constants lie in their intervals."""
    residual, error = fit.turns.residual, fit.straights.error
    found = {
        "turn_gain": fit.turns.gain.holds(1 / CHASSIS.turn_over_read),
        "turn_bias": residual.mean.holds(CHASSIS.turn_bias_rad),
        "turn_sd": residual.sd.holds(CHASSIS.turn_sd_rad),
        "straight_bias": error.mean.holds(CHASSIS.straight_bias_m),
        "straight_sd": error.sd.holds(CHASSIS.straight_sd_m),
    }
    for drift in fit.drifts:
        true = CHASSIS.drifts[drift.floor]
        found[drift.floor] = drift.rate.mean.holds(true.bias_rad_per_m)
        found[f"{drift.floor} sd"] = drift.rate.sd.holds(true.sd_rad_per_m)
    return found


def coverage(fits: list[Calibration]) -> dict[str, float]:
    """Return by constant how often its interval held the true one."""
    answers = [held(fit) for fit in fits]
    return {name: float(np.mean([answer[name] for answer in answers])) for name in answers[0]}


NOMINAL = pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / SEEDS))


@pytest.mark.slow
def test_the_thesis_s_trials_give_the_constants_back():
    fits = [calibrate(calibration_drive(seed)) for seed in range(SEEDS)]
    assert set(held(fits[0])) >= set(CONSTANTS)
    assert all(share == NOMINAL for share in coverage(fits).values())


def test_trials_follow_their_seed_and_are_not_wrapped():
    plan = TrialPlan(5, 4)
    one, again, other = (calibration_drive(seed, plan) for seed in (1, 1, 2))
    assert np.array_equal(one.turns.actual_rad, again.turns.actual_rad)
    assert np.array_equal(one.straights.drift_rad, again.straights.drift_rad)
    assert not set(one.straights.actual_m) & set(other.straights.actual_m)
    assert one.straights.floors == ("wood", "wood", "carpet", "carpet")
    trials = calibration_drive(0, TrialPlan(400, 0))
    residual = trials.turns.actual_rad - trials.turns.measured_rad / CHASSIS.turn_over_read
    assert np.abs(residual).max() < 6 * CHASSIS.turn_sd_rad
    assert np.abs(trials.turns.actual_rad).max() > np.pi
    assert len(trials.straights.measured_m) == 0
