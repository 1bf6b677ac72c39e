import numpy as np
import pytest

from maurice_mcl.filter.proposal import belief_at, uniform_belief
from maurice_mcl.map import Arena, Region, make_grid
from maurice_mcl.randomness import stream

BOX = Region("box", np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]]))
PLACES = np.array([[0.5, 2.5], [1.0, 2.5], [0.5, 3.0]])
MIDDLE = np.array([2.0, 1.5])


def _grid(obstacles=(BOX,)):
    return make_grid(Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4)), obstacles), PLACES)


def test_tracking_starts_on_one_pose():
    belief = belief_at(np.array([500_000.5, 2.0, 3.0 + 2 * np.pi]), 7, np.array([500_000.0, 1.5]))
    assert belief.world_poses == pytest.approx(np.tile([500_000.5, 2.0, 3.0], (7, 1)))
    assert belief.weights == pytest.approx(np.full(7, 1 / 7))


def test_global_start_is_even_over_free_space_and_headings():
    n, grid = 100_000, _grid()
    belief = uniform_belief(grid, n, MIDDLE, stream(9, 1))
    x, y, heading = belief.world_poses.T
    assert grid.free.ravel()[grid.cells_of(belief.poses[:, :2], MIDDLE)].mean() > 0.9999
    assert not ((x < 1.97) & (y < 1.47)).any()
    share = {"right": (x > 2.04), "above": (x < 2.04) & (y > 1.54), "north": heading > np.pi / 2}
    area = 4 * 3 - 2.04 * 1.54
    expected = {"right": 1.96 * 3 / area, "above": 2.04 * 1.46 / area, "north": 0.25}
    for name, inside in share.items():
        p = expected[name]
        assert abs(inside.mean() - p) < 4 * np.sqrt(p * (1 - p) / n) + 0.008  # a cell's border
    assert np.abs(heading).max() <= np.float32(np.pi)


def test_more_particles_keep_the_first_ones():
    few, many = (uniform_belief(_grid(), n, MIDDLE, stream(9, 2)).poses for n in (50, 500))
    assert np.array_equal(many[:50], few)


def test_no_free_space_is_said():
    all_over = Region("flood", np.array([[-1.0, -1.0], [5.0, -1.0], [5.0, 4.0], [-1.0, 4.0]]))
    with pytest.raises(ValueError, match="no free space"):
        uniform_belief(_grid((all_over,)), 10, MIDDLE, stream(9, 1))
