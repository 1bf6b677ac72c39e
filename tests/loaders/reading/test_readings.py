"""Readings: numbers by name, from logs, tables and bags to the frames, with pictures and without."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from helpers.bags import BEGIN_NS, Ros, Said, write_ros2
from maurice_loaders import InputError, SessionWriter, open_session
from maurice_loaders.doctor.inspection import inspect_recording
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.reading.recording import Readings
from maurice_mcl.values.session import Frame, SessionInfo

GRAY = np.full((4, 6, 3), 90, np.uint8)


def a_log(path: Path, *, pictures: bool) -> Path:
    with SessionWriter(path, SessionInfo(name="floor")) as log:
        for step in range(4):
            log.odometry(step, (0.1, 0.0, 0.0))
            log.truth(step, (0.1 * step, 0.0, 0.0))
            log.reading(step, {"left": step / 10, "right": 1 - step / 10})
            if pictures and step % 2:
                log.image(step, GRAY)
    return path


def test_a_frame_has_no_readings_by_default_and_none_can_be_put_in() -> None:
    frame, other = (Frame(1, 0.0, np.zeros((0, 3)), GRAY, "") for _ in range(2))
    assert dict(frame.readings) == {}
    assert frame.readings is not other.readings  # nothing is shared
    with pytest.raises(FrozenInstanceError):
        frame.readings = {}  # type: ignore[misc]


@pytest.mark.parametrize("aligned", [False, True])
def test_a_frame_holds_the_newest_of_each_name(tmp_path: Path, aligned: bool) -> None:
    log = a_log(tmp_path / "session.log", pictures=True)
    session = open_session(log, min_distance_m=1e-6 if aligned else 0.0)
    found = [dict(moment.frame.readings) for moment in session.moments()]
    assert found == [{"left": 0.1, "right": 0.9}, {"left": 0.3, "right": 0.7}]


def test_a_drive_without_pictures_has_a_frame_a_row(tmp_path: Path) -> None:
    moments = list(open_session(a_log(tmp_path / "session.log", pictures=False)).moments())
    assert [moment.frame.readings["left"] for moment in moments] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert [len(moment.frame.motions) for moment in moments] == [1, 1, 1, 1]
    assert moments[3].truth is not None
    assert moments[3].truth[0] == pytest.approx(0.3)


def test_names_that_come_in_turn_make_one_frame_a_round(tmp_path: Path) -> None:
    with SessionWriter(tmp_path / "session.log", SessionInfo(name="floor")) as log:
        for step in range(6):
            log.reading(step / 10, {("left", "right")[step % 2]: float(step)})
    found = [dict(moment.frame.readings) for moment in open_session(tmp_path / "session.log").moments()]
    assert found == [{"left": 0.0}, {"left": 2.0, "right": 1.0}, {"left": 4.0, "right": 3.0}]


@pytest.mark.parametrize("value", ['{"left": "dark"}', '{"left": 1e10}', "[1, 2]", '{"left": NaN}'])
def test_a_reading_that_is_no_number_is_refused_with_its_line(tmp_path: Path, value: str) -> None:
    log = a_log(tmp_path / "session.log", pictures=True)
    log.write_text(log.read_text() + f'{{"t": 9, "reading": {value}}}\n')
    with pytest.raises(InputError, match=rf":{len(log.read_text().splitlines())}: "):
        list(open_session(log).moments())


def test_columns_of_a_table_are_readings(tmp_path: Path) -> None:
    table = tmp_path / "drive.csv"
    table.write_text(
        "time_s,odom_x_m,odom_y_m,odom_heading_rad,reading_left,ir\n0,0,0,0,0.8,7\n1,0.1,0,0,,9\n"
    )
    found = [dict(m.frame.readings) for m in open_session(table, columns={"reading.right": "ir"}).moments()]
    assert found == [{"left": 0.8, "right": 7.0}, {"right": 9.0}]
    assert inspect_recording(open_session(table)).records["reading"] == 1


def test_converting_keeps_readings_with_pictures_and_without(tmp_path: Path) -> None:
    import maurice_viz as mv

    for pictures in (False, True):
        log = a_log(tmp_path / f"{pictures}.log", pictures=pictures)
        target = mv.convert(log, tmp_path / f"to-{pictures}.log").file
        for one, other in zip(open_session(log).moments(), open_session(target).moments(), strict=True):
            assert dict(one.frame.readings) == dict(other.frame.readings)
        lines = [json.loads(line) for line in target.read_text().splitlines()[1:]]
        assert any("image" in line for line in lines) == pictures


def test_corrections_leave_readings_in(tmp_path: Path) -> None:
    log = a_log(tmp_path / "session.log", pictures=False)
    session = open_session(log, turn_scale=-1.0, picture_offset_s=0.001)
    assert [moment.frame.readings["right"] for moment in session.moments()] == [1.0, 0.9, 0.8, 0.7]
    assert sum(isinstance(one, Readings) for one in open_recording(log).records(session._notes)) == 4


def test_topics_of_numbers_are_readings_by_their_names_or_as_asked(tmp_path: Path) -> None:
    ros = Ros(2)
    said = [
        said
        for k, log_ns in enumerate(range(BEGIN_NS, BEGIN_NS + 3 * 10**9, 10**9))
        for said in (
            Said("/odom", "nav_msgs/Odometry", log_ns, ros.odometry(log_ns, (0.1 * k, 0.0, 0.0))),
            Said("/ir/left", "std_msgs/Float32", log_ns, ros.new("std_msgs/Float32", data=float(k))),
            Said("/count", "std_msgs/Int32", log_ns, ros.new("std_msgs/Int32", data=7)),
        )
    ]
    bag = write_ros2(tmp_path / "drive", said)
    found = [dict(moment.frame.readings) for moment in open_session(bag).moments()]
    assert [one["ir/left"] for one in found] == [0.0, 1.0, 2.0]
    assert found[-1]["count"] == 7
    asked = open_session(bag, readings="left=/ir/left").moments()
    assert [dict(moment.frame.readings) for moment in asked] == [{"left": 0.0}, {"left": 1.0}, {"left": 2.0}]
    with pytest.raises(InputError, match="found no topic /ir/right"):
        open_session(bag, readings="/ir/right")
