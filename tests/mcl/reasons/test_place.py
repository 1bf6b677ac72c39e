"""What an update says of the place where the robot is, and which reference shows what is seen at a pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.step_records import made
from maurice_mcl.reasons.place import PlaceKnown, place_known, rank_of, reference_near
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import Comparison, StepRecord

WALL = np.array([[2.0, 0.0, 2.0, 4.0]])
# two at one place facing east and west, one in the other room, one 0.3 m from the first facing north
POSES = np.array([[1.0, 2.0, 0.0], [1.0, 2.0, -np.pi], [2.2, 2.0, 0.0], [1.0, 2.3, np.pi / 2]])


def library(poses: np.ndarray = POSES, walls: np.ndarray = WALL) -> Library:
    return Library("x", poses, (None,) * len(poses), {}, Arena((0.0, 0.0, 4.0, 4.0), walls))


def compared(record: StepRecord, log_likelihood: list[float]) -> StepRecord:
    logs = np.array(log_likelihood, np.float32)
    row = logs[None]
    quality = np.exp(logs - logs.max())
    comparison = Comparison(("color",), {}, row, row, quality, row, -logs, logs)
    return replace(record, sighting=replace(record.sighting, comparison=comparison))


def known(cloud: list[tuple[float, float, float]], logs: list[float], truth: np.ndarray | None) -> PlaceKnown:
    place = place_known(compared(made(cloud), logs), truth, 0, library())
    assert place is not None
    return place


def test_the_rank_is_that_of_the_places_reference_and_equals_share_it():
    logs = np.array([-3.0, -1.0, -3.0, -9.0], np.float32)
    assert [rank_of(logs, entry) for entry in range(4)] == [2, 1, 2, 4]


def test_dots_count_by_place_and_heading():
    truth = POSES[0]
    far = known([(3.0, 2.0, 1.0)], [-1, -2, -3, -4], truth)
    assert (far.rank, far.entries, far.near, far.share) == (1, 4, 0, 0.0)
    assert far.nearest_m == pytest.approx(2.0)
    assert not far.has_dot
    both = known([(3.0, 2.0, 0.75), (1.1, 2.0, 0.25)], [-1, -2, -3, -4], truth)
    assert (both.near, both.share) == (1, pytest.approx(0.25))
    turned = known([(1.0, 2.0, 1.0)], [-1, -2, -3, -4], POSES[1])  # dots face east
    assert (turned.near, turned.nearest_m, turned.has_dot) == (0, 0.0, True)


def test_without_truth_the_place_is_that_of_the_best_match_and_nothing_is_ranked():
    place = known([(3.0, 2.0, 1.0)], [-2, -2, -1, -4], None)
    assert (place.is_true, place.rank) == (False, None)
    assert place.nearest_m == pytest.approx(0.8)
    flat = compared(made([(3.0, 2.0, 1.0)]), [-2, -2, -2, -2])
    assert place_known(flat, None, -1, library()) is None
    assert place_known(made([(3.0, 2.0, 1.0)]), None, -1, library()) is None


def test_a_true_place_that_was_not_compared_has_no_rank():
    place = place_known(made([(3.0, 2.0, 1.0)]), POSES[0], 0, library())
    assert place is not None
    assert (place.rank, place.is_true) == (None, True)
    outside = place_known(compared(made([(3.0, 2.0, 1.0)]), [-1, -2, -3, -4]), POSES[0], -1, library())
    assert outside is not None
    assert outside.rank is None


@pytest.mark.parametrize(
    ("pose", "entry"),
    [
        ((1.0, 2.0, 0.1), 0),
        ((1.0, 2.0, 3.1), 1),  # headings are wrapped
        ((1.0, 2.05, np.pi / 2), 3),  # the place is nearest to others, which face elsewhere
        ((1.9, 2.0, 0.0), -1),  # 0.3 m from the third, behind the wall; the first is too far
        ((1.0, 2.0, -np.pi / 2), -1),  # no one faces that way
        ((3.9, 3.9, 0.0), -1),
    ],
)
def test_the_reference_shown_is_near_in_place_and_heading_and_never_behind_a_wall(pose, entry):
    lib = library()
    assert reference_near(lib, nearest_reference(lib.poses, lib.arena), np.array(pose), 0.45) == entry


def test_without_the_wall_the_same_reference_is_near():
    lib = library(walls=np.zeros((0, 4)))
    assert reference_near(lib, nearest_reference(lib.poses, lib.arena), np.array([1.9, 2, 0.0]), 0.45) == 2
