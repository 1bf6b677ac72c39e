"""`maurice-replay calibrate` as a person types it: what it prints, writes and refuses."""

from __future__ import annotations

import json
import sys
import tomllib
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.thesis.calibration_drive import TrialPlan, calibration_drive
from helpers.commands import failure, run, runs_of
from helpers.trials import write_trials
from maurice_mcl.filter.motion import OdometryMotion, OdometryParameters
from maurice_mcl.values.geometry import compose

FIGURES = {
    4: "turns",
    5: "turn-gain",
    6: "turns-corrected",
    7: "turn-residuals",
    8: "turn-residual-histogram",
    9: "straights",
    10: "heading-errors",
    11: "straight-error-histogram",
}


calibrate = partial(run, "calibrate")
refused = partial(failure, "calibrate")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    file = tmp_path / "trials.csv"
    write_trials(file, calibration_drive(3, TrialPlan(30, 30)))
    return file


def test_a_drive_is_made_fitted_and_written_for_the_filter(table, tmp_path):
    done = calibrate("motion", table, "-o", tmp_path / "m.toml")
    assert "turn gain, actual /" in done.stdout
    assert "30 turns" in done.stdout
    motion = tomllib.loads((tmp_path / "m.toml").read_text())["robot"]["motion"]
    assert motion["turn_gain"] == pytest.approx(1 / 1.3695, rel=0.05)
    assert set(motion["drift"]) == {"wood", "carpet"}
    assert "--force" in refused("motion", table, "-o", tmp_path / "m.toml")


def test_what_is_printed_without_a_file(table):
    printed = calibrate("motion", table).stdout
    assert "turn_gain" in tomllib.loads(printed[printed.index("[robot.motion]") :])["robot"]["motion"]
    facts = json.loads(calibrate("motion", table, "--json").stdout)
    gain = facts["turns"]["gain"]
    assert gain["low"] < gain["value"] < gain["high"]
    assert facts["motion"]["turn_gain"] == gain["value"]
    assert [drift["floor"] for drift in facts["drifts"]] == ["wood", "carpet"]
    assert "straight error (in)" in calibrate("motion", table, "--unit", "in").stdout
    calibrate("motion", table, "--unit", "feet", expect=2)


def carmen(file: Path, turns: bool) -> Path:
    """Write a drive in CARMEN's format, without pictures; its odometry errs by known alphas."""
    rng, model = np.random.default_rng(1), OdometryMotion(OdometryParameters(0.05, 0.002, 0.003, 0.0005))
    told, pose = np.zeros(3), np.zeros((1, 3), np.float32)
    lines = ["# message formats defined: PARAM ODOM TRUEPOS", "PARAM robot_width 0.4 host 0"]
    for k in range(200):
        at, (x, y, heading) = f"{k}.0", pose[0].tolist()
        lines.append(f"ODOM {told[0]} {told[1]} {told[2]} 0.5 0 0 {at} host {at}")
        lines.append(f"TRUEPOS {x} {y} {heading} {told[0]} {told[1]} {told[2]} {at} host {at}")
        motion = np.array([rng.uniform(0.3, 0.7), 0, rng.uniform(-1.2, 1.2) if turns else 0.0])
        told = compose(told, motion)
        pose = model.move(pose, np.zeros(2), motion, rng.normal(size=(1, 3)).astype(np.float32))
    file.write_text("\n".join(lines) + "\n")
    return file


def test_the_noise_of_odometry_from_a_recording_of_another_format(tmp_path, small_session):
    log = carmen(tmp_path / "drive.log", turns=True)
    done = calibrate("drive", log, "-o", tmp_path / "m.toml")
    assert "odometry model of drive.log, 199 movements" in done.stdout
    found = tomllib.loads((tmp_path / "m.toml").read_text())["robot"]["motion"]
    assert found["turn_from_turn"] == pytest.approx(0.05, rel=0.5)
    assert found["way_from_way"] == pytest.approx(0.003, rel=0.7)
    run(small_session, "--set", f"motion={tmp_path / 'm.toml'}", "-o", "none", "--particles", 50)
    facts = json.loads(calibrate("drive", log, "--json").stdout)
    assert facts["motion"] == found
    assert found["model"] == "odometry"
    assert "--force" in refused("drive", log, "-o", tmp_path / "m.toml")


def test_a_drive_that_goes_straight_says_what_it_cannot_tell(tmp_path):
    done = calibrate("drive", carmen(tmp_path / "drive.log", turns=False))
    notes = " ".join(done.stderr.split())
    assert "turn_from_turn: no movement" in notes
    assert "turn_from_turn = 0.02" in done.stdout
    calibrate("drive", tmp_path / "drive.log", "--model", "x", expect=2)


