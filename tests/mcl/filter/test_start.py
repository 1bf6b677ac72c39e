"""How far particles lie about the pose at which they begin."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.config.build import make_localizer
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.laser import OccupancyMap

HALL = map_library(OccupancyMap(np.zeros((200, 400), np.uint8), 0.1, np.zeros(2)), "hall")
POSE = np.array([12.0, 9.0, 3.0])


def _cloud(seed=0, **settings):
    localizer = make_localizer(HALL, settings={"particles": 20_000, **settings}, seed=seed)
    belief = localizer.initialize(POSE).belief
    return belief.poses.astype(np.float64) + np.append(belief.origin, 0.0), belief


def test_without_a_spread_all_particles_are_at_the_pose():
    poses, _ = _cloud()
    assert np.abs(poses - POSE).max() < 1e-6


@pytest.mark.parametrize(("sd_m", "sd_rad"), [(0.5, 0.26), (0.0, 0.1), (1.5, 0.0), (0.1, 2.0)])
def test_the_cloud_has_the_spread_that_was_asked_for(sd_m, sd_rad):
    poses, belief = _cloud(**{"start.sd_m": sd_m, "start.heading_sd_rad": sd_rad})
    off = poses - POSE
    tolerance = 4 / np.sqrt(2 * len(poses))
    assert off[:, :2].std(axis=0) == pytest.approx(sd_m, rel=tolerance, abs=1e-5)
    assert np.abs(off[:, :2].mean(axis=0)).max() <= 4 * sd_m / np.sqrt(len(poses)) + 1e-5
    turned = wrap(off[:, 2])
    if sd_rad < 1:
        assert turned.std() == pytest.approx(sd_rad, rel=tolerance, abs=1e-5)
    assert np.abs(poses[:, 2]).max() <= np.pi + 1e-6  # headings stay in their range
    assert abs((off[:, 0] * off[:, 1]).mean()) <= 5 * sd_m**2 / np.sqrt(len(off)) + 1e-9
    assert np.ptp(belief.log_weights) == 0


def test_the_same_seed_begins_at_the_same_poses_and_another_elsewhere():
    spread = {"start.sd_m": 0.5, "start.heading_sd_rad": 0.2}
    first, again, other = (_cloud(seed, **spread)[0] for seed in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert np.abs(first - other).max() > 0.1


def test_a_global_start_does_not_heed_it():
    clouds = [
        make_localizer(HALL, settings={"particles": 500, "start.sd_m": sd_m})
        .initialize(None)
        .belief.poses.tobytes()
        for sd_m in (0.0, 0.5)
    ]
    assert clouds[0] == clouds[1]
