"""What a proposed place has to explain before it is believed, and when the map is searched at all."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.geometry import compose, inverse
from maurice_mcl.values.laser import FREE, OCCUPIED, OccupancyMap
from maurice_mcl.values.pose_sensor import Earlier, PoseProposal

from .conftest import CELL_M, TRUTH, ZERO, reading_of, scan_at


def test_a_cloud_whose_beams_end_in_unknown_space_behind_walls_is_not_right(grid):
    """In unknown space without walls between, the map cannot tell; nor does it of a cloud that searches."""
    laser = Laser(grid)
    reading = reading_of(laser, scan_at(grid, TRUTH))
    weights = np.full(200, 1 / 200)
    tight = np.random.default_rng(6).normal(0, 0.02, (200, 3))
    for pose, right in (([0.15, 1.7, 3.3], False), ([20.0, 20.0, 0.0], True), (TRUTH, True)):
        cloud = (np.asarray(pose) + tight).astype(np.float32)
        assert laser.explains(reading, cloud, weights, ZERO) == right
    wide = (tight * 300 + [20.0, 20.0, 0.0]).astype(np.float32)
    assert not laser.explains(reading, wide, weights, ZERO)


def test_a_place_is_confirmed_by_the_scans_that_the_estimate_did_not_explain(grid):
    laser, motion = Laser(grid), np.array([0.5, 0.1, 0.3])
    here = reading_of(laser, scan_at(grid, TRUTH))
    before = compose(TRUTH, inverse(motion))
    reading = reading_of(laser, scan_at(grid, before))
    places = np.stack([TRUTH, [4.5, 1.0, -2.0], [1.0, 2.0, 3.0]])
    proposal = PoseProposal(places, np.tile(np.diag([0.01, 0.01, 0.003]), (3, 1, 1)), np.full(3, 1 / 3))
    lost = np.array([20.0, 20.0, 0.0])
    kept = laser.confirmed(here, proposal, [Earlier(motion[None], reading, lost)])
    np.testing.assert_array_equal(kept.poses, places[:1])
    assert kept.weights == 1
    assert kept.believed > 0
    kept = laser.confirmed(here, proposal, [Earlier(motion[None], reading, before)])
    np.testing.assert_array_equal(kept.poses, places[:1])  # where the filter thinks to be
    assert laser.confirmed(here, proposal, []) is proposal
    wrong = PoseProposal(places[1:], proposal.covariances[1:], np.full(2, 0.5))
    assert laser.confirmed(here, wrong, [Earlier(motion[None], reading, lost)]) is None


def test_off_the_map_a_place_in_a_corridor_is_not_believed_where_another_fits_as_well():
    cells = np.full((40, 400), FREE, np.uint8)
    cells[[0, -1]] = OCCUPIED
    corridor = OccupancyMap(cells, CELL_M, ZERO)
    laser, middle_m = Laser(corridor), 20 * CELL_M
    places = np.array([[150 * CELL_M, middle_m, 0.0], [250 * CELL_M, middle_m, 0.0]])
    reading = reading_of(laser, scan_at(corridor, places[0]))
    motion, unread = np.array([0.5, 0.0, 0.0]), Earlier(np.zeros((0, 3)), None, places[0])
    earlier = [Earlier(motion[None], reading, np.array([0.0, -50.0, 0.0])), unread]
    covariances = np.tile(np.diag([0.01, 0.01, 0.003]), (2, 1, 1))
    single = PoseProposal(places[:1], covariances[:1], np.ones(1))
    assert len(laser.confirmed(reading, single, earlier).weights) == 1
    assert laser.confirmed(reading, PoseProposal(places, covariances, np.full(2, 0.5)), earlier) is None


def test_a_place_off_the_map_has_to_explain_what_was_explained_before(grid):
    """Unless scans speak so much for it that the robot was carried off."""
    laser, motion = Laser(grid), np.array([0.05, 0.0, 0.0])
    elsewhere = np.array([4.5, 1.0, -2.0])
    off = np.array([20.0, 20.0, 0.0])
    proposal = PoseProposal(elsewhere[None], np.diag([0.01, 0.01, 0.003])[None], np.ones(1))

    def seen(pose: np.ndarray, estimate: np.ndarray) -> Earlier:
        return Earlier(motion[None], reading_of(laser, scan_at(grid, pose)), estimate)

    def back(pose: np.ndarray, steps: int) -> list[np.ndarray]:
        return [pose, *back(compose(pose, inverse(motion)), steps - 1)] if steps else []

    here = reading_of(laser, scan_at(grid, elsewhere))
    explained = [seen(pose, pose) for pose in back(TRUTH, 20)]
    for since, believed in ((1, False), (12, True)):
        unexplained = [seen(pose, off) for pose in back(elsewhere, since + 1)[1:]]
        assert (laser.confirmed(here, proposal, [*unexplained, *explained]) is not None) == believed
    unexplained = [seen(pose, off) for pose in back(elsewhere, 2)[1:]]
    assert laser.confirmed(here, proposal, unexplained) is not None  # nothing was explained before


@pytest.mark.parametrize(("away_m", "believed"), [(1.0, True), (4.0, False)])
def test_where_wheels_slipped_a_place_nearby_needs_this_scan_alone(away_m, believed):
    """The odometry does not lead back to where the scan before was seen."""
    cells = np.full((120, 200), FREE, np.uint8)
    cells[[0, -1]], cells[:, [0, -1]], cells[30:60, 70:80] = OCCUPIED, OCCUPIED, OCCUPIED
    hall = OccupancyMap(cells, CELL_M, ZERO)
    laser, now = Laser(hall), np.array([2.5, 3.0, 0.3])
    before, estimate = np.add(now, [0.5, 0.7, 0.6]), np.add(now, [away_m, 0.0, 0.1])
    then, reading = (reading_of(laser, scan_at(hall, pose)) for pose in (before, now))
    proposal = PoseProposal(now[None], np.diag([0.01, 0.01, 0.003])[None], np.ones(1))
    kept = laser.confirmed(reading, proposal, [Earlier(np.zeros((1, 3)), then, estimate)])
    assert (kept is not None) == believed
    explained = Earlier(np.zeros((1, 3)), reading, estimate)
    assert laser.confirmed(reading, proposal, [explained]) is not None  # near or far
