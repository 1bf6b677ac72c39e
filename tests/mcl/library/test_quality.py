"""A library that cannot tell two places apart is found out; one that can is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.library.left_out import LeftOutTable, places_of
from maurice_mcl.library.quality import SelfSimilarity, coverage_of, self_similarity_of
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena, open_arena

COLUMNS, ROWS, STEP_M = 8, 3, 0.5


def grid() -> F64:
    xs, ys = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    return np.column_stack([(xs.ravel() + 0.5) * STEP_M, (ys.ravel() + 0.5) * STEP_M, 0.0 * xs.ravel()])


def library_of(poses: F64, looks: F64, bounds: tuple[float, float] = (4.0, 1.5)) -> Library:
    """Make a library whose color descriptors are made of a few numbers (L, k) each."""
    rows = np.asarray(np.repeat(looks, 84 // looks.shape[1], axis=1), np.float32)
    index = ChannelIndex(rows, np.zeros(rows.shape[1], np.float32), rows.max(axis=0))
    arena = Arena((0.0, 0.0, *bounds), np.zeros((0, 4)))
    return Library("made", poses, (None,) * len(poses), {"color": index}, arena)


def checked(library: Library) -> SelfSimilarity:
    nearest = nearest_reference(library.poses, library.arena)
    return self_similarity_of(
        LeftOutTable.of(SensorModel(library, nearest, SensorParameters({"color": 1.0})))
    )


def smooth(poses: F64) -> F64:
    return np.column_stack([poses[:, 0] + 1, poses[:, 1] + 1]) ** 2 * 5


def test_looks_that_follow_the_place_have_no_look_alikes():
    found = checked(library_of(grid(), smooth(grid())))
    assert (len(found.aliased), found.retrieved_right) == (0, 1)


def test_two_places_that_look_the_same_are_each_others_look_alikes():
    poses = grid()
    looks = smooth(poses)
    looks[COLUMNS - 1] = looks[0]
    found = checked(library_of(poses, looks))
    assert {0, COLUMNS - 1} <= set(found.aliased.tolist())
    assert found.alias[0] == COLUMNS - 1
    assert found.margin[0] < 0
    assert found.retrieved[0] == 0
    assert found.retrieved_right < 1


def test_ambiguity_at_its_ends():
    poses = grid()
    found = checked(library_of(poses, np.full((len(poses), 2), 7.0)))
    assert found.ambiguity == pytest.approx(np.full(len(poses), len(poses) - 1))
    assert found.at_places(found.ambiguity) == pytest.approx(np.full(len(poses), len(poses) - 1))
    poses = np.array([[1.0, 1.0, k * np.pi / 4 - np.pi] for k in range(8)])
    found = checked(library_of(poses, np.arange(16.0).reshape(8, 2)))
    assert np.isnan(found.retrieved).all()
    assert found.retrieved_right == 0
    assert (found.ambiguity == 1).all()


def test_places_are_apart():
    poses = np.repeat(grid(), 8, axis=0)
    places, place_of = places_of(poses[:, :2], STEP_M)
    assert len(places) == COLUMNS * ROWS
    assert (np.bincount(place_of) == 8).all()
    assert np.allclose(places[place_of], poses[:, :2])
    xy = np.random.default_rng(0).random((300, 2)) * 3
    places, place_of = places_of(xy, 0.4)
    assert np.hypot(*(xy - places[place_of]).T).max() < 0.4
    firsts = xy[np.unique(place_of, return_index=True)[1]]
    apart = np.hypot(*(firsts[:, None] - firsts[None]).transpose(2, 0, 1)) + np.eye(len(firsts))
    assert apart.min() > 0.3


def test_coverage_finds_the_hole():
    poses = grid()
    whole = coverage_of(library_of(poses, smooth(poses)), STEP_M)
    assert (whole.covered, whole.gaps) == (1, ())
    assert whole.directions == pytest.approx(1 / 8)
    left = poses[(poses[:, 0] < 1.5) | (poses[:, 0] > 3.5)]
    holed = coverage_of(library_of(left, smooth(left)), STEP_M)
    assert 0.5 < holed.covered < 0.9
    assert len(holed.gaps) == 1
    assert holed.gaps[0].x_m == pytest.approx(2.5, abs=0.3)
    assert holed.gaps[0].to_entry_m > STEP_M


def mapless(poses: F64) -> Library:
    return replace(library_of(poses, smooth(poses)), arena=open_arena(poses))


def test_without_a_map_only_holes_are_gaps():
    whole = coverage_of(mapless(grid()), STEP_M)
    assert not whole.mapped
    assert (whole.covered, whole.gaps) == (1, ())
    assert whole.free_m2 == pytest.approx((COLUMNS - 1) * (ROWS - 1) * STEP_M**2, rel=0.1)
    poses = grid()
    found = coverage_of(mapless(poses[(poses[:, 0] < 1.5) | (poses[:, 0] > 3.0)]), STEP_M)
    assert len(found.gaps) == 1
    assert found.gaps[0].x_m == pytest.approx(2.25, abs=0.3)


@pytest.mark.parametrize("count", [1, 2, 8])
def test_without_a_map_a_way_straight_on_is_covered(count):
    found = coverage_of(mapless(grid()[:count]), STEP_M)
    assert (found.covered, found.gaps) == (1, ())


def test_a_drive_thinned_by_place_or_heading_has_neighbors_that_look_the_same_way():
    """There and back again, half a step aside: the nearest entries look the other way."""
    there = np.array([[0.5 * k, 0.0, 0.0] for k in range(16)])
    back = there + np.array([0.25, 0.1, np.pi])
    poses = np.concatenate([there, back])
    found = checked(library_of(poses, np.column_stack([smooth(poses)[:, 0], 40 + 400 * (poses[:, 2] > 1)])))
    assert found.spacing_m == pytest.approx(0.5)
    assert found.retrieved_right == 1


def test_a_view_reaches_as_far_as_pictures_look_like_their_references_and_is_compared_with_the_spacing():
    found = checked(library_of(grid(), smooth(grid())))
    assert found.reach_m >= 1.05 * STEP_M
    assert not found.is_sparse
    looks = np.random.default_rng(0).uniform(0, 200, (COLUMNS * ROWS, 2))  # no place looks like the next
    found = checked(library_of(grid(), looks))
    assert found.reach_m == 0
    assert found.is_sparse


def test_confused_entries_have_an_alias_and_most_of_their_likelihood_far_away():
    poses = grid()
    looks = smooth(poses)
    looks[COLUMNS - 1] = looks[0]
    found = checked(library_of(poses, looks))
    assert {0, COLUMNS - 1} == set(found.confused.tolist())
    assert (found.confusion[found.confused] > 0.5).all()
    assert set(found.confused.tolist()) <= set(found.aliased.tolist())
