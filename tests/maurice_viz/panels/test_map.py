"""What lies on the map: match circles of references, library nodes, walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers import viz_fakes as fakes
from helpers.step_records import made
from maurice_mcl.filter.estimate import heaviest_cluster
from maurice_mcl.scoring.modes import TrackedMode
from maurice_mcl.values.map import Arena
from maurice_viz.panels.panel import joined_labels
from maurice_viz.panels.population import rings_of
from maurice_viz.panels.references import MatchCircles, nearness
from maurice_viz.panels.world import clipped
from maurice_viz.style import DEEPEST, scale_for


def test_circles_places_and_likelihoods():
    library = fakes.make_library()
    scale = scale_for("in", library.arena)
    circles = MatchCircles(library, scale)
    assert circles.spacing == pytest.approx(18)
    off = (circles.centers - scale.screen(library.poses)) * (1, -1)
    np.testing.assert_allclose(np.arctan2(off[:, 1], off[:, 0]), library.poses[:, 2], atol=0.01)
    logs = np.log(np.array([0.5, 0.25, 1e-30], np.float32))
    np.testing.assert_allclose(nearness(logs), [1, 1 - np.log(2) / DEEPEST, 0], atol=1e-6)
    np.testing.assert_array_equal(nearness(np.full(3, -np.inf, np.float32)), [0, 0, 0])


def test_circles_of_calibrated_likelihoods_have_sizes_that_differ():
    """By area in proportion to the likelihood, 4 and 12 nats below the best were the same dot."""
    below = np.array([0, 1, 2, 4, 6, 8, 12], np.float32)
    np.testing.assert_allclose(nearness(-7 - below), [1, 0.875, 0.75, 0.5, 0.25, 0, 0], atol=1e-6)


def test_references_at_one_place_share_a_label():
    places = np.array([[0, 0], [1, 0], [9, 0], [0, 1], [2, 0]], np.float32)
    assert joined_labels(places, 1.2, "12345") == [
        "1, 2, 4",
        "",
        "3",
        "",
        "5",
    ]  # the fifth is near the second alone
    assert joined_labels(places, 0.5, "12345") == ["1", "2", "3", "4", "5"]


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


def test_rings_are_around_modes_where_two_hold_a_tenth_of_the_weight_or_more():
    scale = scale_for("m", Arena((0.0, 0.0, 5.0, 4.0), np.zeros((0, 4))))
    one, two, small = (
        TrackedMode(k, heaviest_cluster(made([(x, 1.0, 1.0)]).weighted))
        for k, x in ((1, 1.0), (2, 4.0), (3, 2.0))
    )
    shared = [
        replace(mode, estimate=replace(mode.estimate, mass=mass))
        for mode, mass in ((one, 0.6), (two, 0.35), (small, 0.05))
    ]
    parts = rings_of(shared, scale, 0.5).as_component_batches()
    row = {part.component_descriptor().component: part.as_arrow_array() for part in parts}
    assert row["LineStrips2D:labels"].to_pylist() == ["60 %", "35 %"]
    for strip, mode in zip(row["LineStrips2D:strips"].to_pylist(), shared, strict=False):
        ring = np.array(strip)
        middle = scale.screen(mode.estimate.pose[None, :2])[0]
        away = np.hypot(*(ring - middle).T)
        radius = scale.length(mode.estimate.radii.cluster_m) * np.sqrt(mode.estimate.mass)
        assert away == pytest.approx(radius, rel=1e-3)
    parts = rings_of(shared, scale, scale.length(4.0)).as_component_batches()
    row = {part.component_descriptor().component: part.as_arrow_array() for part in parts}
    assert row["LineStrips2D:labels"].to_pylist() == ["60 %, 35 %", ""]
    alone = rings_of([replace(one, estimate=replace(one.estimate, mass=0.95)), shared[2]], scale, 0.5)
    assert all(len(part.as_arrow_array()) == 0 for part in alone.as_component_batches())
