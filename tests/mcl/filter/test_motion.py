from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.filter.motion import (
    FloorDrift,
    MauriceMotion,
    MauriceParameters,
    MotionOutliers,
    OdometryMotion,
    OdometryParameters,
    from_header,
    motion_model,
    turns_of,
    with_outliers,
)
from maurice_mcl.values.geometry import INCH_M, compose, wrap
from maurice_mcl.values.map import Arena, Region, make_grid
from maurice_mcl.values.randomness import normals, stream

N = 120_000
HERE = np.zeros(2)
GAIN = 1 / 1.3695


def _grid(floors=()):
    square = np.array([[0.0, -5.0], [5.0, -5.0], [5.0, 5.0], [0.0, 5.0]])
    regions = tuple(Region(name, square) for name in floors)
    arena = Arena((-5.0, -5.0, 5.0, 5.0), np.zeros((0, 4)), floors=regions)
    return make_grid(arena, np.array([[-4.0, -4.0], [4.0, 4.0]]))


GRID = _grid(["carpet"])


def _at(x, y, heading, n=N):
    return np.tile(np.array([x, y, heading], np.float32), (n, 1))


def _noise(purpose, n=N):
    return normals(stream(9, 1, purpose=purpose), n)


def _assert_moments(sample, mean, sd):
    """Four standard errors on mean and standard deviation."""
    sample = np.asarray(sample, np.float64)
    n = len(sample)
    assert abs(sample.mean() - mean) < 4 * sd / np.sqrt(n) + 1e-6
    assert abs(sample.std() - sd) < 4 * sd / np.sqrt(2 * n) + 1e-6


@pytest.mark.parametrize("turn", [1.0, -1.0, 0.05, 4.0])
def test_a_turn_has_maurices_gain_and_residual(turn):
    motion = MauriceMotion(MauriceParameters(), GRID)
    moved = motion.move(_at(1, 2, 0.5), HERE, np.array([0.0, 0.0, turn]), _noise(1))
    residual = wrap(moved[:, 2].astype(np.float64) - 0.5 - GAIN * turn)
    _assert_moments(np.rad2deg(residual), 0.2681, 4.916)
    assert np.all(moved[:, :2] == [1, 2])


@pytest.mark.parametrize("way_in", [20.0, -20.0], ids=["forward", "reverse"])
@pytest.mark.parametrize(("x", "bias", "sd"), [(-2.0, 0.01, 0.03), (2.0, -0.2, 0.08)], ids=["wood", "carpet"])
def test_a_straight_has_the_encoders_error_and_the_floors_drift(way_in, x, bias, sd):
    drift = {"": FloorDrift(0.01, 0.03), "carpet": FloorDrift(-0.2, 0.08)}
    motion = MauriceMotion(MauriceParameters(drift=drift), GRID)
    movement = np.array([way_in * INCH_M, 0.0, 0.0])
    moved = motion.move(_at(x, 1, 0), HERE, movement, _noise(2)).astype(np.float64)
    driven_in = np.sign(way_in) * (moved[:, 0] - x) / INCH_M
    _assert_moments(driven_in, abs(way_in) - 0.6978, 0.6356)
    way_m = way_in * INCH_M  # backward it drifts to the other side
    _assert_moments(moved[:, 2], bias * way_m, sd * abs(way_m))
    assert np.allclose(moved[:, 1], 1, atol=1e-6), "the drift is applied when the straight is over"


def test_floors_have_their_drift():
    motion = MauriceMotion(MauriceParameters(drift={"": FloorDrift(0.1, 0.0)}), GRID)
    for x in (-2.0, 2.0):
        moved = motion.move(_at(x, 0, 0, 10), HERE, np.array([1.0, 0, 0]), _noise(2, 10))
        assert moved[:, 2] == pytest.approx(0.1)
    origin = np.array([3.0, 0.0])
    drift = {"carpet": FloorDrift(0.5, 0.0), "": FloorDrift(0.0, 0.0)}
    motion = MauriceMotion(MauriceParameters(drift=drift), GRID)
    moved = motion.move(_at(-1.0, 0, 0, 5), origin, np.array([1.0, 0, 0]), _noise(2, 5))
    assert moved[:, 2] == pytest.approx(0.5), "x = -1 relative to 3 is 2, on the carpet"


