"""The session doctor and the library check on the command line."""

from __future__ import annotations

import json
import math
import re
import shlex
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers import expect_facts
from helpers.commands import failure, run, runs_of
from maurice_loaders.reading.options import Reading, read_reading
from maurice_viz.cli.shared.values import reading_of


def in_millimeters(log: Path) -> Path:
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    for line in lines:
        if "odometry" in line:
            forward, left, turn = line["odometry"]
            line["odometry"] = [1000 * forward, 1000 * left, turn]
    out = log.with_name("wrong.log")
    out.write_text("\n".join(json.dumps(line) for line in lines) + "\n")
    return out


def with_jump(log: Path) -> Path:
    """Write the log with a step of 50 m in the ninth motion."""
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    number = 0
    for line in lines:
        if "odometry" in line:
            number += 1
            line["odometry"][0] += 50.0 if number == 9 else 0.0
    out = log.with_name("jump.log")
    out.write_text("\n".join(json.dumps(line) for line in lines) + "\n")
    return out


def test_a_jump_of_odometry_is_told_before_a_filter_is_blamed(small_session):
    jump, fix = with_jump(small_session), "--reading odometry_are=jumping"
    done = run("doctor", jump)
    assert "1. odometry jumps 50.1 m in 2 s, at 16.0 s of the drive [odometry-jump]" in (done.stdout)
    assert f"fix: maurice-replay {jump} {fix}\n" in done.stdout
    assert "found nothing wrong" in run("doctor", jump, *fix.split()).stdout
    line = f"[odometry-jump]; fix: {fix}"
    assert line in run(jump, "-o", "none", "--preset", "thesis", "--save-run", "run").stderr
    told = run("diagnose", "run").stdout
    assert told.startswith("The recording: odometry jumps 50.1 m")
    assert "Odometry jumps at step 9" in told
    assert any(line in text for text in json.loads(run("inspect", jump, "--json").stdout)["warnings"])
    assert line not in run(small_session, "-o", "none").stderr


def test_a_healthy_session_is_said_to_be_so(small_session):
    done = run("doctor", small_session, "--strict")
    assert "14 odometry, 14 truth, 14 pictures" in done.stdout
    assert "14 pictures against the library" in done.stdout
    assert "found nothing wrong" in done.stdout


def test_pictures_that_are_gone_are_no_defect_of_the_doctor(small_session):
    for picture in small_session.parent.glob("pictures/session*"):
        picture.unlink()
    assert "14 odometry, 14 truth" in run("doctor", small_session).stdout


def test_what_is_wrong_is_told_and_strict_fails(small_session):
    wrong = in_millimeters(small_session)
    done = run("doctor", wrong, "--no-library")
    assert "1. lengths of odometry are in millimeters [scale]" in done.stdout
    assert "why: " in done.stdout
    assert f"fix: maurice-replay {wrong} --reading odometry_scale=0.001\n" in done.stdout
    run("doctor", wrong, "--no-library", "--strict", expect=1)
    done = run("doctor", wrong, "--no-library", "--json")
    found = json.loads(done.stdout)
    assert found["healthy"] is False
    assert [one["code"] for one in found["findings"]] == ["scale"]
    assert found["findings"][0]["numbers"]["scale"] == pytest.approx(0.001, rel=0.05)
    assert found["findings"][0]["options"] == found["options"] == ["--reading", "odometry_scale=0.001"]
    assert found["not_asked"] == ["pictures: no library was given"]


@pytest.mark.parametrize(
    ("units", "told"),
    [("m", r"would go at \d+ m/s, on a map of [\d.]+ m; so it is [\d.]+ m/s fix:"),
     ("in", r"would go at [\d,]+ in/s, on a map of [\d.]+ in; so it is [\d.]+ in/s fix:")],
)  # fmt: skip
def test_evidence_has_lengths_in_the_units_of_the_session(small_session, units, told):
    lines = [json.loads(line) for line in in_millimeters(small_session).read_text().splitlines()]
    lines[0]["display_units"] = units
    log = small_session.with_name("units.log")
    log.write_text("".join(json.dumps(line) + "\n" for line in lines if "truth" not in line))
    said = " ".join(run("doctor", log, "--no-library").stdout.split())
    assert re.search(told, said), said


