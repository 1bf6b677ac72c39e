"""Constants of motion models fitted to drives: simulated ones are found again, what a drive hides is said."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.filter.motion import (
    FloorDrift,
    MauriceParameters,
    MotionModel,
    OdometryMotion,
    OdometryParameters,
    from_header,
)
from maurice_mcl.fitting.odometry import LinearMaurice, LinearOdometry, MotionSegment
from maurice_mcl.fitting.odometry_fit import MotionFit, fit_motion
from maurice_mcl.values.arrays import F32, F64
from maurice_mcl.values.geometry import compose

TRUE = OdometryParameters(0.03, 0.005, 0.001, 0.002)
SEEDS, DRIVEN = 8, 150


def driven(
    model: MotionModel,
    seed: int,
    *,
    turn_rad: float = 1.5,
    arcs: float = 0.0,
    each: int = 1,
    count: int = DRIVEN,
) -> list[MotionSegment]:
    """Drive with a model's own noise; turns up to an angle, or in proportion to the way."""
    rng, segments = np.random.default_rng(seed), []
    for _ in range(count):
        pose, motions = np.zeros((1, 3), np.float32), []
        for _ in range(each):
            way = rng.uniform(0.1, 0.6)
            motions.append(np.array([way, 0, arcs * way or turn_rad * rng.uniform(-1, 1)]))
            noise = rng.normal(size=(1, 3)).astype(np.float32)
            pose = model.move(pose, np.zeros(2), motions[-1], noise)
        segments.append(MotionSegment(np.zeros(3), tuple(motions), pose[0].astype(float)))
    return segments


def of(fit: MotionFit) -> dict[str, object]:
    return {one.name: one for one in fit.constants}


def test_alphas_are_found_again_within_their_intervals():
    within = []
    for seed in range(SEEDS):
        fit = fit_motion(driven(OdometryMotion(TRUE), seed), LinearOdometry())
        assert all(one.told for one in fit.constants)
        within += [one.fitted.holds(getattr(TRUE, one.name)) for one in fit.constants]
    assert np.mean(within) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(within))


def test_several_movements_between_two_truths_tell_the_same_constants():
    fit = fit_motion(driven(OdometryMotion(TRUE), 0, each=3, turn_rad=0.4, count=400), LinearOdometry())
    for one in fit.constants:
        if one.told:
            assert one.fitted.value == pytest.approx(getattr(TRUE, one.name), rel=0.6)
    assert {"turn_from_way", "way_from_way"} <= {one.name for one in fit.constants if one.told}


def test_a_straight_drive_does_not_tell_the_noise_of_turns_and_says_so():
    fit = fit_motion(driven(OdometryMotion(TRUE), 0, turn_rad=0.0), LinearOdometry())
    hidden = {one.name: one for one in fit.constants if not one.told}
    assert set(hidden) == {"turn_from_turn", "way_from_turn"}
    assert all(one.why == "no movement of the log shows it" for one in hidden.values())
    assert fit.motion_header()["turn_from_turn"] == OdometryParameters().turn_from_turn
    assert fit.motion_header()["way_from_way"] == pytest.approx(TRUE.way_from_way, rel=0.5)


def test_arcs_of_one_curvature_do_not_tell_two_causes_of_one_error_apart():
    fit = fit_motion(driven(OdometryMotion(TRUE), 0, arcs=2.0), LinearOdometry())
    whys = {one.name: one.why for one in fit.constants if not one.told}
    assert "way_from_turn" in whys["way_from_way"]
    assert "way_from_way" in whys["way_from_turn"]


MAURICE = LinearMaurice(("",), lambda start, end: "")


