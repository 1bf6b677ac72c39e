"""Odometry from the truth: repeatable, of the stated noise, said aloud, refused where it has no place."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from helpers import expect_facts
from helpers.format_samples import sample
from helpers.recordings import Given, odometry
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import Motion, Note, OdometryPose, TruthPose
from maurice_loaders.reading.session import RecordedSession, first_truth
from maurice_loaders.reading.transforms import (
    NAMED,
    MadeOdometry,
    OdometryNoise,
    odometry_from_truth,
)
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose, motion_between
from maurice_viz.cli.app import app

MADE = Reading(odometry_from_truth=True)
COLUMNS = ("odometry_x", "odometry_y", "odometry_heading_rad")
QUIET = OdometryNoise(0, 0, 0)


def truths(poses: F64, dt_s: float = 0.1) -> Given:
    return Given([TruthPose(dt_s * k, pose) for k, pose in enumerate(poses)])


def circle(count: int, way_m: float, turn_rad: float) -> F64:
    poses = [np.array([3.0, -2.0, 1.0])]
    for _ in range(count):
        poses.append(compose(poses[-1], np.array([way_m, 0, turn_rad])))
    return np.array(poses)


def test_without_noise_it_is_the_truths_own_way() -> None:
    poses = circle(50, 0.1, 0.2)
    found = odometry(MadeOdometry(truths(poses), 0, QUIET))
    assert found[0].tolist() == [0, 0, 0]
    one, same, other = (odometry(MadeOdometry(truths(poses), seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.01
    for k in range(50):
        np.testing.assert_allclose(
            motion_between(found[k], found[k + 1]), motion_between(poses[k], poses[k + 1]), atol=1e-9
        )


@pytest.mark.parametrize("steps", [10, 100])
def test_the_noise_is_what_it_says_however_often_truth_comes(steps: int) -> None:
    """A movement of 0.5 m is one draw, cut into 10 or 100 pieces; many seeds give its spread."""
    poses = circle(steps, 0.499 / steps, 0.0)
    ends = np.array([odometry(MadeOdometry(truths(poses), seed))[-1] for seed in range(300)])
    noise = OdometryNoise()
    ways = np.hypot(ends[:, 0], ends[:, 1])
    assert ways.std() == pytest.approx(0.5 * noise.way_share, rel=0.15)
    assert ends[:, 2].std() == pytest.approx(0.5 * noise.drift_rad_per_m, rel=0.15)
    turned = circle(steps, 0.0, (math.pi / 4 - 1e-3) / steps)
    ends = np.array([odometry(MadeOdometry(truths(turned), seed))[-1] for seed in range(300)])
    assert ends[:, 2].std() == pytest.approx(math.pi / 4 * noise.turn_share, rel=0.15)
    assert not ends[:, :2].any()


def test_wheels_do_not_see_that_the_robot_is_carried() -> None:
    a, b = np.array([0.0, 0, 0]), np.array([50.0, 9, 2])
    later = compose(b, np.ones(3))
    drive = Given([TruthPose(0, a), Note(1, "kidnapped"), TruthPose(2, b), TruthPose(3, later)])
    found = odometry(MadeOdometry(drive, 0, QUIET))
    np.testing.assert_allclose(found, [[0, 0, 0], [0, 0, 0], [1, 1, 1]], atol=1e-9)


def test_the_robots_own_gain_does_not_apply_to_it() -> None:
    drive = truths(circle(3, 0.5, 0.4))
    drive = replace(drive, info=replace(drive.info, motion={"model": "maurice", "turn_gain": 0.73}))
    assert odometry_from_truth(drive, 0).info.motion is None


def test_it_is_refused_without_truth_and_beside_odometry() -> None:
    with pytest.raises(InputError, match="found no truth, and odometry_from_truth needs true poses"):
        odometry_from_truth(Given([Note(0, "on")]), 0)
    pose = np.zeros(3)
    for measured in (OdometryPose(0, pose), Motion(1, pose)):
        with pytest.raises(InputError, match="leave odometry_from_truth out"):
            odometry_from_truth(Given([TruthPose(0, pose), measured]), 0)


@pytest.mark.parametrize("name", ["tum", "kitti", "table", "session-log"])
def test_every_picture_has_its_way(name: str, tmp_path: Path) -> None:
    path = sample(name, tmp_path / "made")
    if name == "tum":
        (path / "odometry.txt").unlink()
    elif name == "table":
        rows = [line.split(",") for line in (path / "drive.csv").read_text().splitlines()]
        (path / "drive.csv").write_text("\n".join(",".join(row[:2] + row[5:]) for row in rows))
    elif name == "session-log":
        kept = [line for line in path.read_text().splitlines() if '"odometry"' not in line]
        path.write_text("\n".join(kept) + "\n")
    bare = open_session(path)
    assert not any(len(m.frame.motions) for m in bare.moments())
    session = open_session(path, MADE)
    assert NAMED in session.info.name
    assert session.info.notes[-1].startswith("ODOMETRY IS NOT MEASURED")
    moments = list(session.moments())
    assert session.warnings[0].startswith("ODOMETRY IS NOT MEASURED")
    assert [len(m.frame.motions) for m in moments] == [0, 1, 1, 1]
    for a, b in pairwise(moments):
        assert a.truth is not None
        assert b.truth is not None
        np.testing.assert_allclose(b.frame.motions[0], motion_between(a.truth, b.truth), atol=0.02)


def test_what_can_be_done_is_said_and_gating_counts_made_odometry(tmp_path: Path) -> None:
    with_truth, without = (open_session(sample(name, tmp_path / name)) for name in ("kitti", "video"))
    for session in (with_truth, without):
        list(session.moments())
    assert any("odometry_from_truth" in text for text in with_truth.warnings)
    (told,) = [text for text in without.warnings if "odometry" in text]
    expect_facts(told, "found no odometry", "odometry_topic=", *COLUMNS, "table=")
    assert not any("odometry_from_truth" in text for text in without.warnings)
    made = open_recording(sample("kitti", tmp_path / "made"), MADE)
    assert RecordedSession(made, Reading(min_distance_m=0.08)).overview()[0] == 2


@pytest.mark.parametrize("name", ["pictures", "video"])
def test_pictures_alone_get_the_path_that_the_line_asks_for(name: str, tmp_path: Path) -> None:
    path, table = sample(name, tmp_path / "made"), tmp_path / "path.csv"
    rows = [f"{k},{0.1 * k},0,0" for k in range(open_session(path).count_pictures())]
    table.write_text("\n".join([",".join(["frame", *COLUMNS]), *rows]))
    session = open_session(path, table=table)
    first, *others = session.moments()
    assert not any("no odometry" in text for text in session.warnings)
    assert len(first.frame.motions) == 0
    assert others
    for moment in others:
        np.testing.assert_allclose(moment.frame.motions, [[0.1, 0, 0]])


def test_a_drive_begins_at_its_first_true_pose() -> None:
    poses = circle(3, 0.5, 0.4)
    np.testing.assert_allclose(first_truth(truths(poses)), poses[0])  # type: ignore[arg-type]  # there is one
    measured = [OdometryPose(k, motion_between(poses[0], poses[k])) for k in range(3)]
    steps = [Motion(k, np.array([0.5, 0, 0.4])) for k in range(3)]
    for late in ([*measured, TruthPose(2, poses[2])], [*steps, TruthPose(3, poses[3])]):
        np.testing.assert_allclose(first_truth(Given(late)), poses[0], atol=1e-9)  # type: ignore[arg-type]
    assert first_truth(Given([Note(0, "on")])) is None


def test_the_command_says_it_before_in_the_table_and_in_json(small_session: Path) -> None:
    kept = [line for line in small_session.read_text().splitlines() if '"odometry"' not in line]
    small_session.write_text("\n".join(kept) + "\n")
    typed = "-o none --particles 400 --reading odometry_from_truth=true --start truth"
    words = [str(small_session), *typed.split()]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    assert done.stderr.splitlines()[0].startswith("ODOMETRY IS NOT MEASURED")
    assert NAMED in done.stdout
    done = CliRunner().invoke(app, [*words, "--json", "--save-run", str(small_session.with_name("kept"))])
    found = json.loads(done.stdout)
    assert "ODOMETRY IS NOT MEASURED" in found["notes"][0]
    assert found["runs"][0]["updates"] == 14
    assert found["runs"][0]["error_mean_m"] < 0.3
    verified = CliRunner().invoke(app, ["verify", str(small_session.with_name("kept"))])
    assert verified.exit_code == 0, verified.stderr
    done = CliRunner().invoke(app, [*words, "--reading", "odometry_seed=5", "--json"])
    assert json.loads(done.stdout)["runs"] != found["runs"]


def test_starting_where_there_is_no_truth_is_refused(tmp_path: Path, small_session: Path) -> None:
    pictures, survey = sample("pictures", tmp_path / "made"), small_session.with_name("survey.log")
    for start, told in (("truth", "found no truth to start from"), ("tracking", "give --start truth")):
        words = [str(pictures), "--library", str(survey), "-o", "none", "--start", start]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 1
        assert told in done.stderr.splitlines()[-1]
