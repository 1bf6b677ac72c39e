"""What lies on the map: match circles of references, library nodes, walls."""

import numpy as np
import pytest

from helpers import viz_fakes as fakes
from maurice_viz.panels.references import MatchCircles, nearness, node_spacing
from maurice_viz.panels.world import clipped, distinct_places
from maurice_viz.style import DEEPEST, scale_for


def test_circles_places_and_likelihoods():
    library = fakes.make_library()
    scale = scale_for("in", library.arena)
    circles = MatchCircles(library, scale)
    assert circles.spacing == pytest.approx(18)
    off = (circles.centers - scale.screen(library.poses)) * (1, -1)
    np.testing.assert_allclose(np.arctan2(off[:, 1], off[:, 0]), library.poses[:, 2], atol=0.01)
    poses = np.array([[0, 0, 0], [0, 0, 1], [2, 0, 0]], float)
    assert len(distinct_places(poses)) == 2
    assert node_spacing(poses) == 2
    assert node_spacing(poses[:1]) > 0
    logs = np.log(np.array([0.5, 0.25, 1e-30], np.float32))
    np.testing.assert_allclose(nearness(logs), [1, 1 - np.log(2) / DEEPEST, 0], atol=1e-6)
    np.testing.assert_array_equal(nearness(np.full(3, -np.inf, np.float32)), [0, 0, 0])


def test_circles_of_calibrated_likelihoods_have_sizes_that_differ():
    """By area in proportion to the likelihood, 4 and 12 nats below the best were the same dot."""
    below = np.array([0, 1, 2, 4, 6, 8, 12], np.float32)
    np.testing.assert_allclose(nearness(-7 - below), [1, 0.875, 0.75, 0.5, 0.25, 0, 0], atol=1e-6)


def test_walls_are_cut_at_the_bounds():
    bounds = (0.0, 0.0, 4.0, 3.0)
    walls = np.array(
        [
            [1.0, 1.0, 2.0, 2.0],  # inside: as it is
            [-2.0, 1.0, 2.0, 1.0],  # cut on one side
            [2.0, -5.0, 2.0, 9.0],  # cut on both
            [-1.0, -1.0, 5.0, 5.0],  # slanted, through two corners' sides
            [0.0, 0.0, 4.0, 0.0],  # on the border
            [5.0, 0.0, 5.0, 3.0],  # beside, parallel
            [-3.0, 2.0, 1.0, 6.0],  # passes the corner outside
        ]
    )
    expected = [[1, 1, 2, 2], [0, 1, 2, 1], [2, 0, 2, 3], [0, 0, 3, 3], [0, 0, 4, 0]]
    np.testing.assert_allclose(clipped(walls, bounds), expected)
    assert clipped(np.zeros((0, 4)), bounds).shape == (0, 4)
