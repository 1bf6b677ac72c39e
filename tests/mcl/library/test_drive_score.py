"""Pictures of a drive against a library: what they add at their true poses, and by how much they mislead."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.examples import picture_at
from maurice_mcl.library.drive_score import (
    LEAST_PICTURES,
    MOST_PICTURES,
    MUTED,
    DrivePicture,
    score_drive,
    stays,
)

RIGHT_M = 0.1


def _pictures(sees, places=64, at_a_place=1):
    """Drive about the map, some pictures at each place, and see those of other poses."""
    rng = np.random.default_rng(8)
    xy = rng.uniform((0.3, 0.8), (0.9, 1.3), (places, 2))
    poses = np.column_stack([xy, rng.uniform(-3, 3, places)])
    poses = np.repeat(poses, at_a_place, axis=0)
    return [DrivePicture(lambda pose=pose: picture_at(sees(pose)), pose) for pose in poses]


def _sensor(sharpness=1.0):
    settings = {"sensor.widening": 1.0, "sensor.sharpness": sharpness}
    return mcl.make_localizer(mcl.tiny_library(), settings=settings).sensor


def test_pictures_that_fit_their_places_are_left_alone_by_some_of_them():
    found = score_drive(_sensor(), _pictures(lambda pose: pose), RIGHT_M)
    assert LEAST_PICTURES <= found.pictures < 64
    assert found.gain > 0.2
    assert (found.widening, found.tells) == (1, True)


def test_scales_that_are_too_sharp_are_widened_until_the_pictures_help():
    pictures = _pictures(lambda pose: pose)
    found = score_drive(_sensor(3.0), pictures, RIGHT_M)
    assert found.widening > 2
    assert found.tells  # they tell the place, and are too sure near it
    assert found.pictures == MOST_PICTURES
    assert found.gain < 0
    again = score_drive(_sensor(3.0 / found.widening), pictures, RIGHT_M)
    assert again.gain > 0


def test_pictures_at_one_place_count_as_one_however_many_are_compared():
    four, eight = (
        score_drive(_sensor(3.0), _pictures(lambda pose: pose, at_a_place=k), RIGHT_M) for k in (4, 8)
    )
    assert four.pictures == eight.pictures == MOST_PICTURES
    assert eight.widening == pytest.approx(2 * four.widening, rel=0.13)  # the factors are a ninth apart


def _path():
    """The library's references along one line, all of one heading."""
    library = mcl.tiny_library()
    kept = (library.poses[:, 2] == 0) & (np.abs(library.poses[:, 1] - 0.75) < 0.01)
    index = {
        name: replace(channel, references=channel.references[kept]) for name, channel in library.index.items()
    }
    return replace(library, poses=library.poses[kept], pictures=(None,) * int(kept.sum()), index=index)


def test_a_path_of_references_that_tells_nothing_nearby_and_much_farther_out_is_left_alone():
    poses = np.array([[x, 0.75, 0.0] for x in np.repeat([0.25, 0.75, 1.25, 1.75], 8)])
    pictures = [DrivePicture(lambda pose=pose: picture_at(pose), pose) for pose in poses]
    settings = {"sensor.widening": 1.0, "references.method": "nearest"}
    found = score_drive(mcl.make_localizer(_path(), settings=settings).sensor, pictures, 0.01)
    assert found.gain < 0.05 < found.far_gain
    assert (found.widening, found.tells) == (1, True)


def test_pictures_of_other_places_tell_nothing_however_wide_the_scales_are():
    found = score_drive(_sensor(), _pictures(lambda pose: pose + np.array([0.3, -0.2, 0.8])), RIGHT_M)
    assert found.gain < 0
    assert (found.widening, found.tells) == (MUTED, False)
    assert json.loads(json.dumps(found.to_json()))["is_bad"] is True


def test_a_camera_that_shows_the_same_everywhere_adds_nothing():
    poses = [np.array([x, y, 0.5 * k]) for k in range(4) for x in (0.3, 0.8, 1.2, 1.7) for y in (0.3, 1.2)]
    pictures = [DrivePicture(lambda: picture_at(np.array([1.0, 0.75, 0.0])), pose) for pose in poses]
    found = score_drive(_sensor(), pictures, RIGHT_M)
    assert found.gain < 0.05
    assert not found.tells


def test_few_pictures_conclude_nothing_and_pictures_that_cannot_be_read_do_not_count():
    wrong = _pictures(lambda pose: pose + np.array([0.3, -0.2, 0.8]))
    few = score_drive(_sensor(), wrong[:12], RIGHT_M)
    assert (few.concludes, few.widening, few.tells) == (False, 1, True)
    broken = [DrivePicture(lambda: None, one.truth) for one in wrong]
    found = score_drive(_sensor(), broken, RIGHT_M)
    assert (found.pictures, found.concludes, found.to_json()["gain"]) == (0, False, None)


def test_a_truth_outside_of_free_space_does_not_count():
    outside = [DrivePicture(lambda: picture_at(np.zeros(3)), np.array([50.0, 50.0, 0.0]))]
    assert score_drive(_sensor(), outside, RIGHT_M).pictures == 0


def test_a_stay_ends_a_radius_away_or_turned():
    poses = np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0, 0.5], [0.3, 0, 3.1], [0.3, 0, -3.1], [5, 0, -3.1]])
    assert stays(poses, 0.4) == [range(2), range(2, 3), range(3, 5), range(5, 6)]
    assert stays(np.empty((0, 3)), 0.4) == []
