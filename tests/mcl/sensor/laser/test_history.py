"""What a proposed place has to explain before it is believed, and when the map is searched at all."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.geometry import compose, inverse
from maurice_mcl.values.laser import FREE, OCCUPIED, OccupancyMap
from maurice_mcl.values.pose_sensor import Earlier, PoseProposal

from .conftest import CELL_M, TRUTH, ZERO, reading_of, scan_at

TRUST = 20.0  # nats for the estimates before


def test_a_cloud_whose_beams_end_in_unknown_space_behind_walls_is_not_right(grid):
    """In unknown space without walls between, the map cannot tell: None; a cloud that searches is wrong."""
    laser = Laser(grid)
    reading = reading_of(laser, scan_at(grid, TRUTH))
    weights = np.full(200, 1 / 200)
    tight = np.random.default_rng(6).normal(0, 0.02, (200, 3))
    for pose, right in (([0.15, 1.7, 3.3], False), ([20.0, 20.0, 0.0], None), (TRUTH, True)):
        cloud = (np.asarray(pose) + tight).astype(np.float32)
        assert laser.explains(reading, cloud, weights, ZERO) is right
    wide = (tight * 300 + [20.0, 20.0, 0.0]).astype(np.float32)
    assert laser.explains(reading, wide, weights, ZERO) is False


def test_a_place_is_confirmed_by_the_scans_that_the_estimate_did_not_explain(grid):
    laser, motion = Laser(grid), np.array([0.5, 0.1, 0.3])
    here = reading_of(laser, scan_at(grid, TRUTH))
    before = compose(TRUTH, inverse(motion))
    reading = reading_of(laser, scan_at(grid, before))
    places = np.stack([TRUTH, [4.5, 1.0, -2.0], [1.0, 2.0, 3.0]])
    proposal = PoseProposal(places, np.tile(np.diag([0.01, 0.01, 0.003]), (3, 1, 1)), np.full(3, 1 / 3))
    lost = np.array([20.0, 20.0, 0.0])
    kept = laser.confirmed(here, proposal, [Earlier(motion[None], 0.0, reading, lost, TRUST)])
    np.testing.assert_array_equal(kept.poses, places[:1])
    assert kept.weights == 1
    assert kept.believed > 0
    kept = laser.confirmed(here, proposal, [Earlier(motion[None], 0.0, reading, before, TRUST)])
    np.testing.assert_array_equal(kept.poses, places[:1])  # where the filter thinks to be
    np.testing.assert_array_equal(laser.confirmed(here, proposal, []).poses, places[:1])  # where it fits
    wrong = PoseProposal(places[1:], proposal.covariances[1:], np.full(2, 0.5))
    assert laser.confirmed(here, wrong, [Earlier(motion[None], 0.0, reading, lost, TRUST)]) is None


@pytest.mark.parametrize("away_m", [0.0, 20.0])
def test_where_little_speaks_for_the_estimate_places_are_as_likely_as_they_fit(grid, away_m):
    """The estimate has a share like any place: most of the cloud goes to a better one, else little."""
    laser, motion = Laser(grid), np.array([0.5, 0.1, 0.3])
    before = compose(TRUTH, inverse(motion))
    estimate = before + np.array([away_m, 0.0, 0.0])
    earlier = [Earlier(motion[None], 0.0, reading_of(laser, scan_at(grid, before)), estimate)]
    places = np.stack([[4.5, 1.0, -2.0], [1.0, 2.0, 3.0], TRUTH])[: 3 if away_m else 2]
    proposal = PoseProposal(places, np.tile(np.diag([0.01, 0.01, 0.003]), (len(places), 1, 1)), places[:, 0])
    kept = laser.confirmed(reading_of(laser, scan_at(grid, TRUTH)), proposal, earlier)
    if away_m:
        assert kept.believed > 0.9
        np.testing.assert_array_equal(kept.poses[kept.weights.argmax()], TRUTH)
    else:
        assert kept is None or kept.believed < 0.1


@pytest.fixture(scope="module")
def corridor():
    cells = np.full((40, 400), FREE, np.uint8)
    cells[[0, -1]] = OCCUPIED
    return OccupancyMap(cells, CELL_M, ZERO)


@pytest.mark.parametrize(("link", "trust", "believed"), [(0.0, 12.0, 0), (-2.0, 12.0, 2), (0.0, 0.0, 2)])
def test_twin_places_are_believed_of_a_robot_that_was_carried_or_searches(corridor, link, trust, believed):
    """Elsewhere one place has to have nearly all mass; of a robot that was carried both are possible."""
    laser, middle_m = Laser(corridor), 20 * CELL_M
    places = np.array([[150 * CELL_M, middle_m, 0.0], [250 * CELL_M, middle_m, 0.0]])
    reading, across = (
        reading_of(laser, scan_at(corridor, pose)) for pose in (places[0], places[0] + [0, 0, 0.7])
    )
    motion, unread = np.array([0.5, 0.0, 0.0]), Earlier(np.zeros((0, 3)), 0.0, None, places[0], trust)
    earlier = [Earlier(motion[None], link, across, np.array([0.0, -50.0, 0.0]), trust), unread]
    covariances = np.tile(np.diag([0.01, 0.01, 0.003]), (2, 1, 1))
    single = PoseProposal(places[:1], covariances[:1], np.ones(1))
    assert len(laser.confirmed(reading, single, earlier).weights) == 1
    both = laser.confirmed(reading, PoseProposal(places, covariances, np.full(2, 0.5)), earlier)
    assert (0 if both is None else len(both.weights)) == believed


def drive(pose, motion, steps):
    """Return the poses (3,) of a drive that ends at one, the last first."""
    return [pose, *drive(compose(pose, inverse(motion)), motion, steps - 1)] if steps else []


@pytest.mark.parametrize(("link", "believed"), [(0.0, False), (-2.0, True)])
def test_how_well_scans_fit_each_other_tells_whether_the_robot_was_carried(grid, link, believed):
    """The estimates explained the scans before: one scan that fits elsewhere is not enough, unless it was."""
    laser, motion = Laser(grid), np.array([0.05, 0.0, 0.0])
    elsewhere = np.array([4.5, 1.0, -2.0])
    proposal = PoseProposal(elsewhere[None], np.diag([0.01, 0.01, 0.003])[None], np.ones(1))
    here = reading_of(laser, scan_at(grid, elsewhere))
    last, *before = drive(TRUTH, motion, 20)
    earlier = [
        Earlier(motion[None], here_link, reading_of(laser, scan_at(grid, pose)), pose, TRUST)
        for pose, here_link in ((last, link), *((pose, 0.0) for pose in before))
    ]
    assert (laser.confirmed(here, proposal, earlier) is not None) == believed


@pytest.mark.parametrize(("trust", "away_m", "believed"), [(0, 9, True), (100, 9, False), (100, 1, True)])
def test_what_speaks_for_the_estimates_before_speaks_against_a_place_far_off(grid, trust, away_m, believed):
    """The place explains the kept scans; so did the estimates those before, but a robot may drift."""
    laser, motion, offset = Laser(grid), np.array([0.05, 0.0, 0.0]), np.array([away_m, 0.0, 0.0])
    proposal = PoseProposal(TRUTH[None], np.diag([0.01, 0.01, 0.003])[None], np.ones(1))
    now, *poses = drive(TRUTH, motion, 4)
    earlier = [
        Earlier(motion[None], 0.0, reading_of(laser, scan_at(grid, pose)), pose + offset, trust)
        for pose in poses
    ]
    kept = laser.confirmed(reading_of(laser, scan_at(grid, now)), proposal, earlier)
    assert (kept is not None) == believed


def test_a_place_counts_what_it_explains_once(corridor):
    """A robot that stands still sees the same again and again: that is no more than one scan."""
    laser = Laser(corridor)
    place = np.array([150 * CELL_M, 20 * CELL_M, 0.0])
    reading = reading_of(laser, scan_at(corridor, place))
    proposal = PoseProposal(place[None], np.diag([0.01, 0.01, 0.003])[None], np.ones(1))
    off = np.array([0.0, -50.0, 0.0])
    standing, driving = np.zeros((1, 3)), np.array([[2.0, 0.0, 0.0]])

    def believed(motions, poses):
        scans = [reading_of(laser, scan_at(corridor, pose)) for pose in poses]
        earlier = [Earlier(motions, 0.0, scan, off, 40.0) for scan in scans]
        return laser.confirmed(reading, proposal, earlier) is not None

    assert not believed(standing, [place] * 6)
    assert believed(driving, drive(place, driving[0], 4)[1:])
