"""Downward sensors on a printed floor: their likelihood, their levels, and a robot that finds itself."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from maurice_mcl.arrays import F64
from maurice_mcl.floor import FloorImage
from maurice_mcl.pose_sensor import PoseSpread
from maurice_mcl.sensor.reflectance import Probe, Reflectance, fit_levels
from maurice_mcl.session import Frame

ORIGIN = np.array([0.2, 0.1])


def a_print(seed: int = 3, size: int = 60) -> FloorImage:
    noise = np.random.default_rng(seed).standard_normal((size, size))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    return FloorImage((smooth > 0).astype(np.float32), 0.01, np.zeros(3))


def a_sensor(floor: FloorImage | None = None) -> Reflectance:
    probes = (Probe("left", 0.05, 0.02, 100, 900, 0.05), Probe("right", 0.05, -0.02, 150, 800, 0.05))
    return Reflectance(floor or a_print(), probes)


def a_frame(**readings: float) -> Frame:
    return Frame(1, 0.0, np.zeros((0, 3)), np.zeros((1, 1, 3), np.uint8), "", readings)


def nats(sensor: Reflectance, pose: F64, spread: PoseSpread | None = None, **readings: float) -> float:
    reading = sensor.read(a_frame(**readings))
    assert reading is not None
    local = np.array([pose - np.append(ORIGIN, 0)], np.float32)
    return float(sensor.log_likelihood(reading, local, ORIGIN, spread or PoseSpread())[0])


def read_at(sensor: Reflectance, pose: F64) -> dict[str, float]:
    light = sensor.floor.at(sensor.spots(pose))
    pairs = zip(sensor.probes, light, strict=True)
    return {one.name: one.black + (one.white - one.black) * float(share) for one, share in pairs}


def test_a_floor_is_read_between_its_pixels_where_it_lies() -> None:
    turned = FloorImage(np.array([[0, 1]], np.float32), 0.1, np.array([1.0, 2.0, np.pi / 2]))
    points = np.array([[0.95, 2.05], [0.95, 2.1], [0.95, 2.15], [0.95, 2.25], [1.05, 2.05]])
    assert turned.at(points) == pytest.approx([0, 0.5, 1, np.nan, np.nan], abs=1e-5, nan_ok=True)
    assert turned.bounds == pytest.approx((0.9, 2.0, 1.0, 2.2))
    assert a_print().blurred(1.0).values.std() < 0.2 * a_print().values.std()


def test_the_true_pose_is_likelier_than_others_never_above_zero_and_bounded_below() -> None:
    sensor, rng = a_sensor(), np.random.default_rng(0)
    for _ in range(20):
        pose = np.array([*rng.uniform(0.15, 0.45, 2), rng.uniform(-3, 3)])
        there = nats(sensor, pose, **read_at(sensor, pose))
        away = [np.append(rng.uniform(-0.3, 0.3, 2), 1.0) for _ in range(9)]
        others = [nats(sensor, pose + one, **read_at(sensor, pose)) for one in away]
        assert -10 < min(others) <= np.mean(others) < there <= 0


def test_a_missing_reading_says_nothing_and_the_edge_of_the_print_little() -> None:
    sensor, pose = a_sensor(), np.array([0.3, 0.3, 0.5])
    assert sensor.read(a_frame(other=1.0)) is None
    both, left = read_at(sensor, pose), {"left": read_at(sensor, pose)["left"]}
    assert nats(sensor, pose, **left) >= nats(sensor, pose, **both)
    off = nats(sensor, np.array([5.0, 5.0, 0.0]), **both)
    assert off == pytest.approx(nats(sensor, np.array([9.0, 2.0, 1.0]), **both), abs=0.05)
    assert off < nats(sensor, pose, **both)


def test_a_spread_makes_poses_near_each_other_alike() -> None:
    sensor, rng = a_sensor(), np.random.default_rng(1)
    pose = np.array([0.3, 0.3, 0.5])
    read = read_at(sensor, pose)
    near = [pose + np.append(rng.normal(0, 0.03, 2), 0.0) for _ in range(30)]
    exact = np.std([nats(sensor, one, **read) for one in near])
    assert np.std([nats(sensor, one, PoseSpread(0.05, 0.3), **read) for one in near]) < 0.5 * exact


def test_levels_are_found_among_noise_and_refused_where_there_is_one() -> None:
    rng = np.random.default_rng(2)
    values = np.where(rng.random(900) < 0.3, rng.normal(800, 40, 900), rng.normal(120, 30, 900))
    values[:20] = rng.uniform(0, 1023, 20)
    levels = fit_levels(values)
    assert (levels.black, levels.white) == (pytest.approx(120, abs=6), pytest.approx(800, abs=8))
    assert levels.sd == pytest.approx(35 / 680, rel=0.4)
    assert levels.white_share == pytest.approx(0.3, abs=0.05)
    with pytest.raises(ValueError, match="show no two levels"):
        fit_levels(rng.normal(500, 20, 900))


def test_it_comes_back_from_its_arrays_and_says_what_it_read() -> None:
    sensor = replace(a_sensor(), said="fitted")
    again = Reflectance.from_arrays(sensor.to_arrays())
    assert (again.probes, again.said, again.sharpness) == (sensor.probes, "fitted", sensor.sharpness)
    pose = np.array([0.3, 0.3, 0.5])
    assert nats(again, pose, left=500, right=100) == nats(sensor, pose, left=500, right=100)
    reading = sensor.read(a_frame(left=900))
    assert reading is not None
    shown = sensor.shown(reading, {"estimate": pose})
    assert shown.words.startswith("left reads 1.00, the floor at the estimate is ")
    assert shown.words.endswith("right reads nothing")
    assert shown.marks[0].strips.shape == (2, 1, 2)
    with pytest.raises(ValueError, match="found no probes"):
        Reflectance.from_arrays({key: value for key, value in sensor.to_arrays().items() if key != "probes"})


@pytest.mark.parametrize("off", [-0.2, 0.2])
def test_levels_that_are_a_fifth_off_still_tell_the_true_pose(off: float) -> None:
    sensor, rng = a_sensor(), np.random.default_rng(2)
    wrong = replace(
        sensor,
        probes=tuple(replace(one, black=one.black + off * (one.white - one.black)) for one in sensor.probes),
    )
    true, elsewhere = [], []
    for _ in range(40):
        pose, other = (np.array([*rng.uniform(0.15, 0.45, 2), rng.uniform(-3, 3)]) for _ in range(2))
        true.append(nats(wrong, pose, **read_at(sensor, pose)))
        elsewhere.append(nats(wrong, other, **read_at(sensor, pose)))
    assert np.mean(true) > 0.5 * np.mean(elsewhere)
