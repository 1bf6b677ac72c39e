"""Recordings of other formats on the command line: replayed as the session log of the same drive is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from helpers.commands import maurice, run
from maurice_loaders.formats.registry import formats as all_formats
from maurice_loaders.formats.registry import open_session
from maurice_mcl.values.geometry import compose
from maurice_viz.cli.shared.values import reading_of


def as_table(session: Path) -> Path:
    """Write the drive of a session log as a table of odometry's poses and the truth."""
    log = open_session(session)
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


def test_a_table_replays_as_the_log_of_the_same_drive(small_session):
    """The first motion is missing, which goes before the first picture, and nothing else."""
    table, survey = as_table(small_session), small_session.with_name("survey.log")
    common = ("-o", "none", "--json", "--particles", 500, "--start", "global")
    native, _ = maurice(small_session, *common)
    other, said = maurice(table, "--library", survey, *common)
    assert "read as table" in said
    (one,), (two,) = json.loads(native)["runs"], json.loads(other)["runs"]
    assert one["updates"] == two["updates"] == 14
    assert one["distance_m"] == pytest.approx(two["distance_m"])
    assert two["error_final_m"] < 0.5


def test_recordings_need_a_library_and_sound_options(small_session):
    assert "name one with --library" in run(as_table(small_session), "-o", "none", expect=1).stderr
    for pair in ("columns=a", "columns==b", "time_unit=h", "max_dt_s=-1", "max_dt=1", "odometry_seed=x"):
        run(small_session, "-o", "none", "--reading", pair, expect=2)
    assert reading_of(["columns=image=file, heading=yaw:deg"]).columns == {
        "image": "file",
        "heading": "yaw:deg",
    }
    gated = ("--particles", 100, "--reading", "min_distance_m=0.2")
    out, _ = maurice(small_session, "-o", "none", "--json", *gated)
    assert json.loads(out)["runs"][0]["updates"] == 7


def test_formats_are_listed_and_extras_named(small_session, monkeypatch):
    listed, contents = (json.loads(run("inspect", *path, "--json").stdout) for path in ([], [small_session]))
    assert [one["name"] for one in listed] == list(all_formats())
    assert contents["format"] == "session-log"
    run("inspect", small_session.with_name("nowhere"), expect=1)
    monkeypatch.setattr("maurice_loaders.formats.registry.find_spec", lambda name: None)
    assert "'maurice-replay[ros]'" in run("inspect").stdout  # a cell of the table, over two lines


def test_brackets_in_names_are_shown_as_they_are(small_session):
    """Tables are no markup."""
    header, *rest = small_session.read_text().splitlines()
    named = json.dumps(json.loads(header) | {"name": "my [bold] drive"})
    small_session.write_text("\n".join([named, *rest]) + "\n")
    assert "my [bold] drive" in run("inspect", small_session).stdout
    assert "my [bold] drive" in run(small_session, "-o", "none", "--particles", 50).stdout
