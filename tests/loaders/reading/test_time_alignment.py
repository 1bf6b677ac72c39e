"""Units of time stamps, and how far two clocks are apart by the movement: found, never guessed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from helpers.recordings import read
from helpers.thymio import THYMIO, read_aligned
from maurice_loaders.reading.time_alignment import (
    TimeSpan,
    apart,
    detect_unit,
    offset_between,
    seconds,
)
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose


@pytest.mark.parametrize(
    ("stamps", "unit"),
    [
        (["1403636601113555456", "1403636621163555584"], "ns"),
        (["1560004885.446172", "1560004885.479529"], "s"),
        (["1560004885446", "1560004885479"], "ms"),
        (["1560004885446172", "1560004885479529"], "us"),
        (["81605000000", "81625000000", "81640000000"], "ns"),  # since the start of the sensor
        (["0.000000e+00", "1.036224e-01"], "s"),
        (["0", "1", "2", "3"], "s"),
        (["0", "100", "200"], "ms"),
        (["0", "33333", "66666"], "us"),
        (["0", "33333333", "66666666"], "ns"),
        (["0.0", "60.5", "120.25"], "s"),  # a picture a minute
        (["7"], "s"),
    ],
)
def test_the_unit_is_told(stamps: list[str], unit: str) -> None:
    assert detect_unit(stamps) == unit


def test_nanoseconds_keep_what_a_float_can_hold_and_spans_meet_or_do_not() -> None:
    assert seconds("1403636601113555456", "ns") == 1403636601.113555456
    assert seconds("1.5e3", "ms") == 1.5
    one, other = TimeSpan(), TimeSpan()
    for t_s in (10.0, 12.0):
        one.add(t_s)
    for t_s in (12.5, 14.0):
        other.add(t_s)
    assert not one.overlaps(other)
    assert one.overlaps(other, 1.0)
    assert apart("pictures", one, "truth", other).endswith("their beginnings are -2.500 s apart")


def drive(seconds: int, seed: int = 0) -> tuple[F64, F64]:
    """A drive at 10 Hz that goes and turns by chance, for some seconds each."""
    chance = np.random.default_rng(seed)
    speed, turn = (np.repeat(chance.uniform(-1, 1, seconds // 3 + 1), 30)[: 10 * seconds] for _ in range(2))
    poses = [np.zeros(3)]
    for v, w in zip(speed, turn, strict=True):
        poses.append(compose(poses[-1], np.array([0.05 * max(v, 0), 0, 0.1 * w])))
    return np.arange(len(poses)) / 10, np.array(poses)


@pytest.mark.parametrize("seed", range(5))
def test_a_part_of_the_drive_in_another_frame_and_clock_is_found(seed: int) -> None:
    t_s, poses = drive(120, seed)
    chance = np.random.default_rng(seed)
    truth = np.array([compose(np.array([9.0, -3, 2.5]), pose) for pose in poses[300:900]])
    truth += chance.normal(0, [0.003, 0.003, 0.01], truth.shape)
    found = offset_between(t_s + 1.7e9, poses, t_s[300:900] - 50, truth)
    assert found is not None
    assert found.offset_s == pytest.approx(1.7e9 + 50, abs=0.15)
    assert found.correlation > 0.8


def test_another_drive_a_robot_that_stands_and_one_that_repeats_itself_tell_nothing() -> None:
    t_s, poses = drive(120)
    other_t_s, other = drive(120, 1)
    assert offset_between(t_s, poses, other_t_s, other) is None
    assert offset_between(t_s, poses, t_s, poses * 0) is None
    assert offset_between(t_s, poses, t_s[:1], poses[:1]) is None
    turn = np.sin(np.arange(1200) / 5.0)  # to and fro, always the same
    again = np.column_stack([0 * turn, 0 * turn, turn])
    assert offset_between(np.arange(1200) / 10, again, np.arange(600) / 10, again[300:900]) is None


@pytest.mark.skipif(not THYMIO.is_dir(), reason="needs the recorded odometry of the thymio")
def test_real_odometry_and_motion_capture() -> None:
    rows = read_aligned(THYMIO / "random_1")
    t_s = np.arange(len(rows.truth)) / 3.0
    found = offset_between(t_s + 1000, rows.odometry, t_s - 77, rows.truth)
    assert found is not None
    assert found.offset_s == pytest.approx(1077, abs=0.2)


def test_the_offset_that_is_said_brings_truth_back(tmp_path: Path) -> None:
    """Truth of the middle of the drive by a clock of its own: their beginnings say nothing."""
    t_s, poses = drive(60)
    (tmp_path / "rgb.txt").write_text("\n".join(f"{t + 1e9:.3f} {k}.png" for k, t in enumerate(t_s[::10])))

    def write(name: str, times: F64, rows: F64) -> None:
        half = rows[:, 2] / 2
        lines = [
            f"{t:.3f} {x} {y} 0 0 0 {math.sin(h)} {math.cos(h)}"
            for t, (x, y, _), h in zip(times, rows, half, strict=True)
        ]
        (tmp_path / name).write_text("\n".join(lines))

    write("odometry.txt", t_s + 1e9, poses)
    write("groundtruth.txt", t_s[200:500], poses[200:500])
    (said,) = read(tmp_path)[1]
    assert "movement is most like the odometry's" in said
    assert float(said.rsplit("truth_offset_s=", 1)[1]) == pytest.approx(1e9, abs=0.15)
    write("groundtruth.txt", t_s[200:500], poses[200:500] * 0)
    assert "--reading truth_offset_s=" in read(tmp_path)[1][0]
