"""Folders of aligned rows as others write them: times, heights, commas, names, units, gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.odometry_folder import looks_like_odometry_folder, open_odometry_folder
from maurice_loaders.recording import Readings, TruthPose
from maurice_mcl.arrays import F64

ROWS = 120
WAY = np.linspace(0, 6, ROWS)
TRUE: F64 = np.column_stack([0.7 + 0.3 * np.cos(WAY), 0.7 + 0.3 * np.sin(WAY), WAY + np.pi / 2])
WHEELS: F64 = TRUE - [0.7, 0.7, 0]
HALF: F64 = np.column_stack([np.sin(WHEELS[:, 2] / 2), np.cos(WHEELS[:, 2] / 2)])
LEFT: F64 = np.where(np.sin(9 * WAY) > 0, 800.0, 150.0)
TIMES: F64 = np.arange(ROWS) * 0.25


def written(values: F64, header: str = "", sep: str = " ", comma: bool = False) -> str:
    lines = [sep.join(f"{v:.9g}" for v in np.atleast_1d(row)) for row in values]
    text = "\n".join([*([header] if header else []), *lines])
    return text.replace(".", ",") if comma else text


def folder(path: Path, **changed: str | None) -> Path:
    texts: dict[str, str | None] = {
        "gt": written(TRUE),
        "odom_pose": written(WHEELS[:, :2]),
        "odom_quaternion": written(HALF),
        "sensor_left": written(LEFT),
        **changed,
    }
    for name, text in texts.items():
        if text is not None:
            (path / f"{name}.txt").write_text(text)
    return path


PLACES, NONE = WHEELS[:, :2], np.zeros((ROWS, 1))
EPOCH = 1.5e12 + 1000 * TIMES[:, None]


TIMED: list[dict[str, str]] = [
    {"gt": written(np.hstack([TIMES[:, None], TRUE]))},
    {"gt": "\n".join(f"{t[0]:.0f} {written(row[None])}" for t, row in zip(EPOCH, TRUE, strict=True))},
    {"odom_pose": written(np.hstack([TIMES[:, None] + 7, PLACES])), "sensor_left": written(LEFT, "left")},
    {"odom_quaternion": written(np.hstack([TIMES[:, None], NONE, NONE, HALF]))},
]
UNTIMED: list[dict[str, str]] = [
    {"gt": written(TRUE, "x,y,theta", ","), "odom_pose": written(PLACES, "# x y", "\t")},
    {"gt": written(TRUE, sep=";", comma=True), "odom_quaternion": written(HALF, "z;w", "; ")},
    {"odom_pose": written(np.hstack([PLACES, NONE]))},
    {"odom_quaternion": written(np.hstack([NONE, NONE, HALF]))},
    {"gt": written(TRUE * [1000, 1000, 1])},
    {"odom_pose": written(100 * PLACES)},
    {"gt": written(np.column_stack([TRUE[:, :2], np.degrees(TRUE[:, 2])]))},
    {"gt": written(TRUE) + "\n0 0 0"},
]


@pytest.mark.parametrize("changed", [*TIMED, *UNTIMED])
def test_other_ways_to_write_the_same_drive(changed: dict[str, str], tmp_path: Path) -> None:
    found = open_odometry_folder(folder(tmp_path, **changed))
    assert found.truth is not None
    assert found.truth == pytest.approx(TRUE, abs=1e-6)
    assert found.odometry[:, :2] == pytest.approx(PLACES, abs=1e-6)
    assert np.cos(found.odometry[:, 2]) == pytest.approx(np.cos(WHEELS[:, 2]), abs=1e-6)
    assert found.readings["left"] == pytest.approx(LEFT)
    assert (found.times is not None) == (changed in TIMED)
    assert found.times is None or found.times == pytest.approx(TIMES)


def test_what_was_taken_otherwise_is_told(tmp_path: Path) -> None:
    found = open_odometry_folder(folder(tmp_path, gt=written(TRUE * [1000, 1000, 57.3])))
    said = "; ".join(found.doubts)
    assert "gt.txt go 1e+03 times as far as in odom_pose.txt: taken as millimeters" in said
    assert "taken as degrees" in said
    assert "3 rows a second" in said


def test_gaps_in_truth_and_readings_are_rows_without_them(tmp_path: Path) -> None:
    truth, left = TRUE.copy(), LEFT.copy()
    truth[5], left[7:9] = np.nan, np.nan
    found = open_odometry_folder(folder(tmp_path, gt=written(truth), sensor_left=written(left)))
    records = list(found.records(ReadingNotes(keep_going=False)))
    assert sum(isinstance(one, TruthPose) for one in records) == ROWS - 1
    assert sum(isinstance(one, Readings) for one in records) == ROWS - 2


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"sensor_left": written(LEFT[:-40])}, "rows of different number"),
        ({"sensor_left": written(LEFT[:5]) + "\nnone"}, r"sensor_left\.txt:6: found 'none'"),
        ({"gt": written(np.hstack([TRUE, TRUE]))}, r"gt\.txt:1: .* expected 3 numbers"),
        ({"gt": ""}, "found no rows, expected a drive"),
        ({"odom_pose": written(PLACES) + "\ninf 0"}, "expected 2 finite numbers"),
        ({"odom_quaternion": None}, r"found no odom_quaternion\.txt"),
    ],
)
def test_what_cannot_be_read_is_one_line(changed: dict[str, str | None], said: str, tmp_path: Path) -> None:
    made = folder(tmp_path, **changed)
    assert looks_like_odometry_folder(made)
    with pytest.raises(InputError, match=said):
        open_odometry_folder(made)
