"""The library doctor: what is left out of a survey is asked for, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.library.advice import (
    AMBIGUITY,
    GAP,
    HEADING,
    LibraryAdvice,
    advise,
    without_reference,
)
from maurice_mcl.library.left_out import LeftOutTable
from maurice_mcl.library.quality import coverage_of, self_similarity_of
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.arrays import F64, Bool
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena, Region

COLUMNS, ROWS, STEP_M, HEADINGS = 10, 6, 0.5, 8
WIDTH_M, DEPTH_M = COLUMNS * STEP_M, ROWS * STEP_M


def survey() -> F64:
    x, y, k = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), np.arange(HEADINGS), indexing="ij")
    poses = [(x + 0.5) * STEP_M, (y + 0.5) * STEP_M, k * 2 * np.pi / HEADINGS]
    return np.column_stack([one.ravel() for one in poses])


def walls() -> F64:
    corners = np.array([(0, 0), (WIDTH_M, 0), (WIDTH_M, DEPTH_M), (0, DEPTH_M)], np.float64)
    return np.column_stack([corners, np.roll(corners, -1, axis=0)])


def look_of(poses: F64) -> F64:
    """Return looks (L, 4) that follow place and heading."""
    x, y, heading = poses.T
    return np.column_stack([20 * x + 1, 20 * y + 1, 8 + 8 * np.cos(heading), 8 + 8 * np.sin(heading)])


def library_of(poses: F64, looks: F64 | None = None, *regions: Region) -> Library:
    rows = np.asarray(np.repeat(look_of(poses) if looks is None else looks, 21, axis=1), np.float32)
    index = ChannelIndex(rows, np.zeros(rows.shape[1], np.float32), rows.max(axis=0))
    arena = Arena((0.0, 0.0, WIDTH_M, DEPTH_M), walls(), obstacles=regions)
    return Library("made", poses, (None,) * len(poses), {"color": index}, arena)


def advised(library: Library) -> LibraryAdvice:
    nearest = nearest_reference(library.poses, library.arena)
    sensor = SensorModel(library, nearest, SensorParameters({"color": 1.0}))
    return advise(library, self_similarity_of(LeftOutTable.of(sensor)))


def poses_of(advice: LibraryAdvice) -> F64:
    return np.array([one.pose for one in advice.added])


def in_hole(poses: F64) -> Bool:
    return (np.abs(poses[:, 0] - 2.5) < 1) & (np.abs(poses[:, 1] - 1.5) < 1)


def test_a_complete_survey_needs_nothing():
    found = advised(library_of(survey()))
    assert (found.added, found.missing) == ((), ())


def test_what_is_left_out_is_asked_for_and_fills_the_gap():
    hole = in_hole(survey())
    library = library_of(survey()[~hole])
    found = advised(library)
    added = poses_of(found)
    assert found.count(GAP) == len(added) - found.count(HEADING) > 0
    assert np.abs(added[:, :2] - (2.5, 1.5)).max() < 1.5
    assert len(added) <= 1.3 * hole.sum()
    assert coverage_of(library, STEP_M).covered < 0.95
    whole = library_of(np.vstack([library.poses, added]))
    assert coverage_of(whole, STEP_M).covered > 0.999
    assert coverage_of(whole, STEP_M).directions == pytest.approx(1, abs=0.01)


def test_headings_that_are_left_out_are_asked_for():
    some = survey()
    gone = in_hole(some) & np.isin(np.round(np.degrees(some[:, 2])), [90, 135])
    found = advised(library_of(some[~gone]))
    assert {round(degrees) for degrees in np.degrees(poses_of(found)[:, 2])} == {90, 135}
    assert found.count(HEADING) == len(found.added)
    worst = found.missing[0]
    assert np.degrees(worst.headings_rad).round().tolist() == [90, 135]
    assert (worst.x_m, worst.y_m) == pytest.approx((2.5, 1.5), abs=1)


def test_nothing_is_asked_for_where_no_robot_can_stand():
    table = Region("table", np.array([(2.0, 1.0), (3.0, 1.0), (3.0, 2.0), (2.0, 2.0)]))
    added = poses_of(advised(library_of(survey()[~in_hole(survey())], None, table)))
    outside = np.maximum(np.abs(added[:, 0] - 2.5), np.abs(added[:, 1] - 1.5))
    assert outside.min() > 0.5
    assert added[:, :2].min() > 0.2  # as far from the walls as the survey is


def test_places_that_look_alike_are_said_with_their_odds_and_parted():
    poses = survey()
    looks = look_of(poses)
    one, other = (0, ROWS // 2), (COLUMNS - 1, ROWS // 2)
    first, second = (np.arange(HEADINGS) + HEADINGS * (column * ROWS + row) for column, row in (one, other))
    looks[second] = looks[first]
    found = advised(library_of(poses, looks))
    worst = found.confusions[0]
    assert {worst.entry, worst.like} <= {*first.tolist(), *second.tolist()}
    assert worst.apart_m == pytest.approx((COLUMNS - 1) * STEP_M)
    assert worst.share > 0.5
    assert worst.rank > 1
    assert found.count(AMBIGUITY) == len(found.added) > 0
    near = [np.hypot(*(poses_of(found)[:, :2] - poses[k, :2]).T) <= STEP_M for k in (first[0], second[0])]
    assert (near[0] | near[1]).all()


def test_advice_is_the_same_far_from_the_origin():
    poses, far = survey()[~in_hole(survey())], np.array([4e5, 5e6, 0.0])
    here = library_of(poses)
    arena = replace(
        here.arena,
        bounds=(4e5, 5e6, 4e5 + WIDTH_M, 5e6 + DEPTH_M),
        walls=here.arena.walls + np.tile(far[:2], 2),
    )
    there = advised(replace(here, poses=poses + far, arena=arena))
    assert poses_of(there) - far == pytest.approx(poses_of(advised(here)), abs=1e-6)


def test_a_direction_is_there_if_a_pose_within_reach_looks_that_way():
    poses = np.array([(0.0, 0.0, 0.3), (0.0, 0.0, np.pi)])
    lacking = without_reference(np.array([(0.4, 0.0), (0.6, 0.0)]), poses, 0.5)
    assert (~lacking[0]).nonzero()[0].tolist() == [0, 4]
    assert lacking[1].all()
