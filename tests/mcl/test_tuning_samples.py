"""Pictures to tune on: from drives, and from the library with each reference left out."""

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.calibration import tuning as tuning_samples
from maurice_mcl.calibration.tuning import (
    Measuring,
    drive_samples,
    library_samples,
    neighbors,
    spread_out,
    true_entry,
)
from maurice_mcl.library import ChannelIndex, Library
from maurice_mcl.map import Arena
from maurice_mcl.sensor.references import nearest_reference

NO_WALLS = np.zeros((0, 4))


def _library(poses, walls=NO_WALLS):
    poses = np.array(poses, float)
    references = np.random.default_rng(0).random((len(poses), 6)).astype(np.float32)
    index = {"color": ChannelIndex(references, np.zeros(6, np.float32), references.max(axis=0))}
    arena = Arena((-9.0, -9.0, 9.0, 9.0), np.array(walls))
    return Library("few", poses, (None,) * len(poses), index, arena)


def test_the_nearest_other_place_and_the_nearest_heading_there():
    library = _library([[0, 0, 0], [0, 0, 2], [1, 0, 1.9], [1, 0, 0.1], [5, 0, 0]])
    assert neighbors(library).tolist() == [3, 2, 1, 0, 3]


def test_never_across_a_wall():
    library = _library([[0, 0, 0], [1, 0, 0], [-2, 0, 0]], [[0.5, -8, 0.5, 8]])
    assert neighbors(library).tolist() == [2, -1, 0]


def test_headings_across_the_seam_are_near_and_others_are_no_truth():
    library = _library([[0, 0, np.pi - 0.1], [1, 0, -np.pi + 0.1], [9, 9, 0]])
    assert neighbors(library).tolist() == [1, 0, -1]


@pytest.mark.parametrize("poses", [[[0, 0, 0]], [[0, 0, 0], [0, 0, 1]]])
def test_one_place_has_no_neighbor_and_gives_no_sample(poses):
    library = _library(poses)
    assert (neighbors(library) == -1).all()
    assert library_samples(Measuring(library, {"color": "l1"}), 100) == []


def test_a_reference_left_out_is_compared_with_all_others():
    library = _library([[0, 0, 0], [1, 0, 0], [2.5, 0, 0], [3.5, 0, 0]])
    (sample,) = library_samples(Measuring(library, {"color": "l1"}), 100)
    references = library.index["color"].references
    for entry, truth in enumerate([1, 0, 3, 2]):
        others = np.delete(np.arange(4), entry)
        expected = np.abs(references[others] - references[entry]).mean(axis=1)
        assert sample.distances[0, entry] == pytest.approx(expected, rel=1e-5)
        assert others[sample.truth[entry]] == truth


def test_drive_pictures_have_the_entry_nearest_to_their_truth(world):
    nearest = nearest_reference(world.library.poses, world.library.arena)
    measuring = Measuring(world.library, {"tiny": "l1", "color": "hellinger"})
    moments = list(world.drive.moments())
    moments[2] = replace(moments[2], truth=None)
    (sample,) = drive_samples(measuring, nearest, moments, frozenset(range(8)))
    kept = [moment for moment in moments if moment.truth is not None]
    entries = [true_entry(nearest, world.library, moment.truth) for moment in kept]
    assert sample.truth.tolist() == [entry for entry in entries if entry >= 0]
    assert sample.distances.shape == (2, len(sample.truth), world.library.size)
    assert sample.distances.dtype == np.float32


def test_only_the_pictures_taken_are_measured(world):
    nearest = nearest_reference(world.library.poses, world.library.arena)
    measuring = Measuring(world.library, {"color": "l1"})
    told = []
    found = drive_samples(
        measuring, nearest, world.drive.moments(), frozenset([1, 5]), lambda d, n: told.append((d, n))
    )
    assert sum(len(s.truth) for s in found) <= 2
    assert told == [(1, 2), (2, 2)]


def test_spread_out_takes_both_ends_and_no_more_than_allowed():
    assert spread_out(5, 9) == frozenset(range(5))
    assert spread_out(100, 3) == frozenset([0, 50, 99])
    assert spread_out(0, 3) == frozenset()


def test_what_is_held_is_bounded_whatever_the_library(world, monkeypatch):
    measuring = Measuring(world.library, {"color": "l1", "tiny": "l1"})
    size = 2 * world.library.size
    monkeypatch.setattr(tuning_samples, "MOST_DISTANCES", 10 * size)
    monkeypatch.setattr(tuning_samples, "MOST_IN_BLOCK", 4 * size)
    assert measuring.most_pictures() == 10
    found = library_samples(measuring, measuring.most_pictures())
    assert [len(s.truth) for s in found] == [4, 4, 2]
    monkeypatch.setattr(tuning_samples, "MOST_DISTANCES", 1)
    assert measuring.most_pictures() == 1
