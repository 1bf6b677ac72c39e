"""What odometry alone would have had, and whether a sensor made it worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from helpers.filter_world import FilterDrive, make_world
from maurice_mcl.examples import picture_at
from maurice_mcl.scoring.comparison import odometry_alone
from maurice_mcl.scoring.table import TableRows
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.session import Frame, Moment, SessionInfo

SHARP = {"sensor.widening": 30.0, "sensor.sharpness": 30.0}  # our scales, whatever the references say


def _result(localizer, drive):
    localizer = localizer.of_session(drive)
    rows = TableRows(start=drive.info.start, localizer=localizer)
    for moment, record in mcl.run(localizer, drive):
        rows.add(moment, record)
    return odometry_alone(rows.table(), localizer)


@pytest.mark.parametrize("at_m", [(0.0, 0.0), (500_000.0, 4_000_000.0)])
def test_exact_odometry_is_never_off_wherever_the_map_lies(at_m):
    world = make_world(at_m, updates=30, motion={"model": "odometry"})
    alone = _result(mcl.make_localizer(world.library, particles=50), world.drive)
    assert max(alone.error_mean_m, alone.error_final_m) < 1e-4
    assert alone.against.updates == 27  # errors count from the fourth update on


def test_the_systematic_part_of_a_motion_model_is_corrected():
    """A skid-steer robot that turns less than its wheels say: the model's gain is part of its odometry."""
    world = make_world(updates=30, motion={"model": "maurice", "turn_gain": 0.5, "turn_bias_rad": 0.0})
    halved = []
    pose = world.start
    for moment in world.drive.all_moments:
        for forward, left, turn in moment.frame.motions:
            straight_bias_m = -0.6978 * 0.0254 if forward else 0.0
            pose = compose(pose, np.array([0.0, 0.0, turn / 2]))
            pose = compose(pose, np.array([forward + straight_bias_m, left, 0.0]))
        halved.append(replace(moment, truth=pose))
    alone = _result(
        mcl.make_localizer(world.library, particles=50), FilterDrive(world.drive.info, tuple(halved))
    )
    assert alone.error_mean_m < 1e-4


def _circling(library, sees):
    """Drive in a circle with exact odometry, and see the picture of a pose."""
    pose, moments = np.array([0.4, 0.9, 0.2]), []
    for step in range(1, 41):
        motion = np.array([0.05, 0.0, 0.2])
        pose = compose(pose, motion)
        moments.append(Moment(Frame(step, float(step), motion[None], picture_at(sees(pose)), ""), pose))
    info = SessionInfo("circle", start=np.array([0.4, 0.9, 0.2]), arena=library.arena)
    return FilterDrive(info, tuple(moments))


def test_a_camera_that_misleads_is_told_and_one_that_helps_is_not():
    library = mcl.tiny_library()
    localizer = mcl.make_localizer(library, particles=300, settings=SHARP)
    misled = _result(localizer, _circling(library, lambda pose: pose + np.array([0.8, 0.3, 2.5])))
    assert misled.is_better
    assert misled.sensors == "camera"
    drive = _circling(library, lambda pose: pose)
    biased = [replace(m, frame=replace(m.frame, motions=m.frame.motions * 1.2)) for m in drive.all_moments]
    assert not _result(localizer, FilterDrive(drive.info, tuple(biased))).is_better


def test_nothing_is_said_without_a_start_or_truth():
    localizer = mcl.make_localizer(mcl.tiny_library(), particles=20)
    drive = _circling(localizer.library, lambda pose: pose)
    unknown = FilterDrive(drive.info, tuple(replace(m, truth=None) for m in drive.all_moments))
    assert _result(localizer, unknown) is None
    nowhere = replace(drive.info, start=None)
    assert _result(localizer, FilterDrive(nowhere, drive.all_moments)) is None
