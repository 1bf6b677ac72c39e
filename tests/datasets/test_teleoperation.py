"""A robot that a person drives: what each command does to it, and that a saved drive is the drive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from maurice_datasets import simulation, surveys
from maurice_datasets.robot.drive import KIDNAP_M
from maurice_datasets.sessions import simulation_plan
from maurice_datasets.surveys import Surveyor
from maurice_datasets.teleoperation import TeleoperatedRobot
from maurice_datasets.worlds.world import World, clearance
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_mcl.values.geometry import INCH_M, wrap_angle
from maurice_mcl.values.session import Moment

AHEAD, BACK, LEFT = (None, 0.2), (None, -0.2), (0.5, 0.0)


@pytest.fixture(autouse=True)
def one_world(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "load_world", lambda name, seed, tier: world)
    monkeypatch.setattr(surveys, "_surveyor_of", lambda _: Surveyor(headings=1, covered=1))


@pytest.fixture
def robot() -> TeleoperatedRobot:
    return TeleoperatedRobot(simulation_plan("global", seed=3))


def silent(done: int, total: int, what: str) -> None:
    """Take progress."""


def gone(before: np.ndarray, after: Moment) -> tuple[float, float]:
    """Return way ahead and turn between two poses."""
    moved = after.truth - before
    ahead = moved[0] * np.cos(before[2]) + moved[1] * np.sin(before[2])
    return float(ahead), wrap_angle(float(moved[2]))


def test_it_does_what_it_is_told_and_measures_it(robot: TeleoperatedRobot) -> None:
    first = robot.look()
    assert first.frame.motions.shape == (0, 3)
    before = robot.pose
    moment = robot.drive(LEFT)
    assert robot.behavior == "teleoperation"
    assert moment.frame.motions.sum(axis=0) == pytest.approx([0, 0, 0.5 * 1.3695])
    assert gone(before, moment) == pytest.approx((0, 0.5), abs=0.35)
    for command in (AHEAD, BACK):
        before = robot.pose
        moment = robot.drive(command)
        assert moment.frame.motions.sum(axis=0) == pytest.approx([command[1], 0, 0])
        ahead, turned = gone(before, moment)
        assert np.sign(command[1]) * ahead == pytest.approx(0.2 - 0.7 * INCH_M, abs=0.08)
        assert abs(turned) < 0.1  # no turn was told: only the floor's drift
    assert [moment.frame.step for moment in robot.moments()] == [1, 2, 3, 4]


def test_without_a_command_its_behaviors_drive_it_and_it_hits_nothing(robot: TeleoperatedRobot) -> None:
    winners = set()
    for _ in range(12):
        robot.drive()
        winners.add(robot.behavior)
        assert clearance(robot.set_up.world.arena, robot.pose[None, :2])[0] > 0.1
    assert "wandering" in winners
    assert winners <= {"wandering", "collision avoidance"}


def test_carried_and_bumped_it_measures_nothing(robot: TeleoperatedRobot) -> None:
    robot.look()
    before = robot.pose
    carried = robot.carry()
    assert carried.kidnapped
    assert np.hypot(*(carried.truth - before)[:2]) >= KIDNAP_M
    bumped = robot.bump()
    assert bumped.told("bump")
    turned = wrap_angle(float(bumped.truth[2] - carried.truth[2]))
    assert bumped.told("slip") == (f"slip {np.degrees(turned):+.1f} deg",)
    assert abs(turned) > 3 * robot._robot.chassis.turn_sd_rad
    assert not bumped.kidnapped
    assert len(carried.frame.motions) == len(bumped.frame.motions) == 0


def test_the_light_changes_from_key_to_key_and_is_told(robot: TeleoperatedRobot) -> None:
    usual = robot.look()
    dim, off, on = (robot.change_light() for _ in range(3))
    assert [moment.told("lights") for moment in (dim, off, on)] == [
        ("lights dim to 60%",),
        ("lights off west room lamp",),
        ("lights on",),
    ]
    light, less = (float(moment.frame.image.mean()) for moment in (usual, dim))
    assert less < 0.9 * light
    assert float(on.frame.image.mean()) == pytest.approx(light, rel=0.03)


def test_a_saved_drive_is_the_drive(robot: TeleoperatedRobot, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no picture to save"):
        robot.save(tmp_path / "drive", progress=silent)
    robot.look()
    for command in (AHEAD, LEFT, BACK):
        robot.drive(command)
    robot.carry()
    robot.bump()
    robot.change_light()
    robot.drive(None)
    paths = robot.save(tmp_path / "drive", progress=silent)
    with pytest.raises(InputError, match="--force"):
        robot.save(tmp_path / "drive", progress=silent)
    saved = list(open_session(paths.session).moments())
    assert len(saved) == 8
    for read, made in zip(saved, robot.moments(), strict=True):
        assert np.array_equal(read.frame.image, made.frame.image)
        assert np.array_equal(read.frame.motions, made.frame.motions)
        assert read.truth == pytest.approx(made.truth)
        assert [text for text in read.events if "floor" not in text] == [
            text for text in made.events if "floor" not in text
        ]
    robot.look()
    again = robot.save(tmp_path / "drive", force=True, progress=silent)
    assert sum(1 for _ in open_session(again.session).moments()) == 9


def test_a_laser_sees_no_light_and_has_a_map(tmp_path: Path) -> None:
    robot = TeleoperatedRobot(simulation_plan("tracking", laser=True))
    robot.look()
    robot.drive(LEFT)
    assert robot.change_light() is None
    paths = robot.save(tmp_path / "drive", progress=silent)
    assert paths.survey.name == "map.yaml"
    *_, last = open_session(paths.session).moments()  # of scans those after a way or a turn are used
    made = list(robot.moments())[1].frame.scan
    assert np.array_equal(last.frame.scan.ranges_m, made.ranges_m, equal_nan=True)