def test_movements_of_several_kinds():
    motion = MauriceMotion(MauriceParameters(), GRID)
    poses = _at(1, 2, 0.5, 1000)
    assert np.array_equal(motion.move(poses, HERE, np.zeros(3), _noise(3, 1000)), poses)
    small = motion.move(poses, HERE, np.array([0.0005, 0.0, 0.004]), _noise(3, 1000))
    assert np.ptp(small, axis=0) == pytest.approx(0, abs=1e-7)
    still = MauriceParameters(turn_bias_rad=0, turn_sd_rad=0, straight_bias_m=0, straight_sd_m=0, drift={})
    moved = MauriceMotion(still, GRID).move(_at(0, 0, 0, 3), HERE, np.array([1.0, 0, 1.3695]), _noise(4, 3))
    assert moved == pytest.approx(np.tile([np.cos(1), np.sin(1), 1], (3, 1)), abs=1e-6)
    still = MauriceParameters(straight_bias_m=0, straight_sd_m=0, drift={})
    moved = MauriceMotion(still, GRID).move(
        _at(0, 0, np.pi / 2, 3), HERE, np.array([0, 1.0, 0]), _noise(4, 3)
    )
    assert moved == pytest.approx(np.tile([-1, 0, np.pi / 2], (3, 1)), abs=1e-6)


@pytest.mark.parametrize("model", [MauriceMotion(MauriceParameters(), GRID), OdometryMotion()])
def test_each_model_keeps_its_inputs_and_the_range_of_headings(model):
    poses, noise = _at(0.1, 0.2, 2.9, 5000), _noise(5, 5000)
    kept = poses.copy(), noise.copy()
    moved = model.move(poses, HERE, np.array([0.3, 0.1, 0.4]), noise)
    assert np.array_equal(poses, kept[0])
    assert np.array_equal(noise, kept[1])
    assert (moved.dtype, moved.shape) == (np.float32, poses.shape)
    assert np.all((moved[:, 2] >= np.float32(-np.pi)) & (moved[:, 2] < np.float32(np.pi)))
    assert (moved[:, 2] < 0).any()
    assert (moved[:, 2] > 0).any()


def test_dividing_by_the_slope_fits_calibration_pairs_and_multiplying_does_not():
    rng = np.random.default_rng(12)
    actual = np.deg2rad(rng.uniform(-300, 300, 41))
    measured = 1.3695 * (actual - np.deg2rad(rng.normal(0.2681, 4.916, 41)))
    sd = {gain: np.std(actual - gain * measured) for gain in (1 / 1.3695, 1.3695, 1.0)}
    assert np.rad2deg(sd[1 / 1.3695]) == pytest.approx(4.916, rel=4 / np.sqrt(2 * 41))
    assert sd[1.0] > 5 * sd[1 / 1.3695]
    assert sd[1.3695] > 10 * sd[1 / 1.3695]
    motion = MauriceMotion(MauriceParameters(turn_sd_rad=0, turn_bias_rad=0), GRID)
    predicted = [
        motion.move(_at(0, 0, 0, 1), HERE, np.array([0, 0, m]), _noise(1, 1))[0, 2] for m in measured
    ]
    assert np.std(wrap(actual - np.array(predicted, np.float64))) == pytest.approx(sd[1 / 1.3695], rel=1e-3)


ALPHAS = OdometryParameters(0.02, 0.03, 0.04, 0.005)


@pytest.mark.parametrize(
    ("movement", "a", "b", "way"),
    [
        ((0.5, 0.0, 0.3), 0.0, 0.3, 0.5),
        ((0.3, 0.4, 0.2), np.arctan2(4, 3), np.arctan2(4, 3) - 0.2, 0.5),
        ((-0.5, 0.0, 0.1), 0.0, 0.1, 0.5),
        ((0.0, 0.0, 0.8), 0.0, 0.8, 0.0),
        ((-0.004, 0.003, 0.8), 0.0, 0.8, 0.005),
    ],
    ids=["ahead", "aside", "reverse", "turn", "turn with a jitter of 5 mm"],
)
def test_odometry_moments(movement, a, b, way):
    motion = OdometryMotion(ALPHAS)
    moved = motion.move(_at(0, 0, 0), HERE, np.array(movement), _noise(6)).astype(np.float64)
    variance = 0.02 * (a**2 + b**2) + 2 * 0.03 * way**2
    _assert_moments(moved[:, 2], movement[2], np.sqrt(variance))
    toward = np.arctan2(movement[1], movement[0])
    first_sd = np.sqrt(0.02 * a**2 + 0.03 * way**2)
    way_sd = np.sqrt(0.04 * way**2 + 0.005 * (a**2 + b**2))
    along = moved[:, 0] * np.cos(toward) + moved[:, 1] * np.sin(toward)
    across = moved[:, 1] * np.cos(toward) - moved[:, 0] * np.sin(toward)
    # moments of r cos(e), r sin(e) for independent normal r and e
    square, twice = way**2 + way_sd**2, np.exp(-2 * first_sd**2)
    mean = way * np.exp(-(first_sd**2) / 2)
    _assert_near(along, mean, square * (1 + twice) / 2 - mean**2)
    _assert_near(across, 0, square * (1 - twice) / 2)


