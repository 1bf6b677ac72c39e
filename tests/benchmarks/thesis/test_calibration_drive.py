"""The simulated robot's constants come back from its own trials, as often as the intervals say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.thesis.calibration_drive import TrialPlan, calibration_drive, floor_everywhere
from maurice_datasets.robot.motion import Chassis, Luck, drive_by, turn_by
from maurice_mcl.fitting.motion import Calibration, MotionSegment, calibrate, trials_of

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


def legs(seed: int, updates: int = 40) -> Iterator[MotionSegment]:
    """Drive as a session does: a turn, a straight, and only then the truth."""
    rng = np.random.default_rng([seed, 7])
    arenas = [floor_everywhere(name, 1e4) for name in CHASSIS.drifts]
    pose = np.zeros(3)
    for number in range(updates):
        z = rng.standard_normal(3)
        luck = Luck(float(z[0]), float(z[1]), float(z[2]), (0.0, 0.0))
        turn = turn_by(pose, float(rng.uniform(-np.pi, np.pi)), luck, CHASSIS)
        floor = arenas[2 * number // updates]
        straight = drive_by(turn.path[-1], float(rng.uniform(0.1, 0.4)), luck, floor, CHASSIS)
        yield MotionSegment(pose, (turn.measured, straight.measured), straight.path[-1])
        pose = straight.path[-1]


def test_a_session_s_legs_give_the_constants_back():
    def fit(seed: int) -> Calibration:
        floors = iter([name for name in CHASSIS.drifts for _ in range(20)])
        return calibrate(trials_of(legs(seed), lambda a, b: next(floors)))

    shares = coverage([fit(seed) for seed in range(SEEDS)])
    assert shares
    assert all(share == NOMINAL for share in shares.values()), shares


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