def turned(turns: F64, way: float, seed: int = 0) -> list[MotionSegment]:
    """Turn by angles (n,) with gain 1 and drive a way after each, with a little noise."""
    rng, segments = np.random.default_rng(seed), []
    for turn in turns:
        motions = np.array([[0.0, 0.0, turn], [way, 0.0, 0.0]])
        pose = compose(np.zeros(3), motions[0] + [0, 0, 0.01 * rng.normal()])
        pose = compose(pose, motions[1] + [0.005 * rng.normal() * (way > 0), 0, 0])
        segments.append(MotionSegment(np.zeros(3), tuple(motions), pose))
    return segments


@pytest.mark.parametrize("way", [0.0, 0.5])
@pytest.mark.parametrize("sd", [0.0, 1e-6, 1e-3])
def test_equal_turns_do_not_tell_gain_from_bias(way: float, sd: float) -> None:
    """However many, and however precise: they fit together, and what is told besides is right."""
    turns = 1.5 + sd * np.random.default_rng(1).normal(size=200)
    fit = fit_motion(turned(turns, way), MAURICE)
    whys = {one.name: one.why for one in fit.constants if not one.told}
    assert "turn_bias_rad" in whys["turn_gain"]
    assert "turn_gain" in whys["turn_bias_rad"]
    found = fit.motion_header()
    assert 1.5 * found["turn_gain"] + found["turn_bias_rad"] == pytest.approx(
        1.5, abs=4 * 0.01 / np.sqrt(200)
    )
    if way:
        (bias,) = (one for one in fit.constants if one.name == "straight_bias_m")
        assert bias.told
        assert abs(bias.fitted.value) < 4 * 0.005 / np.sqrt(200)


@pytest.mark.parametrize("turns", [(0.5, 1.5), (-1.5, 1.5)])
def test_different_turns_tell_gain_from_bias(turns: tuple[float, float]) -> None:
    within = []
    for seed in range(SEEDS):
        angles = np.random.default_rng(seed + 100).uniform(*turns, DRIVEN)
        fit = {one.name: one for one in fit_motion(turned(angles, 0.5, seed), MAURICE).constants}
        assert fit["turn_gain"].told
        within += [fit["turn_gain"].fitted.holds(1.0), fit["turn_bias_rad"].fitted.holds(0.0)]
    assert np.mean(within) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(within))


class EvenDrift:
    """The thesis's robot: a turn, then a straight along which the heading drifts evenly."""

    def __init__(self, true: MauriceParameters) -> None:
        self._true = true

    def move(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """Move as `MotionModel` says, in a hundred small steps."""
        p, (way, _, turn), (of_length, of_drift, of_turn) = self._true, motion.tolist(), noise[0].tolist()
        length = way + p.straight_bias_m + p.straight_sd_m * of_length
        x, y, heading = poses[0].tolist()
        heading += p.turn_gain * turn + p.turn_bias_rad + p.turn_sd_rad * of_turn
        drift = p.drift[""]
        drifted = (drift.bias_rad_per_m + drift.sd_rad_per_m * of_drift) * way
        headings = heading + drifted * np.arange(100) / 100
        x, y = x + length * np.cos(headings).mean(), y + length * np.sin(headings).mean()
        return np.array([[x, y, heading + drifted]], np.float32)


def test_constants_of_the_thesis_are_found_again():
    true = MauriceParameters(0.8, 0.02, 0.06, -0.01, 0.02, {"": FloorDrift(0.05, 0.03)})
    model = LinearMaurice(("",), lambda start, end: "")
    within = []
    for seed in range(4):
        fit = fit_motion(driven(EvenDrift(true), seed, count=200), model)
        found = fit.motion_header()
        assert found["model"] == "maurice"
        for one in fit.constants:
            drift = one.name.removeprefix("drift..")
            within.append(one.fitted.holds(getattr(true.drift[""] if drift != one.name else true, drift)))
        assert from_header(MauriceParameters, found).turn_gain == pytest.approx(0.8, abs=0.05)
    assert np.mean(within) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(within))