@given(
    st.sampled_from([0.01, 0.3]),
    st.sampled_from([0.0, np.pi / 2, np.pi, -np.pi / 2]) | st.floats(-np.pi, np.pi),
    st.sampled_from([0.0, 2.5, np.pi, -np.pi]) | st.floats(-np.pi, np.pi),
)
def test_the_noise_of_the_heading_is_continuous_in_the_movement(way, toward, turn):
    """Also where a direction or a turn goes from 180 degrees to -180, and where forward becomes backward."""
    sds = []
    for off in np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * 1e-6:
        forward, left = (way + 1e-6) * np.cos(toward + off[0]), (way + 1e-6) * np.sin(toward + off[0])
        turned = (turn + off[1] + np.pi) % (2 * np.pi) - np.pi
        sds.append(np.hypot(*turns_of(np.array([forward, left, turned]), 0.01)))
    assert np.ptp(sds) < 1e-4


@given(st.floats(0.01, 1), st.floats(-1, 1), st.floats(-np.pi, np.pi))
def test_backward_is_as_noisy_as_forward(forward, left, turn):
    ahead, back = (turns_of(np.array([sign * forward, sign * left, turn]), 0.01) for sign in (1, -1))
    assert np.hypot(*ahead) == pytest.approx(np.hypot(*back), abs=1e-9)
    assert turns_of(np.array([-forward, 0.0, 0.3]), 0.01) == pytest.approx((0.0, 0.3))


def _assert_near(sample, mean, variance):
    """Four standard errors on the mean; one in fifty on the sd, as the sample is no normal one."""
    assert abs(sample.mean() - mean) < 4 * np.sqrt(variance / len(sample)) + 1e-6
    assert sample.std() == pytest.approx(np.sqrt(variance), rel=0.02, abs=1e-6)


def test_odometry_without_noise_is_what_was_measured():
    exact = OdometryMotion(OdometryParameters(0, 0, 0, 0))
    for movement in [
        (0.4, 0.1, 0.6),
        (-0.4, 0.2, -1.0),
        (0.0, -0.3, 0.0),
        (0.002, 0.001, 0.5),
        (0.0, 0.0, 2.0),
    ]:
        moved = exact.move(_at(1, 2, 0.7, 2), HERE, np.array(movement), _noise(7, 2))
        straight = compose(np.array([1, 2, 0.7]), np.array([*movement[:2], 0.0]))
        assert moved[0] == pytest.approx([*straight[:2], wrap(np.array([0.7 + movement[2]]))[0]], abs=1e-6)


@pytest.mark.parametrize("values", [None, {}, {"model": "odometry"}])
def test_a_robot_without_parameters_has_gain_one(values):
    model = motion_model(values, GRID)
    assert isinstance(model, OdometryMotion)
    moved = model.move(_at(0, 0, 0), HERE, np.array([0, 0, 1.0]), _noise(8))
    _assert_moments(moved[:, 2], 1.0, np.sqrt(model.parameters.turn_from_turn))


def test_a_drift_a_straight_does_not_depend_on_its_length():
    per_straight = {"model": "maurice", "drift": {"": {"bias_rad": 0.1, "sd_rad": 0.02}}}
    model = motion_model(per_straight, GRID)
    for forward_m in (0.1, 2.0):
        moved = model.move(_at(1, 1, 0), HERE, np.array([forward_m, 0, 0]), _noise(9))
        _assert_moments(moved[:, 2], 0.1, 0.02)
    backward = model.move(_at(1, 1, 0), HERE, np.array([-0.5, 0, 0]), _noise(9))
    _assert_moments(backward[:, 2], -0.1, 0.02)
    assert (model.move(_at(1, 1, 0), HERE, np.zeros(3), _noise(9))[:, 2] == 0).all(), "no straight, no drift"


