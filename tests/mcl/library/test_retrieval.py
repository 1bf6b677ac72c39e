"""Looking a drive's pictures up: ranks, curves and areas by hand, and what hurts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.filter_world import make_world
from maurice_mcl.library.drive_score import DrivePicture
from maurice_mcl.library.retrieval import Ranking, area_of, look_up, right_references, stretches_of
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values import ChannelIndex

RNG = np.random.default_rng(3)


def _ranking(ranks, distances):
    return Ranking(np.array(ranks, np.int32), np.array(distances, float))


def test_precision_over_recall_by_hand():
    """Surest first: right, wrong, right, wrong."""
    ranking = _ranking([3, 1, 9, 1], [0.2, 0.1, 0.4, 0.3])
    recall, precision = ranking.curve()
    assert recall.tolist() == [0.25, 0.25, 0.5, 0.5]
    assert precision.tolist() == pytest.approx([1, 1 / 2, 2 / 3, 2 / 4])
    assert area_of(ranking) == pytest.approx((1 + 2 / 3) / 4)
    assert [ranking.among(first).mean() for first in (1, 5, 10)] == [0.5, 0.75, 1]


def test_the_area_is_one_for_all_right_and_none_without_a_picture():
    assert area_of(_ranking([1, 1], [0.5, 0.1])) == 1
    assert area_of(_ranking([2, 2], [0.5, 0.1])) == 0
    assert np.isnan(area_of(_ranking([], [])))


def test_being_sure_where_it_is_right_is_worth_more():
    sure, unsure = _ranking([1, 1, 4, 4], [1, 2, 3, 4]), _ranking([1, 1, 4, 4], [3, 4, 1, 2])
    assert area_of(sure) == 0.5 > area_of(unsure)


def test_right_is_what_is_near_and_looks_the_same_way_and_the_nearest():
    poses = np.array([[0, 0, 0], [0.9, 0, 0], [0.1, 0, 1.0], [1.5, 0, 0], [5, 0, 0]], float)
    assert right_references(poses, np.array([0.2, 0, 0]), 1.0).tolist() == [True, True, False, False, False]
    assert right_references(poses, np.array([3.4, 0, 0]), 1.0).tolist() == [False, False, False, False, True]
    assert not right_references(poses, np.array([7.1, 0, 0]), 1.0).any()
    assert not right_references(poses, np.array([0.2, 0, np.pi]), 1.0).any()


def test_a_stretch_is_so_much_way_and_turn():
    line = np.column_stack([np.arange(20) * 0.5, np.zeros(20), np.zeros(20)])
    assert stretches_of(line, 1.0).tolist() == [k // 10 for k in range(20)]
    spin = np.column_stack([np.zeros(11), np.zeros(11), np.arange(11) * np.radians(45.01)])
    assert stretches_of(spin, 1.0).tolist() == [0] * 5 + [1] * 5 + [2]
    assert len(stretches_of(np.zeros((0, 3)), 1.0)) == 0
    assert set(stretches_of(np.zeros((4, 3)), 1.0)) == {0}, "who stands still takes one picture again"


@pytest.fixture(scope="module")
def drive():
    """A library whose color is its pictures', and whose edges are another library's."""
    library = make_world().library
    images = [RNG.integers(0, 256, (24, 32, 3), np.uint8) for _ in range(library.size)]
    index = {}
    for name, shift in (("color", 0), ("edges", library.size // 2)):
        rows = np.stack([CHANNELS[name].describe(image) for image in np.roll(images, shift, axis=0)])
        index[name] = ChannelIndex(rows, np.zeros(rows.shape[1], np.float32), rows.max(axis=0))
    pictures = [DrivePicture(lambda k=k: images[k], library.poses[k]) for k in range(0, library.size, 3)]
    return replace(library, index=index), pictures


def _sensor(library, weights):
    return SensorModel(library, nearest_reference(library.poses, library.arena), SensorParameters(weights))


def test_a_channel_that_is_right_finds_and_one_that_is_wrong_hurts(drive):
    library, pictures = drive
    found = look_up(_sensor(library, {"color": 0.02, "edges": 1.0}), pictures, 0.05)
    assert set(found.alone) == set(library.index)
    assert (found.alone["color"].rank == 1).all()
    assert (found.alone["edges"].rank > 1).mean() > 0.9
    assert (found.without["edges"].rank == 1).all()
    assert (found.together.rank > 1).any()
    assert found.pictures == len(found.stretch) == len(pictures)


def test_channels_that_are_not_used_are_ranked_and_do_not_count(drive):
    library, pictures = drive
    found = look_up(_sensor(library, {"color": 1.0}), pictures, 0.05)
    assert set(found.alone) == {"color", "edges"}
    assert np.array_equal(found.together.rank, found.alone["color"].rank)
    assert found.without == {}


def test_pictures_that_are_gone_and_those_off_the_library_have_no_rank(drive):
    library, pictures = drive
    away = DrivePicture(pictures[0].read, library.poses[0] + [99, 0, 0])
    gone = DrivePicture(lambda: None, library.poses[0])
    done = []
    sensor = _sensor(library, {"color": 1.0})
    found = look_up(sensor, [away, gone, pictures[1]], 0.05, progress=lambda *each: done.append(each))
    assert (found.pictures, len(found.together.rank), len(found.stretch)) == (3, 1, 1)
    assert done == [(1, 3), (2, 3), (3, 3)]
    nothing = look_up(sensor, [gone], 0.05)
    assert len(nothing.together.rank) == 0