def test_slips_are_counted():
    segments = driven(OdometryMotion(TRUE), 0)
    far = [MotionSegment(s.before, s.motions, s.after + np.array([0, 0, 1.4])) for s in segments[:2]]
    assert fit_motion([*far, *segments[2:]], LinearOdometry()).far >= 2


def test_few_movements_are_refused():
    with pytest.raises(ValueError, match="found 3 movements between true poses, expected 10 or more"):
        fit_motion(driven(OdometryMotion(TRUE), 0, count=3), LinearOdometry())


def measured(
    seed: int, mast: tuple[float, float], jitter: tuple[float, float], *, thin: int = 1, count: int = 600
) -> list[MotionSegment]:
    """Drive and stand, with encoders that flicker, and truth of a place on the robot that jitters.

    `jitter` is of a true position (m) and heading (rad); of `thin` movements one has truth after it.
    """
    rng, model, standing = np.random.default_rng(seed), OdometryMotion(TRUE), 0
    poses, motions = [np.array([1.0, 2.0, 0.3])], []
    for _ in range(count):
        standing = standing - 1 if standing else 30 * (rng.random() < 0.02)
        if standing:
            motions.append(rng.normal(0, 1e-4, 3) * [1, 0, 1])
            poses.append(poses[-1])
            continue
        motions.append(np.array([rng.uniform(0, 0.25), 0, rng.choice([0, 1]) * rng.normal(0, 0.3)]))
        noise = rng.normal(size=(1, 3)).astype(np.float32)
        step = model.move(np.zeros((1, 3), np.float32), np.zeros(2), motions[-1], noise)[0]
        poses.append(compose(poses[-1], step.astype(float)))
    place = np.array([*mast, 0.0])
    seen = [compose(pose, place) + rng.normal(0, [jitter[0], jitter[0], jitter[1]]) for pose in poses]
    legs = zip(range(0, count, thin), range(thin, count + 1, thin), strict=False)
    return [MotionSegment(seen[a], tuple(motions[a:b]), seen[b]) for a, b in legs]


@pytest.mark.parametrize(("mast", "thin"), [((0.0, 0.0), 1), ((0.19, 0.0), 1), ((-0.3, 0.4), 5)])
def test_truth_of_a_mast_that_jitters_is_no_noise_of_the_odometry(mast: tuple[float, float], thin: int):
    """Neither a place ahead of the wheels nor a standing robot's jitter counts as noise of turns."""
    within, jitter = [], (0.003, np.radians(0.3))
    for seed in range(2):
        fit = fit_motion(measured(seed, mast, jitter, thin=thin), LinearOdometry())
        within += [one.fitted.holds(getattr(TRUE, one.name)) for one in fit.constants if one.told]
        within += [fit.ahead_m.holds(mast[0]), fit.left_m.holds(mast[1])]
        assert (fit.truth_sd_m, fit.truth_sd_rad) == pytest.approx(jitter, rel=0.3)
        assert all(one.value < 0.2 for one in fit.constants)
    assert np.mean(within) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(within))


def test_the_intervals_of_one_half_meet_those_of_the_other():
    meets = []
    for seed in range(4):
        legs = measured(seed, (0.19, 0.0), (0.003, np.radians(0.3)))
        halves = [of(fit_motion(some, LinearOdometry())) for some in (legs[:300], legs[300:])]
        for first, second in zip(*(half.values() for half in halves), strict=True):
            if first.told and second.told:
                meets.append(
                    first.fitted.low <= second.fitted.high and second.fitted.low <= first.fitted.high
                )
    assert len(meets) > 8
    assert np.mean(meets) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(meets))


def test_truth_of_another_drive_is_refused():
    legs = measured(0, (0.0, 0.0), (0.003, 0.005))
    others = [
        MotionSegment(one.before, other.motions, one.after)
        for one, other in zip(legs, legs[200:] + legs[:200], strict=True)
    ]
    with pytest.raises(ValueError, match="expected odometry and truth of one drive"):
        fit_motion(others, LinearOdometry())