def test_a_recording_without_pictures_is_not_asked_for_a_library(tmp_path):
    path = tmp_path / "path.txt"
    path.write_text("".join(f"{k} {k} 0 0 0 0 0 1\n" for k in range(5)))
    said = run("doctor", path).stdout
    assert "pictures: there are none" in said
    expect_facts(said, "no odometry", "--reading odometry_from_truth=true")


def test_what_it_says_is_a_command_that_mends(small_session, tmp_path):
    def replayed(*words: str) -> object:
        (found,) = runs_of(run(*words, "-o", "none", "--json", "--particles", "200").stdout)
        return {name: value for name, value in found.items() if isinstance(value, float)}

    wrong, survey = in_millimeters(small_session), small_session.with_name("survey.log")
    said = run("doctor", wrong, "--library", survey).stdout
    lines = dict(line.strip().partition(": ")[::2] for line in said.splitlines())
    _, *fix = shlex.split(lines["fix"])
    assert fix == [str(wrong), "--reading", "odometry_scale=0.001", "--library", str(survey)]
    assert replayed(*fix) == pytest.approx(replayed(small_session))
    _, *again = shlex.split(lines["try"])
    assert "found nothing wrong" in run(*again).stdout
    _, *keep = shlex.split(lines["keep"].replace("FIXED.log", str(tmp_path / "fixed.log")))
    run(*keep)
    assert replayed(str(tmp_path / "fixed.log")) == pytest.approx(replayed(small_session))


def test_options_that_were_given_are_kept_and_corrected(small_session):
    wrong = in_millimeters(small_session)
    words = ["--no-library", "--json", "--reading", "odometry_scale=0.1", "--reading", "min_distance_m=0.01"]
    found = json.loads(run("doctor", wrong, *words).stdout)
    assert set(found["options"]) == {"--reading", "min_distance_m=0.01", "odometry_scale=0.001"}


def test_fix_writes_a_reading_file(small_session, tmp_path):
    wrong, out = in_millimeters(small_session), tmp_path / "reading.toml"
    words = ["--no-library", "-o", out]
    run("doctor", small_session, *words)
    assert not out.exists()
    done = run("doctor", wrong, *words)
    assert f"--reading {out}" in done.stderr
    assert read_reading(out) == Reading(odometry_scale=0.001)
    run("doctor", wrong, *words, expect=1)
    run("doctor", wrong, *words, "--force")


def test_options_are_typed_as_they_are_read():
    given = Reading(
        format="table", columns={"x": "px:mm"}, table=Path("a b.csv"), min_angle_rad=math.pi / 6,
        max_dt_s=0.5,
        odometry_from_truth=True, turn_scale=-1.0, camera_yaw_rad=-math.pi / 4, odometry_are="steps",
        time_unit="ns", truth_offset_s=-1_700_000_000.25,
    )  # fmt: skip
    read = reading_of(given.words[1::2])
    assert replace(read, camera_yaw_rad=0.0, min_angle_rad=0.0) == replace(
        given, camera_yaw_rad=0.0, min_angle_rad=0.0
    )
    assert (read.camera_yaw_rad, read.min_angle_rad) == pytest.approx((-math.pi / 4, math.pi / 6))
    assert Reading().words == ()


@pytest.mark.parametrize(
    "words", [("turn_scale", "0"), ("turn_gain", "nan"), ("picture_offset_s", "inf"), ("odometry_are", "x")]
)
def test_bad_corrections_are_usage_errors(words, small_session):
    done = run("doctor", small_session, "--reading", "=".join(words), expect=2)
    assert words[0] in done.stderr
    assert not done.stdout


