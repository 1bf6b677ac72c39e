from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.calibration import (
    AlignedDrive,
    Cutting,
    cut,
    read_aligned,
    trials_from_folder,
)
from maurice_loaders.errors import InputError
from maurice_mcl.arrays import F64
from maurice_mcl.calibration.motion import calibrate

ROOT = Path(__file__).parents[3]
THYMIO = (ROOT / os.environ.get("MAURICE_DATA", "../shared/data")).resolve() / "thymio"


def poses(steps: list[tuple[float, float]], scale: float = 1.0, gain: float = 1.0) -> F64:
    """Drive (way, turn) steps."""
    rows = [np.zeros(3)]
    for way, turn in steps:
        x, y, heading = rows[-1]
        moved = scale * way * np.array([np.cos(heading), np.sin(heading)])
        rows.append(np.array([x + moved[0], y + moved[1], heading + gain * turn]))
    return np.array(rows)


LEGS = [(20, 0.01, 0.0), (30, 0.0, 0.05), (5, 0.0, 0.0), (10, -0.01, 0.0), (30, 0.01, 0.0), (2, 0.0, -0.05)]
STEPS = [(way, turn) for count, way, turn in [*LEGS, (6, 0.01, 0.0)] for _ in range(count)]


def test_a_drive_is_cut_where_it_turns_and_where_it_goes_back() -> None:
    trials = cut(AlignedDrive(poses(STEPS), poses(STEPS, 0.9, 1.1)), Cutting())
    assert trials.turns.measured_rad == pytest.approx([1.5])
    assert trials.turns.actual_rad == pytest.approx([1.65])
    assert trials.straights.measured_m == pytest.approx([0.2, 0.1, 0.3, 0.06])
    assert trials.straights.actual_m == pytest.approx([0.18, 0.09, 0.27, 0.054])
    assert trials.straights.drift_rad == pytest.approx([0, 0, 0, 0], abs=1e-12)
    assert trials.left_out == 1  # the turn of 6 degrees


def test_a_movement_in_which_the_truth_jumps_and_arcs_are_left_out() -> None:
    truth = poses(STEPS)
    truth[10:, 0] += 0.5
    trials = cut(AlignedDrive(poses(STEPS), truth), Cutting())
    assert trials.straights.measured_m == pytest.approx([0.1, 0.3, 0.06])
    assert trials.left_out == 2
    steps = [(0.01, 0.02)] * 30
    trials = cut(AlignedDrive(poses(steps), poses(steps)), Cutting())
    assert len(trials.straights.measured_m) == 0
    assert trials.left_out == 1


def write(folder: Path, **changed: str) -> Path:
    rows = poses(STEPS)
    np.savetxt(folder / "gt.txt", rows)
    np.savetxt(folder / "odom_pose.txt", rows[:, :2])
    half = rows[:, 2] / 2
    np.savetxt(folder / "odom_quaternion.txt", np.column_stack([np.sin(half), np.cos(half)]))
    for name, text in changed.items():
        (folder / f"{name}.txt").write_text(text)
    return folder


def test_the_three_files_are_read_with_headings_that_do_not_wrap(tmp_path: Path) -> None:
    drive = read_aligned(write(tmp_path))
    assert drive.odometry == pytest.approx(poses(STEPS))
    assert drive.truth == pytest.approx(poses(STEPS))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"gt": "0 0 0\n0 0 nan\n"}, r"gt\.txt:2: found '0 0 nan', expected 3 finite numbers"),
        ({"gt": "0 0 0\n"}, "rows of different number"),
        ({"odom_pose": "0 0 0\n"}, "expected 2 finite numbers"),
        ({"gt": "0 0 0\n", "odom_pose": "0 0\n", "odom_quaternion": "0 1\n"}, "expected a drive"),
        ({"gt": "1e300 0 0\n"}, "up to 1e9"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, changed: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_aligned(write(tmp_path, **changed))


@pytest.mark.skipif(not THYMIO.is_dir(), reason="the thymio drives are not here; MAURICE_DATA says where")
def test_a_real_robot_under_reads_turns_and_over_reads_ways() -> None:
    fit = calibrate(trials_from_folder(THYMIO / "random_long"))
    assert (fit.turns.count, fit.straights.count, fit.left_out) == (23, 20, 9)
    assert fit.turns.gain.value == pytest.approx(1.042, abs=0.002)
    assert fit.straights.scale.value == pytest.approx(0.961, abs=0.001)
    assert fit.turns.uneven
    assert fit.turns.gain.low > 1 > fit.straights.scale.high
