from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.estimate import heaviest_cluster
from maurice_mcl.scoring.metrics import score_step
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import USUAL, Library, Radii, RadiiParameters, fitted_m, radii_of
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import Belief, uniform_log_weights


def _library(width, depth, spacing_m, headings=8, jitter_m=0.0):
    """Return references on a grid over a map of this size, in meters."""
    sides = (np.arange(spacing_m / 2, side, spacing_m) for side in (width, depth))
    turns = np.arange(headings) * 2 * np.pi / headings - np.pi
    poses = np.stack(np.meshgrid(*sides, turns), axis=-1).reshape(-1, 3)
    poses[:, :2] += np.random.default_rng(0).normal(0, jitter_m, (len(poses), 2)) if jitter_m else 0
    arena = Arena((0.0, 0.0, width, depth), np.zeros((0, 4)))
    return Library("grid", poses, (None,) * len(poses), {}, arena)


def _spread_evenly(width, depth):
    """Return a cloud that knows nothing."""
    rng = np.random.default_rng(0)
    poses = rng.uniform([-width / 2, -depth / 2, -np.pi], [width / 2, depth / 2, np.pi], (4000, 3))
    return Belief(poses.astype(np.float32), uniform_log_weights(4000), np.array([width, depth]) / 2)


def test_references_18_inches_apart_have_the_usual_radii_to_the_last_bit():
    assert radii_of(_library(204 * INCH_M, 156 * INCH_M, 18 * INCH_M)) == USUAL
    assert Radii(12 * INCH_M, 18 * INCH_M, 24 * INCH_M, 36 * INCH_M) == USUAL


@pytest.mark.parametrize(
    ("size", "spacing_m", "right_m"),
    [
        ((1.2, 0.4), 0.05, 0.05),
        ((1.2, 0.4), 0.2, 0.0866),  # an eighth of the side: the map is too small for its references
        ((200.0, 200.0), 5.0, 5.0),
        ((200.0, 200.0), 40.0, 25.0),
        ((20.0, 10.0), 0.01, 0.0707),  # a 200th: no true pose is that accurate
        ((3.0, 2.0), 2.5, 0.3062),  # a single place
    ],
)
def test_radii_follow_the_spacing_within_what_the_map_allows(size, spacing_m, right_m):
    # a fine grid is long, so that only a part of it is made
    library = _library(*(min(side, 12 * spacing_m) for side in size), spacing_m, headings=2)
    found = radii_of(replace(library, arena=Arena((0.0, 0.0, *size), np.zeros((0, 4)))))
    assert found.right_m == pytest.approx(right_m, abs=0.0002)
    others = (found.confidence_m, found.cluster_m, found.lost_m)
    assert others == pytest.approx([found.right_m * share for share in (2 / 3, 4 / 3, 2)])


def test_pictures_of_one_place_that_jitter_are_no_neighbors():
    found = radii_of(_library(4.0, 4.0, 0.5, headings=12, jitter_m=0.003))
    assert found.right_m == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("size", "spacing_m"), [((1.2, 0.4), 0.1), ((200.0, 200.0), 5.0)])
def test_converged_is_neither_automatic_nor_out_of_reach(size, spacing_m):
    radii = radii_of(_library(*size, spacing_m))
    anywhere = heaviest_cluster(_spread_evenly(*size), radii)
    assert anywhere.converged < 0.2
    assert not score_step(anywhere, None).converged
    near = _spread_evenly(*size)  # all within a quarter of the spacing
    shrunk = near.poses * np.float32([spacing_m / 4 / size[0], spacing_m / 4 / size[1], 0])
    there = heaviest_cluster(replace(near, poses=shrunk), radii)
    assert there.confidence == pytest.approx(1)
    beside, lost = (there.pose + np.array([off * spacing_m, 0, 0]) for off in (0.8, 2.2))
    assert score_step(there, beside).localized
    assert score_step(there, lost).wrong_and_confident
    assert score_step(there, lost).lost


def test_an_evenly_spread_cloud_is_converged_on_a_table_by_the_radii_in_inches():
    assert heaviest_cluster(_spread_evenly(1.2, 0.4)).converged > 0.9


def test_given_radii_come_first_and_the_others_follow_what_is_right():
    library = _library(6.0, 4.0, 0.5)
    found = radii_of(library, RadiiParameters(right_m=0.3, lost_m=2.0))
    assert found == Radii(pytest.approx(0.2), 0.3, pytest.approx(0.4), 2.0)
    assert radii_of(library, RadiiParameters(lost_m=0.1)).right_m == 0.1


def test_radii_are_configured_like_everything_else():
    radii = configure([Layer("x", {"radii.right_m": "0.3"})]).parameters.radii
    assert radii == RadiiParameters(right_m=0.3)
    with pytest.raises(ValueError, match=r"x: radii.right_m: found 1e-06, .* 0.001"):
        configure([Layer("x", {"radii.right_m": 1e-6})])
    with pytest.raises(ValueError, match=r"x: radii.lost_m: found 0.2, .* radii.right_m, 0.3"):
        configure([Layer("x", {"radii.right_m": 0.3, "radii.lost_m": 0.2})])


@pytest.mark.parametrize(("side_m", "length_m"), [(5, 0.4), (80, 0.4), (0.9, 0.106), (200, 0.707), (0, 0.4)])
def test_lengths_for_rooms_fit_a_table_and_a_field(side_m, length_m):
    assert fitted_m(0.4, np.array([[0, 0], [side_m, side_m]])) == pytest.approx(length_m, abs=0.001)