@pytest.mark.slow
def test_all_eight_figures_are_drawn_without_a_display(table, tmp_path, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987")  # nothing is there; nothing must ask
    calibrate("motion", table, "-o", tmp_path / "figures")
    files = sorted((tmp_path / "figures").iterdir())
    assert [f.name for f in files] == [f"figure-{n:02d}-{name}.png" for n, name in FIGURES.items()]
    for file in files:
        picture = cv2.imread(str(file))
        assert min(picture.shape[:2]) > 400
        colors = (picture.reshape(-1, 3) // 64).astype(int) @ [16, 4, 1]
        assert len(np.unique(colors)) > 3, file
    assert "--force" in refused("motion", table, "-o", tmp_path / "figures")
    calibrate("motion", table, "-o", tmp_path / "figures", "--force")


def test_figures_of_many_trials_of_one_floor_and_of_no_floor(tmp_path):
    rows = [f"turn,{k},{0.7 * k + k % 3},," for k in range(1, 90)]
    rows += [
        f"straight,{1 + k / 90},{0.9 + k / 90 + 0.01 * (k % 3)},{k % 4 if k else ''}," for k in range(90)
    ]
    file = tmp_path / "many.csv"
    file.write_text("kind,measured,actual,heading_error_deg,floor\n" + "\n".join(rows))
    done = calibrate("motion", file, "-o", tmp_path / "figures")
    assert "most turns go one way" in done.stderr
    assert len(list((tmp_path / "figures").iterdir())) == 8


def test_notes_tell_of_outliers(tmp_path):
    rows = [f"turn,{m},{0.73 * m + e}" for m, e in zip(range(-155, 156, 10), 16 * [1, -1], strict=True)]
    rows += ["turn,95,95", "turn,-95,-95"]  # two that slipped by 26 degrees
    rows += [f"straight,{k},{k + 0.01 * (-1) ** k}" for k in range(1, 8)]
    file = tmp_path / "slips.csv"
    file.write_text("kind,measured,actual\n" + "\n".join(rows) + "\n")
    notes = calibrate("motion", file).stderr
    assert "2 of 34 turn residuals lie beyond 3 sd" in " ".join(notes.split())


def test_a_missing_extra_is_one_line_with_the_command(table, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "pip install 'maurice-replay[plots]'" in refused("motion", table, "-o", tmp_path / "f")
    assert "pip install 'maurice-replay[plots]'" in refused("noise", tmp_path, "-o", tmp_path / "n.png")
    calibrate("motion", table)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kind,measured,actual\nturn,9,9\n", "found 1 turn and no straights, expected 3 or more"),
        ("kind,measured,actual\n" + "turn,9,9\n" * 9, "found 9 turns and no straights"),
        ("kind,measured,actual,colour\nturn,9,9,red\n", "found columns kind, measured, actual, colour"),
        ("kind,measured,actual\nturn,nan,9\n", "found measured 'nan'"),
    ],
    ids=["one movement", "only turns", "an unknown column", "NaN"],
)
def test_bad_tables_end_in_one_line(tmp_path, text, said):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    assert said in refused("motion", file)


def test_other_bad_sources_end_in_one_line(small_session, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "no such file" in refused("motion", tmp_path / "none.csv")
    assert "calibrate drive --model maurice fits" in " ".join(refused("motion", small_session).split())
    assert "neither pictures nor a log" in refused("noise", tmp_path / "empty")


def test_noise_of_a_survey_and_its_figure(small_session, tmp_path):
    survey = tmp_path / "survey.log"
    done = calibrate("noise", survey, "-o", tmp_path / "noise.png")
    assert "16 to 23" in done.stdout
    figure = cv2.imread(str(tmp_path / "noise.png"))
    assert figure.std() > 10
    facts = json.loads(calibrate("noise", survey, "--json").stdout)
    assert facts["frames"] == 1
    assert facts["peaks"][0] == {
        "color": "red", "count": 255.0, "sd": None, "first_value": 16, "last_value": 23,
        "largest_bin_sd": None,
    }  # fmt: skip
    assert "--force" in refused("noise", survey, "-o", tmp_path / "noise.png")
    (tmp_path / "lit").mkdir()
    cv2.imwrite(str(tmp_path / "lit" / "bright.png"), np.full((8, 8, 3), 180, np.uint8))
    assert "was the lens covered?" in calibrate("noise", tmp_path / "lit").stderr


def test_motion_from_a_file_takes_the_place_of_the_header_s(small_session, tmp_path):
    def error(*args: str | Path) -> float:
        (found,) = runs_of(run(small_session, "-o", "none", "--json", *args).stdout)
        return float(found["error_mean_m"])

    right, wrong = tmp_path / "right.toml", tmp_path / "wrong.toml"
    text = '[robot.motion]\nmodel = "maurice"\nturn_gain = {}\nstraight_bias_m = 0.0\nturn_sd_rad = 0.02\n'
    right.write_text(text.format("1.0"))
    wrong.write_text(text.format("0.2"))
    assert error("--set", f"motion={right}") < error("--set", f"motion={wrong}")


def test_bad_motion_files_are_named(small_session, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("[robot.motion]\nturn_gian = 1.0\n")
    words = (small_session, "-o", "none", "--set", f"motion={bad}")
    assert f"{bad}: robot.motion.turn_gian is not known" in failure(*words)
    bad.write_text("turn_gain = 1.0\n")
    assert (
        "expected a table [robot.motion]"
        in run(small_session, "-o", "none", "--set", f"motion={bad}", expect=1).stderr
    )