def test_readings_are_for_recordings(small_session):
    done = run("replay", small_session, "--follow", "--reading", "turn_scale=-1", expect=2)
    assert "--reading turn_scale=-1 needs a recording" in done.stderr.replace("\n", " ")
    wrong = in_millimeters(small_session)
    plain = run("inspect", small_session, "--json")
    found = run("inspect", str(wrong), "--reading", "odometry_scale=0.001", "--json")
    ways = [json.loads(one.stdout)["distance_odometry_m"] for one in (plain, found)]
    assert ways[0] == pytest.approx(ways[1])


@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02", b'{"format": "maurice-session-log"'])
def test_no_session_is_one_line(content, tmp_path):
    bad = tmp_path / "bad.log"
    bad.write_bytes(content)
    done = run("doctor", bad, expect=1)
    assert (done.stdout, done.stderr.count("\n")) == ("", 1)


def test_library_check_prints_and_draws(small_session, tmp_path):
    survey, out = small_session.parent / "survey.log", tmp_path / "map.png"
    done = run("library", "check", survey, "-o", out)
    assert "160 at 20 places; neighbors of one heading are" in done.stdout
    assert "100% of" in done.stdout
    image = cv2.imread(out)
    assert image.std() > 10
    assert "--force" in failure("library", "check", survey, "-o", out)
    found = json.loads(run("library", "check", survey, "--json").stdout)
    assert (found["entries"], found["places"]) == (160, 20)
    assert found["covered_share"] == 1
    assert found["spacing_m"] == pytest.approx(0.5)
    assert len(found["ambiguity"]) == 20
    assert all(one["places"] >= 1 for one in found["ambiguity"])
    assert 0 <= found["retrieved_right_share"] <= 1


def test_a_library_is_built_from_a_drive(small_session, tmp_path):
    out = tmp_path / "driven"
    done = run("library", "build", small_session, "-o", out, "--every", "0.2m,30deg")
    assert "of 14 pictures taken" in done.stderr
    assert "coverage: " in done.stdout
    shown = json.loads(run("library", "show", out, "--json").stdout)
    assert 5 <= shown["entries"] <= 14
    assert shown["pictures_kept"] == shown["entries"]


@pytest.mark.parametrize("every", ["0.4", "deg", "0.4m,45"])
def test_bad_spacing_is_a_usage_error(every, small_session, tmp_path):
    done = run("library", "build", small_session, "-o", tmp_path / "x", "--every", every, expect=2)
    assert "--every" in done.stderr
    assert not (tmp_path / "x").exists()


def test_a_bags_own_map_is_what_its_scans_are_compared_with(tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    from helpers import bags

    bag = bags.write_ros2(tmp_path / "bag", bags.laser_amcl_drive(bags.Ros(2)))
    assert "8 scans against the map" in run("doctor", bag).stdout
    assert json.loads(run("inspect", bag, "--json").stdout)["has_map"] is True
    bare = bags.write_ros2(tmp_path / "bare", bags.laser_drive(bags.Ros(2)))
    assert "the map: none was given" in run("doctor", bare).stdout
    assert json.loads(run("inspect", bare, "--json").stdout)["has_map"] is False


def test_a_bags_map_that_is_of_no_use_is_a_finding(tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    from helpers import bags

    drive = bags.laser_amcl_drive(bags.Ros(2))
    (grid,) = (said.message for said in drive if said.topic == "/map")
    grid.info.origin.position.x = float("nan")
    done = run("doctor", bags.write_ros2(tmp_path / "bag", drive), "--strict", expect=1)
    expect_facts(
        done.stdout, "cannot be used [map-unusable]", "/map", "origin at (nan, 0, 0)", "--map map.yaml"
    )


def test_a_fix_names_the_map_as_it_was_typed(tmp_path, small_session):
    occupancy = tmp_path / "map.yaml"
    cv2.imwrite(str(tmp_path / "map.pgm"), np.pad(np.full((38, 38), 254, np.uint8), 1))
    occupancy.write_text(
        "image: map.pgm\nresolution: 0.1\norigin: [-2, -2, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    done = run("doctor", in_millimeters(small_session), "--map", occupancy)
    assert f"odometry_scale=0.001 --map {occupancy}\n" in done.stdout
