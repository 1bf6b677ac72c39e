"""Pictures of a drive against a library: what they add at their true poses, and by how much they mislead."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.examples import picture_at
from maurice_mcl.library.quality import (
    MOST_GROUPS,
    PICTURES_A_GROUP,
    DrivePicture,
    score_drive,
    spread_groups,
)

RIGHT_M = 0.4


def _groups(sees, count=64):
    """Drive about the map, and see the pictures of other poses."""
    rng = np.random.default_rng(8)
    poses = np.column_stack(
        [rng.uniform(0.3, 0.9, count), rng.uniform(0.8, 1.3, count), rng.uniform(-3, 3, count)]
    )
    poses = np.repeat(poses[::PICTURES_A_GROUP], PICTURES_A_GROUP, axis=0)
    pictures = [DrivePicture(lambda pose=pose: picture_at(sees(pose)), pose) for pose in poses]
    return [pictures[k : k + PICTURES_A_GROUP] for k in range(0, count, PICTURES_A_GROUP)]


def _sensor(sharpness=1.0):
    settings = {"sensor.widening": 1.0, "sensor.sharpness": sharpness}
    return mcl.make_localizer(mcl.tiny_library(), settings=settings).sensor


def test_pictures_that_fit_their_places_are_left_alone_by_a_quarter_of_them():
    found = score_drive(_sensor(), _groups(lambda pose: pose), RIGHT_M)
    assert found.pictures == MOST_GROUPS
    assert found.gain > 0.3
    assert (found.widening, found.tells, found.is_bad) == (1, True, False)


def test_scales_that_are_too_sharp_are_widened_until_the_pictures_help():
    groups = _groups(lambda pose: pose)
    found = score_drive(_sensor(3.0), groups, RIGHT_M)
    assert found.widening > 1
    assert (found.tells, found.is_bad) == (True, False)  # they tell the place, and are too sure near it
    assert found.pictures == PICTURES_A_GROUP * MOST_GROUPS
    assert found.gain < 0 < found.far_gain
    again = score_drive(_sensor(3.0 / found.widening), groups, RIGHT_M)
    assert again.gain > 0


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
    groups = [pictures[k : k + PICTURES_A_GROUP] for k in range(0, len(pictures), PICTURES_A_GROUP)]
    settings = {"sensor.widening": 1.0, "references.method": "nearest"}
    found = score_drive(mcl.make_localizer(_path(), settings=settings).sensor, groups, 0.01)
    assert found.gain < 0.05 < found.far_gain
    assert (found.widening, found.tells, found.is_bad) == (1, True, False)


def test_pictures_of_other_places_tell_nothing_however_wide_the_scales_are():
    found = score_drive(_sensor(), _groups(lambda pose: pose + np.array([0.3, -0.2, 0.8])), RIGHT_M)
    assert found.gain < 0
    assert (found.widening, found.tells) == (100, False)
    assert json.loads(json.dumps(found.to_json()))["is_bad"] is True


def test_a_camera_that_shows_the_same_everywhere_adds_nothing():
    found = score_drive(_sensor(), _groups(lambda pose: np.array([0.5, 1.0, 0.0])), RIGHT_M)
    assert found.gain < 0.05
    assert found.is_bad


def test_few_pictures_conclude_nothing_and_pictures_that_cannot_be_read_do_not_count():
    wrong = _groups(lambda pose: pose + np.array([0.3, -0.2, 0.8]))
    assert not score_drive(_sensor(), wrong[:3], RIGHT_M).is_bad
    broken = [[DrivePicture(lambda: None, one.truth) for one in group] for group in wrong]
    found = score_drive(_sensor(), broken, RIGHT_M)
    assert (found.pictures, found.is_bad, found.to_json()["gain"]) == (0, False, None)


def test_a_truth_outside_of_free_space_does_not_count():
    outside = [[DrivePicture(lambda: picture_at(np.zeros(3)), np.array([50.0, 50.0, 0.0]))]]
    assert score_drive(_sensor(), outside, RIGHT_M).pictures == 0


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5, 63, 64, 65, 5000])
def test_groups_are_spread_over_the_drive_and_hold_only_its_pictures(count):
    groups = spread_groups(count)
    numbers = [number for group in groups for number in group]
    assert len(groups) <= MOST_GROUPS
    assert all(np.diff(group).tolist() == [1] * (len(group) - 1) for group in groups)
    assert set(numbers) <= set(range(count))
    assert not count or (numbers[0], numbers[-1]) == (0, count - 1)
