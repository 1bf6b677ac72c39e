"""Odometry whose poses never move is what its speeds add up to; one that moves is left alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from helpers import bags as making
from helpers.bags import BEGIN_NS, Ros, Said
from maurice_loaders.errors import ReadingNotes
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose
from maurice_mcl.values import F64

RADIUS_M, SPEED_M_S, STEPS = 2.0, 0.5, 101  # a circle for 10 s


def bag(path: Path, pose_at: Callable[[float], tuple[float, float, float]], speed: float) -> Path:
    ros = Ros(2)
    said = []
    for number in range(STEPS):
        t_ns = BEGIN_NS + number * 10**8
        odometry = ros.odometry(t_ns, pose_at(0.1 * number), (speed, 0.0, speed / RADIUS_M))
        said.append(Said("/odom", "nav_msgs/Odometry", t_ns, odometry))
        said.append(Said("/scan", "sensor_msgs/LaserScan", t_ns + 1, ros.scan(t_ns, np.full(101, 2.0))))
    return making.write_ros2(path, said)


def poses(path: Path, **options: float) -> F64:
    records = open_recording(path, Reading(**options)).records(ReadingNotes(keep_going=True))  # type: ignore[arg-type]
    return np.array([record.pose for record in records if isinstance(record, OdometryPose)])


def test_speeds_are_added_up_where_poses_never_move(tmp_path: Path) -> None:
    still = bag(tmp_path / "still", lambda t_s: (0.0, 0.0, 0.0), SPEED_M_S)
    angles = np.arange(STEPS) * 0.1 * SPEED_M_S / RADIUS_M
    circle = np.column_stack([RADIUS_M * np.sin(angles), RADIUS_M * (1 - np.cos(angles)), angles])
    np.testing.assert_allclose(poses(still), circle, atol=1e-3)
    np.testing.assert_allclose(poses(still, odometry_offset_s=1.0), circle, atol=1e-3)
    session = open_session(still)
    assert any("its speeds do (up to 0.5 m/s or rad/s): they are added up" in n for n in session.info.notes)
    assert session.overview()[0] == pytest.approx(5.0 / 0.25, abs=6)  # a scan every 0.25 m or 11.5 degrees


@pytest.mark.parametrize(("moved_m", "speed"), [(0.1, SPEED_M_S), (0.0, 0.0)])
def test_poses_that_move_and_a_robot_that_stands_are_read_as_they_are(
    tmp_path: Path, moved_m: float, speed: float
) -> None:
    path = bag(tmp_path / "bag", lambda t_s: (moved_m * (t_s > 9.0), 0.0, 0.0), speed)
    assert poses(path)[-1] == pytest.approx([moved_m, 0.0, 0.0])
    assert not any("added up" in note for note in open_session(path).info.notes)