def test_header_parameters_are_read():
    values = {"model": "maurice", "turn_gain": 0.9, "drift": {"wood": {"bias_rad_per_m": -0.1}}}
    model = motion_model(values, GRID)
    assert isinstance(model, MauriceMotion)
    assert model.parameters.turn_gain == 0.9
    assert model.parameters.drift == {"wood": FloorDrift(-0.1, 0.0)}
    assert model.parameters.turn_sd_rad == MauriceParameters().turn_sd_rad
    odometry = motion_model({"model": "odometry", "way_from_way": 0.5}, GRID)
    assert isinstance(odometry, OdometryMotion)
    assert odometry.parameters == OdometryParameters(way_from_way=0.5)
    assert from_header(MauriceParameters, {"straight_bias_m": -0.02}).straight_bias_m == -0.02


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"turn_gian": 1.0}, r"robot\.motion\.turn_gian is not known"),
        ({"turn_gain": "fast"}, r"robot\.motion\.turn_gain must be a finite number, found 'fast'"),
        ({"turn_gain": True}, r"robot\.motion\.turn_gain must be a finite number"),
        ({"turn_gain": None}, r"robot\.motion\.turn_gain must be a finite number"),
        ({"turn_bias_rad": float("nan")}, r"robot\.motion\.turn_bias_rad must be a finite number"),
        ({"turn_gain": 1e300}, r"robot\.motion\.turn_gain must be a number up to 1e6 in size, found 1e\+300"),
        (
            {"turn_gain": 10**400},
            r"robot\.motion\.turn_gain must be a number up to 1e6 in size, found 10{59}$",
        ),
        ({"turn_bias_rad": float("-inf")}, r"robot\.motion\.turn_bias_rad must be a number up to 1e6"),
        ({"drift": {"": {"bias_rad_per_m": -2e6}}}, r"drift\.\.bias_rad_per_m must be a number up to 1e6"),
        ({"model": "odometry", "way_from_m": 1e7}, r"robot\.motion\.way_from_m must be a number up to 1e6"),
        ({"turn_sd_rad": -0.1}, r"robot\.motion\.turn_sd_rad must not be negative"),
        ({"turn_gain": -1}, r"robot\.motion\.turn_gain must not be negative"),
        ({"drift": 3}, r"robot\.motion\.drift must name floors"),
        ({"drift": {"wood": 3}}, r"robot\.motion\.drift\.wood must hold"),
        ({"drift": {"wood": {"bias": 3}}}, r"robot\.motion\.drift\.wood must hold"),
        ({"drift": {"wood": {"sd_rad_per_m": -1}}}, r"drift\.wood\.sd_rad_per_m must not be negative"),
        ({"drift": {"a.b": {"bias_rad_per_m": "x"}}}, r"drift\.a\.b\.bias_rad_per_m must be a finite number"),
        ({"model": "tank"}, r"robot\.motion\.model is 'tank'"),
        ({"model": "odometry", "turn_gain": 1.0}, r"robot\.motion\.turn_gain is not known"),
    ],
)
def test_bad_header_parameters_are_named(values, named):
    with pytest.raises(ValueError, match=named):
        motion_model(values, GRID)


MANY = 200_000
NOISE = normals(stream(9, 1), MANY)


@pytest.mark.parametrize(("share", "widen"), [(0.05, 4.0), (0.3, 2.0)])
def test_share_and_variance(share, widen):
    found = with_outliers(NOISE, MotionOutliers(share, widen), stream(9, 2))
    wide = (found != NOISE).any(axis=1)
    assert abs(wide.mean() - share) < 4 * np.sqrt(share * (1 - share) / MANY)
    assert found[wide] == pytest.approx(widen * NOISE[wide])
    variance = 1 + share * (widen**2 - 1)
    # of x squared: 3 (1 + share (widen^4 - 1)) less the variance squared
    error = np.sqrt((3 * (1 + share * (widen**4 - 1)) - variance**2) / MANY)
    assert np.all(np.abs(np.square(found).mean(axis=0) - variance) < 4 * error)
    assert np.all(np.abs(found.mean(axis=0)) < 4 * np.sqrt(variance / MANY))


def test_outliers_are_of_whole_movements_and_many():
    found = with_outliers(NOISE, MotionOutliers(0.1, 4.0), stream(9, 3))
    wide = (found != NOISE).any(axis=1)
    assert (found[wide] != NOISE[wide]).all()
    found = with_outliers(NOISE, MotionOutliers(0.05, 4.0), stream(9, 4))
    beyond = (np.abs(found[:, 2]) > 3).mean()
    expected = 0.95 * 0.0026998 + 0.05 * 0.4532547
    assert abs(beyond - expected) < 4 * np.sqrt(expected / MANY)


def test_outliers_keep_the_noise_they_are_given():
    rng = stream(9, 5)
    assert with_outliers(NOISE, MotionOutliers(), rng) is NOISE
    assert rng.random() == stream(9, 5).random()
    kept = NOISE.copy()
    many = with_outliers(NOISE, MotionOutliers(0.2), stream(9, 6))
    few = with_outliers(NOISE[:100], MotionOutliers(0.2), stream(9, 6))
    assert np.array_equal(NOISE, kept)
    assert np.array_equal(many[:100], few)
    assert many.dtype == np.float32
