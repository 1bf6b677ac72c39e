from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.calibration import floor_between, mishaps, trials_from_session
from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.map import Arena, Region
from maurice_mcl.session import SessionInfo

WOOD = Region("wood", np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]]))
CARPET = Region("carpet", np.array([[2.0, 0], [4, 0], [4, 4], [2, 4]]))
ARENA = Arena((0, 0, 4, 4), np.zeros((0, 4)), floors=(WOOD, CARPET))


def written(folder: Path, *records: tuple[float, str, tuple[float, float, float] | str]) -> Path:
    path = folder / "session.log"
    with SessionWriter(path, SessionInfo("drive", arena=ARENA)) as log:
        for t_s, kind, value in records:
            getattr(log, kind)(t_s, value if isinstance(value, str) else list(value))
    return path


def test_the_first_truth_after_each_movement_counts(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        (0.0, "truth", (1, 1, 0)),
        (1.0, "odometry", (0, 0, 1.4)),
        (1.0, "truth", (1, 1, 1.0)),
        (1.5, "truth", (1.1, 1.2, 1.0)),  # already on the next way
        (2.0, "odometry", (0.5, 0, 0)),
        (2.0, "truth", (1, 1.5, 1.1)),
    )
    trials = trials_from_session(path)
    assert trials.turns.actual_rad == pytest.approx([1.0])
    assert trials.straights.actual_m == pytest.approx([0.5])
    assert trials.straights.drift_rad == pytest.approx([0.1])
    assert trials.straights.floors == ("wood",)


def test_nothing_is_joined_across_a_kidnapping(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        (0.0, "truth", (1, 1, 0)),
        (1.0, "odometry", (0, 0, 1.4)),
        (1.1, "event", "kidnapped"),
        (1.2, "truth", (3, 3, 2.0)),
        (2.0, "odometry", (0.5, 0, 0)),
        (2.0, "truth", (3.5, 3, 0.1)),
    )
    trials = trials_from_session(path)
    assert len(trials.turns.actual_rad) == 0
    assert trials.straights.floors == ("carpet",)


def test_arcs_are_left_out_and_counted(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        (0.0, "truth", (1, 1, 0)),
        (1.0, "odometry", (0.3, 0.1, 0.7)),
        (1.0, "truth", (1.3, 1.1, 0.7)),
        (2.0, "odometry", (0.5, 0, 0.02)),
        (2.0, "truth", (1.68, 1.42, 0.72)),
    )
    trials = trials_from_session(path)
    assert trials.left_out == 1
    assert len(trials.straights.actual_m) == 1
    assert len(trials.turns.measured_rad) == 0


def test_what_is_nearly_a_turn_is_one_and_what_is_nearly_straight_drifted(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        (0.0, "truth", (1, 1, 0)),
        (1.0, "odometry", (0.02, 0.0, 1.2)),
        (1.0, "truth", (1.02, 1, 0.9)),
        (2.0, "odometry", (0.5, 0.01, 0.05)),
        (2.0, "truth", (1.02, 1.5, 1.03)),
    )
    trials = trials_from_session(path)
    assert trials.turns.measured_rad == pytest.approx([1.2])
    assert trials.turns.actual_rad == pytest.approx([0.9])
    assert trials.straights.actual_m == pytest.approx([0.5])
    assert trials.straights.drift_rad == pytest.approx([0.13 - 0.05])


def test_slips_and_bumps_are_counted(tmp_path: Path) -> None:
    told = ("floor wood", "slip +18.3 deg", "bump", "slip -20.1 deg", "slippers found")
    path = written(tmp_path, *((float(k), "event", text) for k, text in enumerate(told)))
    assert mishaps(path) == {"slip": 2, "bump": 1}


def test_floors_of_ways() -> None:
    def between(a: tuple[float, float], b: tuple[float, float], arena: Arena | None = ARENA) -> str | None:
        return floor_between(arena, np.array(a), np.array(b))

    assert between((1, 1), (1.5, 1)) == "wood"
    assert between((1, 1), (3, 1)) is None
    assert between((3, 1), (3, 3)) == "carpet"
    assert between((-2, -2), (-1, -1)) == ""
    assert between((1, 1), (3, 1), None) == ""


def test_no_truth_one_truth_and_a_survey_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, (1.0, "odometry", (0, 0, 1.4)))
    with pytest.raises(InputError, match="found no truth"):
        trials_from_session(path)
    path.unlink()
    with pytest.raises(InputError, match="found one truth"):
        trials_from_session(written(tmp_path, (0.0, "truth", (1, 1, 0)), (1.0, "odometry", (0, 0, 1.4))))
    with SessionWriter(tmp_path / "survey.log", SessionInfo("s"), "survey"):
        pass
    with pytest.raises(InputError, match="found a survey log"):
        trials_from_session(tmp_path / "survey.log")
