from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.camera_session import session_camera, survey_camera
from maurice_datasets.surveys import Surveyor, placed_poses, reference_poses, references
from maurice_mcl.values.geometry import INCH_M

NODES = np.array([[1.0, 2.0], [3.0, 4.0], [0.5, 0.25]])


def test_references_have_headings_and_errors():
    poses = reference_poses(NODES, 8)
    assert poses.shape == (24, 3)
    assert np.degrees(poses[:8, 2]) % 360 == pytest.approx([0, 45, 90, 135, 180, 225, 270, 315])
    assert (poses[:, 2] < np.pi).all()
    assert (poses[:, 2] >= -np.pi).all()
    assert (poses[8:16, :2] == NODES[1]).all()
    nominal = np.zeros((3000, 3))
    off = placed_poses(nominal, 4, Surveyor())
    sd = np.array([0.4 * INCH_M, 0.4 * INCH_M, np.radians(1.5)])
    assert (np.abs(off.mean(axis=0)) < 4 * sd / np.sqrt(3000)).all()
    assert (np.abs(off.std(axis=0) - sd) < 4 * sd / np.sqrt(6000)).all()
    assert np.array_equal(off, placed_poses(nominal, 4, Surveyor()))
    assert not np.array_equal(off, placed_poses(nominal, 5, Surveyor()))


def test_surveys_have_their_own_lights_and_poses(world):
    camera, surveyor = survey_camera(world, 0), Surveyor(headings=1)
    nodes = np.array([[1.2, 1.9], [1.65, 1.9]])
    made = list(references(reference_poses(nodes, 1), camera, surveyor))
    assert np.array_equal([pose for pose, _ in made], reference_poses(nodes, 1))
    actual = placed_poses(reference_poses(nodes, 1), 0, surveyor)
    assert np.array_equal(made[1][1], camera.take(1, actual[1]))
    camera = survey_camera(world, 0)
    assert not np.array_equal(camera.take_covered(0), camera.take_covered(1))
    survey, session = survey_camera(world, 0), session_camera(world, 0)
    assert survey.exposure != session.exposure
    pose = np.array([1.2, 1.9, 0.4])
    assert not np.array_equal(survey.take(1, pose), session.take(1, pose))
    assert np.array_equal(session.take(1, pose), session.take(1, pose))
    assert not np.array_equal(session.take(1, pose), session.take(2, pose))
