"""Recordings of other formats on the command line: replayed as the session log of the same drive is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from maurice_loaders.formats.registry import formats as all_formats
from maurice_loaders.session_log.reader import SessionLog
from maurice_mcl.geometry import compose
from maurice_viz.cli.app import app
from maurice_viz.cli.options import columns_of


def run(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    return done.exit_code, done.stdout, done.stderr


def as_table(session: Path) -> Path:
    """Write the drive of a session log as a table of odometry's poses and the truth."""
    log = SessionLog(session)
    rows = ["time_s,image,odometry_x_m,odometry_y_m,odometry_heading_rad,x_m,y_m,heading_rad"]
    pose = None
    for moment in log.moments():
        for motion in moment.frame.motions:
            pose = motion * 0 if pose is None else compose(pose, motion)
        assert pose is not None
        assert moment.truth is not None
        numbers = ",".join(f"{v:.9f}" for v in (*pose, *moment.truth))
        rows.append(f"{moment.frame.time_s},{moment.frame.picture},{numbers}")
    table = session.with_name("drive.csv")
    table.write_text("\n".join(rows))
    return table


def test_a_table_replays_as_the_log_of_the_same_drive(small_session: Path) -> None:
    """The first motion is missing, which goes before the first picture, and nothing else."""
    table, survey = as_table(small_session), small_session.with_name("survey.log")
    common = ("--no-recording", "--json", "--particles", 500, "--start", "global")
    code, native, _ = run(small_session, *common)
    assert code == 0
    code, other, said = run(table, "--library", survey, *common)
    assert code == 0, said
    assert "read as table" in said
    (one,), (two,) = json.loads(native)["runs"], json.loads(other)["runs"]
    assert one["updates"] == two["updates"] == 14
    assert one["distance_m"] == pytest.approx(two["distance_m"])
    assert two["position_error_final_m"] < 0.5


def test_fewer_updates_with_gating(small_session: Path) -> None:
    code, out, _ = run(
        small_session, "--no-recording", "--json", "--particles", 100, "--reading", "min_distance_m=0.2"
    )
    assert code == 0
    assert json.loads(out)["runs"][0]["updates"] == 7


def test_a_recording_needs_a_library(small_session: Path) -> None:
    code, _, said = run(as_table(small_session), "--no-recording")
    assert code == 1
    assert "name one with --library" in said


def test_options_that_make_no_sense_are_usage_errors(small_session: Path) -> None:
    for pair in ("columns=a", "columns==b", "time_unit=h", "max_dt_s=-1", "max_dt=1", "odometry_seed=x"):
        assert run(small_session, "--no-recording", "--reading", pair)[0] == 2
    code, _, said = run(small_session, "--odometry-scale", "0.1")
    assert code == 2
    assert "odometry_scale" in said
    assert columns_of("image=file, heading=yaw:deg") == {"image": "file", "heading": "yaw:deg"}


def test_formats_are_listed_and_a_file_is_told(small_session: Path) -> None:
    listed = CliRunner().invoke(app, ["formats", "--json"])
    assert [one["name"] for one in json.loads(listed.stdout)] == list(all_formats())
    told = CliRunner().invoke(app, ["formats", str(small_session), "--json"])
    assert [one["name"] for one in json.loads(told.stdout)] == ["session-log"]
    assert CliRunner().invoke(app, ["formats", str(small_session.with_name("nowhere"))]).exit_code == 1


def test_an_extra_that_is_missing_is_named_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maurice_viz.app.inspect.find_spec", lambda name: None)
    assert "pip install 'maurice-replay[ros]'" in run("formats")[1]


def test_brackets_in_names_are_shown_as_they_are(small_session: Path) -> None:
    """Tables are no markup."""
    header, *rest = small_session.read_text().splitlines()
    named = json.dumps(json.loads(header) | {"name": "my [bold] drive"})
    small_session.write_text("\n".join([named, *rest]) + "\n")
    assert "my [bold] drive" in run("inspect", small_session)[1]
    assert "my [bold] drive" in run(small_session, "--no-recording", "--particles", 50)[1]
